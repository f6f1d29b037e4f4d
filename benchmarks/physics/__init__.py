"""Benchmarks of the engines on the published helix: speed at a stated residual, agreement, scaling, energy."""

import os

# Before numpy is imported: all times are those of one thread.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")
