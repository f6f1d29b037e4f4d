"""Evaluation of a search's candidates."""
