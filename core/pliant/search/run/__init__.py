"""The search itself: proposals, journals, results."""
