"""Static equilibrium of a chain by Newton's method in joint coordinates."""
