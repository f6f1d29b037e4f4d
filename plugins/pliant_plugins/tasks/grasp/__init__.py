"""Grasp: fingers are lowered over an object, actuated and lifted."""
