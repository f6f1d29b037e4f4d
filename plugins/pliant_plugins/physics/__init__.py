"""Physics that ship with Pliant."""
