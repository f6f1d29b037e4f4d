"""The module beside an exported MJCF, without its effects; it imports nothing of Pliant."""
