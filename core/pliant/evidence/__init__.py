"""The model against a recording: prediction → comparison, and where the error is.

Import from the files: `prediction.py` drives the model, `comparison.py` judges it.
"""
