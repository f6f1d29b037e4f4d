"""Figures of printed solids and moulds."""
