"""Interpretation of a study's `search` block."""
