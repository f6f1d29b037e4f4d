"""Solids to print and moulds to cast: the robot as its FEM has it, closed, checked, with a bill."""
