"""Limits of the best design, and the sensitivity of the objective around it."""
