"""Bench recordings: files are read, repeats recognised, noise floors and effective sample sizes estimated.

Import from the files: `reading.py` is the way in.
"""
