"""Which physical effect is missing: candidates → fits → evidence → verdict.

Import from the files: `diagnosis.py` holds the whole path, the others one step each.
"""
