"""Policies that an optimizer trains."""
