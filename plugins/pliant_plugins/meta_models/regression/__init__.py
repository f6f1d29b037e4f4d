"""Regression meta-model: Gaussian processes and others from a design's parameters to its law's coefficients."""
