"""Reach around: tips at places and directions behind fixed obstacles."""
