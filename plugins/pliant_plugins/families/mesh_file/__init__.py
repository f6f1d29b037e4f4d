"""A module whose volume mesh comes from a file: CAD, another mesher, another code."""
