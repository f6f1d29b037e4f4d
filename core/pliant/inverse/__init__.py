"""Inverse statics: which actuations bring the robot where it should be."""
