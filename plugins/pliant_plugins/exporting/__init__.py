"""Chains as files for other programs: MJCF and URDF, with their surfaces as mesh files."""
