"""Benchmarks of benches and of the closed loop."""
