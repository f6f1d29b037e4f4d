"""How fast this machine is at this moment: a fixed piece of numpy work, to compare times of different machines."""

from __future__ import annotations

import time

import numpy as np

SIZE, SOLVES, ROUNDS = 400, 50, 5
WORDS = f"{SOLVES} solutions of a dense linear system of {SIZE} unknowns by numpy, one thread"


def kernel_s() -> float:
    """Seconds of `WORDS`, the fastest of a few rounds."""
    random = np.random.default_rng(0)
    matrix = random.random((SIZE, SIZE)) + SIZE * np.eye(SIZE)
    right = random.random(SIZE)
    times = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        for _ in range(SOLVES):
            np.linalg.solve(matrix, right)
        times.append(time.perf_counter() - begun)
    return min(times)
