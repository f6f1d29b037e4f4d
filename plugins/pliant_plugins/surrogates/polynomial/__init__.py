"""Polynomial joint laws: fitted with the degree that the data support, or stated by coefficients."""
