"""The measure by which the conformance suite of optimizers judges fronts."""

from __future__ import annotations

import numpy as np
import pytest

from pliant_search.conformance import CORNER, IDEAL, hypervolume


def test_box_hypervolume() -> None:
    assert hypervolume(np.array([[1.0, 2.0]]), 4.0) == 6.0
    assert hypervolume(np.array([[1.0, 2.0], [2.0, 1.0], [3.0, 3.0], [0.0, 9.0]]), 4.0) == 8.0


def test_ideal_is_the_whole_front_hypervolume() -> None:
    t = np.linspace(0.0, 1.0, 20_001)
    assert hypervolume(np.column_stack([4 * t**2, 4 * (1 - t) ** 2]), CORNER) == pytest.approx(
        IDEAL, rel=1e-4
    )
