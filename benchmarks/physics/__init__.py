"""Benchmarks of the engines on the published helix: speed at a stated residual, agreement, scaling, energy."""
