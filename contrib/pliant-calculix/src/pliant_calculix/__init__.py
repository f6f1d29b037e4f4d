"""Pliant's FEM backend 'calculix'."""
