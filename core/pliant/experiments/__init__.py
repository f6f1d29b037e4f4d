"""Runs that a bench can do: the menu, a study's own protocols, and the file that the bench fills in.

Import from the files: `menu.py` holds the default menu, `protocols.py` a study's own runs.
"""
