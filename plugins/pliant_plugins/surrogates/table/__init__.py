"""Joint laws from tables: measurements or external FEM, interpolated and smoothed according to their scatter."""
