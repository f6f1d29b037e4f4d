"""Comparison of the model with a recording: prediction, comparison, and where the error is.

Import from the modules: `prediction.py` simulates the measured runs, `comparison.py` computes the errors.
"""
