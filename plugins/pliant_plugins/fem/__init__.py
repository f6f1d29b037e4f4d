"""Fem that ship with Pliant."""
