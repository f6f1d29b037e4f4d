"""Experiments: the menu of runs, a study's own protocols, and the file to fill in during the experiment.

Import from the modules: `experiment_catalogue.py` has the default menu and a study's own runs.
"""
