"""The conformance suite of optimizers: what it skips, and the measure that it judges fronts by."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.testing import run_checks
from pliant.testing.optimizer import CORNER, IDEAL, hypervolume
from pliant_plugins.manifest import pliant_components

pytest.importorskip("cma")


def test_what_an_optimizer_does_not_claim_is_skipped_and_the_rest_holds() -> None:
    cmaes = next(c for c in pliant_components() if (c.interface, c.kind) == ("optimizer", "cmaes"))
    outcomes = {o.name: o for o in run_checks(cmaes)}
    skipped = {name for name, o in outcomes.items() if o.status == "skipped"}
    assert skipped == {"finds_a_front", "contexts_are_in_range", "learns_an_answer_for_each_context"}
    assert not [o.message for o in outcomes.values() if o.status == "failed"]


def test_hypervolume_of_boxes() -> None:
    assert hypervolume(np.array([[1.0, 2.0]]), 4.0) == 6.0
    assert hypervolume(np.array([[1.0, 2.0], [2.0, 1.0], [3.0, 3.0], [0.0, 9.0]]), 4.0) == 8.0


def test_ideal_is_the_hypervolume_of_the_whole_front() -> None:
    t = np.linspace(0.0, 1.0, 20_001)
    assert hypervolume(np.column_stack([4 * t**2, 4 * (1 - t) ** 2]), CORNER) == pytest.approx(
        IDEAL, rel=1e-4
    )
