"""Benchmarks of benches."""
