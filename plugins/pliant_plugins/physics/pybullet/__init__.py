"""Chains in PyBullet."""
