"""Tasks that ship with Pliant."""
