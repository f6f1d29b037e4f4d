"""Effects that ship with Pliant."""
