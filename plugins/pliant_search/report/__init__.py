"""The page and the folder of a finished search."""
