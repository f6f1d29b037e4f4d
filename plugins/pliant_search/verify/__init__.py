"""The check of the best design by direct FEM."""
