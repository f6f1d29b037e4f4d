"""Sets of effects weighed by superposition, on a linear toy in which the answer is known."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.excitation import Excitation
from pliant.diagnosis.fitting import EffectFit
from pliant.diagnosis.search import Directions

KINDS = tuple("abcdef")
N = 200
RNG = np.random.default_rng(4)
SHAPES = dict(zip(KINDS, RNG.standard_normal((len(KINDS), N)), strict=True))


def bare(residual: np.ndarray, slopes: np.ndarray | None = None) -> EffectFit:
    slopes = np.zeros((len(residual), 0)) if slopes is None else slopes
    return EffectFit(EffectSet((), (), ()), np.zeros(slopes.shape[1]), residual, slopes, True, ())


def directions_of(residual: np.ndarray, lost: dict[str, float] | None = None) -> Directions:
    """Each kind is one direction; alone it is fitted by least squares."""
    fits, shown = {(): bare(residual)}, {}
    for kind, shape in SHAPES.items():
        change = shape * (shape @ residual) / (shape @ shape)
        if lost and kind in lost:
            change = np.where(np.arange(N) < lost[kind] * N, np.nan, change)
        fits[(kind,)] = bare(residual - change, shape[:, None])
        shown[kind] = Excitation(kind, None, 0, np.zeros(1), 1.0, shape, shape[:, None])  # type: ignore[arg-type]
    return Directions.of(KINDS, fits, shown, 0.02)


def left(residual: np.ndarray, kinds: tuple[str, ...]) -> float:
    basis = np.column_stack([SHAPES[kind] for kind in kinds])
    return float(np.linalg.lstsq(basis, residual, rcond=None)[1][0])


@pytest.mark.parametrize("size", [1, 2, 3])
def test_sets_come_in_the_order_of_what_they_leave(size: int) -> None:
    residual = SHAPES["b"] - 0.7 * SHAPES["e"] + 0.4 * SHAPES["f"] + 0.3 * RNG.standard_normal(N)
    every = sorted(combinations(KINDS, size), key=lambda kinds: left(residual, kinds))
    assert directions_of(residual).promising(residual, size, 5) == every[:5]


def test_beside_a_base_that_may_follow_the_missing_effect_comes_first() -> None:
    residual = SHAPES["b"] - 0.3 * SHAPES["e"]
    directions = directions_of(residual)
    rest = bare(residual - SHAPES["b"], SHAPES["b"][:, None])
    assert directions.next_to(rest.residual, rest.slopes, ("b",), 1) == ["e"]
    # what the base can follow by itself promises nothing
    followed = directions.next_to(SHAPES["b"] + 1e-3 * SHAPES["c"], rest.slopes, (), len(KINDS))
    assert followed[0] == "c" and followed[-1] == "b"


def test_directions_without_equilibrium_at_many_readings_are_left_out() -> None:
    residual = SHAPES["b"] + SHAPES["e"]
    directions = directions_of(residual, lost={"a": 0.5, "b": 0.01})
    owners = [KINDS[number] for number in directions.owner]
    assert owners.count("a") == owners.count("c") - 1
    assert int((~directions.there).sum()) == 2
    assert directions.promising(residual, 2, 1) == [("b", "e")]
