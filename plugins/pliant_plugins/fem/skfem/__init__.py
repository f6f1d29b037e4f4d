"""The default FEM backend: scikit-fem's quadratic hexahedra, our own batched assembly, a direct solver."""
