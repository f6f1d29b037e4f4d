"""Surrogates that ship with Pliant."""
