"""Formulas of a search: read from text, computed."""
