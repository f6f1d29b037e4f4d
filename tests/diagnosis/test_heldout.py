"""Errors left out of a fit against refits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import REGISTRY

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.fitting import PRIOR_WEIGHT, EffectFit, condition_of_runs, heldout_residual

CANDIDATE = EffectSet.of(REGISTRY, ("mullins", "stiffness"))  # three parameters


def linear(
    seed: int, n: int = 240, x: np.ndarray | None = None
) -> tuple[EffectFit, np.ndarray, np.ndarray, np.ndarray]:
    """A fit of y = J x at its optimum (or at x), the readings and their groups."""
    rng = np.random.default_rng(seed)
    slopes, y = rng.normal(size=(n, 3)), rng.normal(size=n)
    y += slopes @ np.array([0.8, 0.1, -0.1])
    groups = np.repeat(np.arange(6), n // 6)
    best = np.linalg.lstsq(slopes, y, rcond=None)[0] if x is None else x
    return EffectFit(CANDIDATE, best, y - slopes @ best, slopes, True, (False,) * 3), slopes, y, groups


def refit(slopes: np.ndarray, y: np.ndarray, weight: float = PRIOR_WEIGHT) -> np.ndarray:
    return np.linalg.solve(slopes.T @ slopes + weight * np.eye(slopes.shape[1]), slopes.T @ y)


@pytest.mark.parametrize("seed", range(5))
def test_the_formula_is_the_refit(seed: int) -> None:
    fit, slopes, y, groups = linear(seed)
    left = heldout_residual(fit, groups)
    for group in range(6):
        mine = groups == group
        there = refit(slopes[~mine], y[~mine])
        np.testing.assert_allclose(left[mine], y[mine] - slopes[mine] @ there, atol=1e-10)
    assert left @ left > fit.residual @ fit.residual


def test_it_is_the_refit_from_any_point_near_the_optimum() -> None:
    best, _, _, groups = linear(0)
    moved, *_ = linear(0, x=best.x + 0.05)
    np.testing.assert_allclose(heldout_residual(moved, groups), heldout_residual(best, groups), atol=1e-10)


def test_what_only_one_group_shows_is_nothing_without_it() -> None:
    fit, slopes, y, groups = linear(1)
    slopes[groups != 2, 0] = 0.0
    best = np.linalg.lstsq(slopes, y, rcond=None)[0]
    fit = EffectFit(CANDIDATE, best, y - slopes @ best, slopes, True, (False,) * 3)
    mine = groups == 2
    others = refit(slopes[~mine][:, 1:], y[~mine])
    np.testing.assert_allclose(
        heldout_residual(fit, groups)[mine], y[mine] - slopes[mine][:, 1:] @ others, atol=1e-10
    )


def test_one_group_alone_predicts_as_the_model_without_the_effect() -> None:
    fit, _, y, groups = linear(2)
    np.testing.assert_allclose(heldout_residual(fit, np.zeros_like(groups)), y, atol=1e-10)


def test_nothing_has_nothing_to_leave_out() -> None:
    nothing = EffectFit(EffectSet.of(REGISTRY, ()), np.zeros(0), np.arange(4.0), np.zeros((4, 0)), True, ())
    np.testing.assert_array_equal(heldout_residual(nothing, np.array([0, 0, 1, 1])), np.arange(4.0))


def test_moves_stay_within_bounds() -> None:
    _, slopes, y, groups = linear(3)
    mine = groups == 0
    low, _ = CANDIDATE.limits()
    y = y + slopes @ np.array([low[0] + 0.01, 0.0, 0.0])  # the loss is at its least but for group 0
    fit = EffectFit(
        CANDIDATE, np.array([low[0], 0, 0]), y - slopes[:, 0] * low[0], slopes, True, (True, False, False)
    )
    left = heldout_residual(fit, groups)
    free = refit(slopes[~mine], y[~mine])
    clipped = np.maximum(free, low)
    np.testing.assert_allclose(left[mine], y[mine] - slopes[mine] @ clipped, atol=1e-8)


def test_groups() -> None:
    np.testing.assert_array_equal(condition_of_runs(5, [(0, 3), (1, 4)]), [0, 1, 2, 0, 1])


def test_a_fit_without_an_equilibrium_has_no_left_out_error() -> None:
    found, _, y, groups = linear(0)
    lost = replace(found, residual=np.full_like(y, np.nan), slopes=np.full_like(found.slopes, np.nan))
    assert np.isnan(heldout_residual(lost, groups, y)).all()
