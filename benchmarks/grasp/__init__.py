"""Benchmarks of the grasp task: speed, holding limits and creep, the measured table."""
