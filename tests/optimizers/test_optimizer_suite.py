"""The measure that the conformance suite of optimizers judges fronts by."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.testing.optimizer import CORNER, IDEAL, hypervolume


def test_hypervolume_of_boxes() -> None:
    assert hypervolume(np.array([[1.0, 2.0]]), 4.0) == 6.0
    assert hypervolume(np.array([[1.0, 2.0], [2.0, 1.0], [3.0, 3.0], [0.0, 9.0]]), 4.0) == 8.0


def test_ideal_is_the_hypervolume_of_the_whole_front() -> None:
    t = np.linspace(0.0, 1.0, 20_001)
    assert hypervolume(np.column_stack([4 * t**2, 4 * (1 - t) ** 2]), CORNER) == pytest.approx(
        IDEAL, rel=1e-4
    )
