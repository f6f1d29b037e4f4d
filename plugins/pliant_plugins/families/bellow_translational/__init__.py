"""Bellow without a constraint: pressure extends it."""
