"""Benchmarks of the tasks in scenes."""
