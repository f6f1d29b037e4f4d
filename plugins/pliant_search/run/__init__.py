"""Run of a search: proposals, journals, results."""
