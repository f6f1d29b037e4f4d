"""Blocks of one run that are left out of a fit together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

BLOCK_S = 5.0  # longer than the camera's jitter remembers, shorter than a filling
FOLDS = 6


def folds(time_s: Array, block_s: float = BLOCK_S) -> NDArray[np.intp]:
    """(t,) number of the fold: blocks of the run are dealt out in turn."""
    return np.asarray(np.floor(time_s / block_s).astype(np.intp) % FOLDS)


def rms(values: Array) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
