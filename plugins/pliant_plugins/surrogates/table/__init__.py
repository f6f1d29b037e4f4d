"""Joint laws from tables: measurements or FEM from elsewhere, interpolated and smoothed as far as they scatter."""
