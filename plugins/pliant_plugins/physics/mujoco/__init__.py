"""Chains in MuJoCo."""
