"""Bodies in space: what the 3D views of pages show, one file per subject."""
