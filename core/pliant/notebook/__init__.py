"""Pliant at a Python prompt and in notebooks: a study with methods, results that display themselves."""
