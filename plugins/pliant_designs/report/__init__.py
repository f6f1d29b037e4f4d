"""Pages and documents of sweeps and meta-models."""
