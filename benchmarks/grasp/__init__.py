"""Benchmarks of the grasp task: speed, holding limits and creep, the measured table."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported
