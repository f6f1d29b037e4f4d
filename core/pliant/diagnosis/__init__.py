"""Identification of the missing effect: candidates → fits → evidence → verdict.

Import from the modules: `diagnosis.py` runs the whole path, the others one step each.
"""
