"""What limits the best design, and how the objective changes about it."""
