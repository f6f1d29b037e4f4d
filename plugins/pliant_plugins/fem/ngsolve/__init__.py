"""A second FEM backend, independent of the first: NGSolve's Taylor–Hood elements and automatic differentiation."""
