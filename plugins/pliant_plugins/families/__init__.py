"""Families that ship with Pliant."""
