"""Data of the pictures that move on a page, where the still one is drawn by other means."""
