"""Benches that perform runs, and `pliant experiment`, which plans, runs, records and diagnoses in a closed loop."""
