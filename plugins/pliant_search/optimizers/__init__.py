"""Optimizers that ship with Pliant."""
