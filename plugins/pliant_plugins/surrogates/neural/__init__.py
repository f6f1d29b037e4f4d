"""Joint laws from a small network of an energy, trained by torch on values and slopes, evaluated by numpy."""
