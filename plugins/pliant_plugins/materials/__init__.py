"""Materials that ship with Pliant."""
