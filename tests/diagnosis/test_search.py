"""The search over hypotheses: sets ranked by superposition on a linear example, and conditions of growth."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from tests.diagnosis.quick import REGISTRY, effect, joint, make_fitter, make_predictor, measured, rich

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import THRESHOLDS
from pliant.diagnosis.excitation import Excitation, excitations
from pliant.diagnosis.search import MOST_EFFECTS, Directions, HypothesisSearch

KINDS = tuple("abcdef")
N = 200
RNG = np.random.default_rng(4)
SHAPES = dict(zip(KINDS, RNG.standard_normal((len(KINDS), N)), strict=True))


def bare(residual: np.ndarray, slopes: np.ndarray | None = None) -> EffectFit:
    slopes = np.zeros((len(residual), 0)) if slopes is None else slopes
    return EffectFit(EffectSet((), (), ()), np.zeros(slopes.shape[1]), residual, slopes, True, ())


def make_directions(residual: np.ndarray, **lost: float) -> Directions:
    """Return directions of kinds with one shape each and a least-squares fit; `lost` shares have no equilibrium."""
    fits, shown = {(): bare(residual)}, {}
    for kind, shape in SHAPES.items():
        change = shape * (shape @ residual) / (shape @ shape)
        change = np.where(np.arange(N) < lost.get(kind, 0.0) * N, np.nan, change)
        fits[(kind,)] = bare(residual - change, shape[:, None])
        shown[kind] = Excitation(kind, None, 0, np.zeros(1), 1.0, shape, shape[:, None])  # type: ignore[arg-type]
    return Directions.from_fits(KINDS, fits, shown, 0.02)


def left(residual: np.ndarray, kinds: tuple[str, ...]) -> float:
    basis = np.column_stack([SHAPES[kind] for kind in kinds])
    return float(np.linalg.lstsq(basis, residual, rcond=None)[1][0])


@pytest.mark.parametrize("size", [1, 2, 3])
def test_sets_come_in_the_order_by_what_they_leave(size: int) -> None:
    residual = SHAPES["b"] - 0.7 * SHAPES["e"] + 0.4 * SHAPES["f"] + 0.3 * RNG.standard_normal(N)
    every = sorted(combinations(KINDS, size), key=lambda kinds: left(residual, kinds))
    assert make_directions(residual).highest_ranked(residual, size, 5) == every[:5]


def test_beside_a_base_that_may_follow_the_missing_effect_comes_first() -> None:
    residual = SHAPES["b"] - 0.3 * SHAPES["e"]
    directions, slopes = make_directions(residual), SHAPES["b"][:, None]
    assert directions.next_to(residual - SHAPES["b"], slopes, ("b",), 1) == ["e"]
    # a direction that the base can follow has no expected gain
    followed = directions.next_to(SHAPES["b"] + 1e-3 * SHAPES["c"], slopes, (), len(KINDS))
    assert followed[0] == "c" and followed[-1] == "b"


def test_directions_without_equilibrium_at_many_readings_are_left_out() -> None:
    residual = SHAPES["b"] + SHAPES["e"]
    directions = make_directions(residual, a=0.5, b=0.01)
    owners = [KINDS[number] for number in directions.owner]
    assert owners.count("a") == owners.count("c") - 1
    assert int((~directions.there).sum()) == 2
    assert directions.highest_ranked(residual, 2, 1) == [("b", "e")]


FOUR = ["actuation_gain", "mullins", "sensor_bias", "stiffness"]


def searched(*hidden, kinds=FOUR, seed: int = 3) -> HypothesisSearch:
    chain = joint()
    measurement = measured(chain, rich(), *hidden, seed=seed)
    fitter = make_fitter(make_predictor(chain, measurement))
    shown = excitations(REGISTRY, fitter, fitter.fit(EffectSet.from_kinds(REGISTRY, ())), kinds)
    search = HypothesisSearch(REGISTRY, measurement, fitter.readings, fitter, THRESHOLDS, shown)
    search.run(kinds)
    return search


def test_nothing_and_every_single_effect_are_fitted_and_no_more_without_need() -> None:
    search = searched()
    assert set(search.fits) == {(), *((kind,) for kind in FOUR)} == set(search.rows)
    assert max(map(len, searched(effect("stiffness")).fits)) == 1
    assert set(searched(effect("stiffness"), kinds=["mullins"]).fits) == {(), ("mullins",)}


def test_it_grows_to_two_effects_and_fits_their_parts() -> None:
    search = searched(effect("stiffness", factor=1.05), effect("sensor_bias", bias_rad=0.006))
    pair = ("sensor_bias", "stiffness")
    assert pair in search.fits
    assert all(len(kinds) <= MOST_EFFECTS and kinds == tuple(sorted(kinds)) for kinds in search.fits)
    assert set(pair) <= set(min(search.rows.values(), key=lambda row: row.mean_square).kinds)
    assert search.rows[pair].mean_square <= min(search.rows[(kind,)].mean_square for kind in pair)
