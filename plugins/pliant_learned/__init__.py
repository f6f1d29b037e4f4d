"""Learned term: a smooth curve for the error that no listed effect explains. Start at `learning.learn`."""
