"""The 3D views of pages, one module per subject."""
