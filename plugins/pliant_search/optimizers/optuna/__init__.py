"""Optuna's samplers, and its storages so that its dashboard shows a search while it runs."""
