"""Recordings: files are read, repeats identified, noise floors and effective sample sizes estimated.

Import from the modules: `reading.py` is the entry point.
"""
