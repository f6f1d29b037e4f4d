"""The module of an exported MJCF, without its effects; it imports nothing of Pliant."""
