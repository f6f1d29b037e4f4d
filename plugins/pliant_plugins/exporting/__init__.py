"""Chains as files for other programs: MJCF and URDF, with surfaces beside them."""
