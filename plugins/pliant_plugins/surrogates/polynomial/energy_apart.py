"""Laws of axes that do not affect each other, from whole states, and how they do on states left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import COUPLING, FemDataset, ModuleData
from pliant.records.law import Domain
from pliant_plugins.surrogates.polynomial.axes import AXES, AxesLaw
from pliant_plugins.surrogates.polynomial.fit import Candidate, fit_adaptive
from pliant_plugins.surrogates.polynomial.states import MINIMUM_STATES
from pliant_plugins.surrogates.stability import stable_choice

# Degrees that are tried beside the largest of an energy: less, as many, more.
DEGREES = (-5, -1, 3)
LEAST_DEGREE = 2
# Of the states left out, those that are missed most do not choose: on the box's border they show extrapolation.
COUNTED = 0.9
# Errors below this share of the range are all the same when laws of different forms are compared.
ALIKE = 1e-3


@dataclass(frozen=True, eq=False)
class Apart:
    """Three laws by themselves.

    Attributes:
        misses: (n, 3) predicted minus true τ: of states that explore an axis, that axis' τ with the state left out;
            of states that hold several, all τ, for they are never fitted; NaN elsewhere.
        terms: how many free terms the three laws are worth.
        largest_slope: of ∂τ/∂u over the three boxes, N·m/rad: below zero where all are stable.
    """

    law: AxesLaw
    misses: Array
    terms: int
    largest_slope: float
    degrees: dict[str, int]


def fit_apart(data: ModuleData, max_main: int) -> Apart | None:
    """Each axis from the states that explore it, all others being free there; None where that cannot be done."""
    if data.axes != AXES or data.joint != "spherical":
        return None
    misses, chosen = np.full(data.tau.shape, np.nan), {}
    for k, axis in enumerate(AXES):
        own = data.axis(axis)
        if len(own) < MINIMUM_STATES or not all(map(np.ptp, (own.actuation, own.angle_rad, own.moment_n_m))):
            return None
        try:
            best = _best(own, max_main)
        except UserError:
            return None
        chosen[axis] = best
        misses[data.explored == axis, k] = left_out(best)
    x, y, z = (replace(one.law, error=one.posterior.error_bar()) for one in chosen.values())
    law = AxesLaw((x, y, z))
    several = data.explored == COUPLING
    if several.any():
        found = law.evaluate(data.actuation[several], data.deformation[several]).tau
        misses[several] = found - data.tau[several]
    return Apart(
        law,
        misses,
        sum(one.n_terms for one in chosen.values()),
        max(one.largest_slope for one in chosen.values()),
        {axis: one.degree for axis, one in chosen.items()},
    )


def left_out(one: Candidate) -> Array:
    """(n,) predicted minus true τ of each state left out in turn; NaN where the others do not determine it."""
    own = one.posterior
    found: Array = -own.misses() * own.system.range
    return found


def quality(misses: Array, data: ModuleData, ranges: Array) -> dict[str, float]:
    """RMS miss over the range, by axis over the states that explore it, and over those that hold several."""
    shares = (misses / ranges) ** 2
    groups: dict[str, Array] = {}
    for k, axis in enumerate(data.axes):
        groups[axis] = shares[data.explored == axis, k]
    groups[COUPLING] = shares[data.explored == COUPLING].mean(axis=1)
    return {name: _trimmed(squares) for name, squares in groups.items() if np.isfinite(squares).any()}


def compared(one: dict[str, float], other: dict[str, float]) -> float:
    """How many times larger the errors of `one` are, in the geometric mean over the groups that both have."""
    common = [name for name in one if name in other]
    logs = [np.log((one[name] + ALIKE) / (other[name] + ALIKE)) for name in common]
    return float(np.exp(np.mean(logs))) if logs else np.inf


def choice_of(apart: Apart, found: dict[str, float]) -> dict[str, Any]:
    """What a report says of these laws."""
    several = np.isfinite(apart.misses).all(axis=1)
    return {
        "form": "axes apart",
        "degree": max(apart.degrees.values()),
        "degrees": apart.degrees,
        "terms": apart.terms,
        "energies_fitted": False,
        "left_out_rmse_of_range": float(np.sqrt(np.mean(np.square(list(found.values()))))),
        "several_held": int(several.sum()),
    }


def _best(own: FemDataset, max_main: int) -> Candidate:
    """Of several largest degrees the one that misses states left out least, stable if that costs little."""
    side = np.array([[own.angle_rad.min(), own.angle_rad.max()]])
    domain = Domain(np.array([own.actuation.min(), own.actuation.max()]), side)
    found = list(_tried(own, domain, max_main))
    size = float(np.ptp(own.moment_n_m))
    errors = [_trimmed((left_out(one) / size) ** 2) for one in found]
    return found[stable_choice(errors, [one.largest_slope for one in found])]


def _tried(own: FemDataset, domain: Domain, max_main: int) -> Iterator[Candidate]:
    for degree in sorted({max(LEAST_DEGREE, max_main + more) for more in DEGREES}):
        yield fit_adaptive(own, domain, degree)[0]


def _trimmed(squares: Array) -> float:
    known = np.sort(squares[np.isfinite(squares)])
    return float(np.sqrt(known[: max(1, int(COUNTED * len(known)))].mean())) if len(known) else np.inf
