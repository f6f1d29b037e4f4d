"""Modules that are written beside exported files: they run without Pliant, and nothing here imports them."""
