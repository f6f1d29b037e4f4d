"""Experiments: the runs that a bench can do, and the files that it does them from."""
