"""Pliant: soft robots from finite elements to fast, honest chain models."""

__version__ = "0.1.0"
