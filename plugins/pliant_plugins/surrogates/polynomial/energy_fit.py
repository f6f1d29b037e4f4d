"""A law of several axes from whole states: one energy, its terms chosen by leaving places out, or three laws apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.design import Array
from pliant.records.fem import COUPLING, FemDataset, ModuleData
from pliant.records.law import Domain, JointLaw
from pliant_plugins.surrogates.polynomial.axes import AXES, AxesLaw
from pliant_plugins.surrogates.polynomial.energy import (
    PARITIES,
    CoupledTerms,
    Exponents,
    Main,
    coupling_sets,
    main_sets,
    merge_exponents,
)
from pliant_plugins.surrogates.polynomial.energy_law import EnergyPolynomialLaw
from pliant_plugins.surrogates.polynomial.energy_system import EnergySolution, EnergySystem, error_bar
from pliant_plugins.surrogates.polynomial.fit import Candidate, fit_adaptive
from pliant_plugins.surrogates.polynomial.scoring import report_axes
from pliant_plugins.surrogates.polynomial.states import MINIMUM_STATES, Mask, effort_ranges, split
from pliant_plugins.surrogates.records import affordable, stable_choice

# Degrees that are tried relative to the largest of an energy: lower, equal, higher.
DEGREES = (-5, -1, 3)
LEAST_DEGREE = 2
# Of the states left out, those that are missed most do not choose: on the box's border they show extrapolation.
COUNTED = 0.9
# Errors below this share of the range are all the same when laws of different forms are compared.
ALIKE = 1e-3


@dataclass(frozen=True, eq=False)
class Apart:
    """Three independent laws of one axis each.

    Attributes:
        misses: (n, 3) predicted minus true τ: of states that explore an axis, that axis' τ with the state left out;
            of states with several axes deflected, all τ, since they are never fitted; NaN elsewhere.
        terms: effective number of free terms of the three laws.
        largest_slope: of ∂τ/∂u over the three boxes, N·m/rad: below zero if all are stable.
    """

    law: AxesLaw
    misses: Array
    terms: int
    largest_slope: float
    degrees: dict[str, int]


def fit_apart(data: ModuleData, max_main: int) -> Apart | None:
    """Fit each axis to the states that explore it, all others being free there; None if that is impossible."""
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
    """Return (n,) leave-one-out errors of τ, predicted minus true; NaN if the others do not determine it."""
    own = one.posterior
    return -own.misses() * own.system.range


def quality(misses: Array, data: ModuleData, ranges: Array) -> dict[str, float]:
    """Return RMS errors over the range, by axis over the states that explore it, and over those of several."""
    shares = (misses / ranges) ** 2
    groups: dict[str, Array] = {}
    for k, axis in enumerate(data.axes):
        groups[axis] = shares[data.explored == axis, k]
    groups[COUPLING] = shares[data.explored == COUPLING].mean(axis=1)
    return {name: _trimmed(squares) for name, squares in groups.items() if np.isfinite(squares).any()}


def compared(one: dict[str, float], other: dict[str, float]) -> float:
    """Return the ratio of the errors of `one` to those of `other`, the geometric mean over their common groups."""
    common = [name for name in one if name in other]
    logs = [np.log((one[name] + ALIKE) / (other[name] + ALIKE)) for name in common]
    return float(np.exp(np.mean(logs))) if logs else np.inf


def choice_report(apart: Apart, found: dict[str, float]) -> dict[str, Any]:
    """Return the report's entries on these laws."""
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
    """Fit several largest degrees; return the fit with the least leave-one-out error, a stable one if similar."""
    side = np.array([[own.angle_rad.min(), own.angle_rad.max()]])
    domain = Domain(np.array([own.actuation.min(), own.actuation.max()]), side)
    degrees = sorted({max(LEAST_DEGREE, max_main + more) for more in DEGREES})
    found = [fit_adaptive(own, domain, degree)[0] for degree in degrees]
    size = float(np.ptp(own.moment_n_m))
    errors = [_trimmed((left_out(one) / size) ** 2) for one in found]
    return found[stable_choice(errors, [one.largest_slope for one in found])]


def _trimmed(squares: Array) -> float:
    known = np.sort(squares[np.isfinite(squares)])
    return float(np.sqrt(known[: max(1, int(COUNTED * len(known)))].mean())) if len(known) else np.inf


# Sets with more terms than this share of the equations are not tried.
MOST_TERMS = 0.5
# Weight of states of the main axis alone where they determine its terms by themselves.
MAIN_FIRST = 30.0
# Two term sets whose errors differ by less than this share of the range are equally good.
NEGLIGIBLE = 1e-9
STABILITY_GRID = (5, 7)  # levels in p, and in each u
ALONE_GRID = (31, 61)
FEWEST_ALONE = 6  # states of the main axis alone from which its terms are chosen
_UNDETERMINED = (
    "the {n} states determine no law of {k} coupled axes: add states that hold several axes at once, or give each "
    "axis its own law under 'axes'"
)


@dataclass(frozen=True, eq=False)
class EnergyCandidate:
    """A set of terms, its error on places left out as a share of the ranges, and the solution for all states.

    Places of the main axis alone and others count alike in `rmse`.
    """

    sets: tuple[Main | CoupledTerms, ...]
    terms: Exponents
    rmse: float
    rmse_se: float
    solution: EnergySolution
    largest_slope: Callable[[], float]

    @property
    def n_terms(self) -> int:
        return len(self.terms)


def fit_energy(data: ModuleData, max_main: int, with_energy: bool = True) -> FittedLaw:
    """Fit one law of all axes to every trusted state of role "fit"; score it on states of role "check".

    Three laws by themselves take the energy's place where they miss states left out less (`compared`), unless only
    the energy is stable. They hold for
    modules whose other axes are free; what one axis does to another is then not in the law, and the report says so.
    Raises `UserError` as `split` does, and where the states do not determine a law.
    """
    states = split(data, "a law")
    system = EnergySystem(states.fit, states.domain, effort_ranges(states.fit), with_energy)
    chosen, candidates = choose(system, max_main)
    together = quality(chosen.solution.misses, states.fit, system.ranges)
    apart = fit_apart(states.fit, max_main)
    by_itself = {} if apart is None else quality(apart.misses, states.fit, system.ranges)
    beside = {"left_out_together": together, "left_out_apart": by_itself or None}
    unstable = apart is not None and apart.largest_slope >= 0 > chosen.largest_slope()
    if apart is not None and not unstable and compared(together, by_itself) > 1:
        law: JointLaw = apart.law
        choice = {**choice_report(apart, by_itself), **beside}
        return FittedLaw(law, report_axes(law, states, choice, apart.largest_slope))
    error = error_bar(system, chosen.terms, chosen.solution)
    law = replace(
        build_law(system, chosen.terms, chosen.solution.coefficients).pruned(system.ranges), error=error
    )
    choice = {**_choice(chosen, candidates, system), "terms_kept": len(law.coefficients), **beside}
    return FittedLaw(law, report_axes(law, states, choice, chosen.largest_slope()))


def choose(system: EnergySystem, max_main: int) -> tuple[EnergyCandidate, list[EnergyCandidate]]:
    """Choose the terms; return the chosen candidate and all that were tried with lateral terms (all, of one axis).

    First the terms of the main axis are chosen with the states that deflect only that axis, then those of lateral axes
    with all states. In both steps the fewest terms are taken whose error is within one standard error of the smallest,
    among stable laws if one of them is about as good. If lateral terms fit poorly off the main axis, the states of the
    main axis get a larger weight, provided that this reduces the error at left-out places. Evenness in every lateral
    axis is dropped only if a set without it is better by more than its standard error. Raises `UserError` if no set is
    determined.
    """
    data = system.data
    main = data.axes.index(data.main_axis)
    lateral = [k for k in range(len(data.axes)) if k != main]
    alone = system.alone
    own = system.part(alone) if lateral and alone.sum() >= FEWEST_ALONE else system
    tried = _tried(own, [(one,) for one in main_sets(max_main)], main)
    if not tried:
        raise UserError(_UNDETERMINED.format(n=len(data), k=len(data.axes)))
    if not lateral:
        return _fewest(tried), tried
    base = _fewest(tried).sets
    chosen, candidates = _with_lateral(system, base, max_main)
    if own is not system:
        first = system.weighted(np.where(alone, MAIN_FIRST, 1.0))
        other, more = _with_lateral(first, base, max_main)
        if chosen is None or (other is not None and _better(other, chosen)):
            chosen, candidates = other, more
    if chosen is None:
        raise UserError(_UNDETERMINED.format(n=len(data), k=len(data.axes)))
    return chosen, candidates


def _with_lateral(
    system: EnergySystem, base: tuple[Main | CoupledTerms, ...], max_main: int
) -> tuple[EnergyCandidate | None, list[EnergyCandidate]]:
    """Return the best set of lateral terms added to those of the main axis, and all that were tried."""
    data = system.data
    symmetric = all(system.deformation_map[k, 0] == 0 for k, a in enumerate(data.axes) if a != data.main_axis)
    chosen: EnergyCandidate | None = None
    candidates: list[EnergyCandidate] = []
    for parity in PARITIES if symmetric else PARITIES[-1:]:
        if chosen is not None:
            last = chosen.sets[-1]
            assert isinstance(last, CoupledTerms)
            wider = _tried(system, [(*base, replace(last, parity=parity))])
            if not any(_better(one, chosen) for one in wider):
                continue
        found = _tried(system, [(*base, one) for one in coupling_sets(parity, max_main)])
        candidates += found
        if found and (chosen is None or _better(_fewest(found), chosen)):
            chosen = _fewest(found)
    return chosen, candidates


def build_law(system: EnergySystem, terms: Exponents, coefficients: Array) -> EnergyPolynomialLaw:
    """Return the law of a solution, without its terms of the actuation alone."""
    data, kept = system.data, terms[:, 1:].any(axis=1)
    return EnergyPolynomialLaw(
        system.basis(terms[kept]),
        coefficients[kept],
        system.domain,
        axes=data.axes,
        joint=data.joint,
        actuation_name=data.actuation_name,
    )


def _tried(
    system: EnergySystem, sets: Sequence[tuple[Main | CoupledTerms, ...]], only: int | None = None
) -> list[EnergyCandidate]:
    """Return candidates of those sets that the states determine; `only` scores, and keeps stable, one axis."""
    data = system.data
    main = data.axes.index(data.main_axis)
    terms = [merge_exponents(one, len(data.axes), main, system.with_energy) for one in sets]
    known = (data.tau, data.dtau_dp, data.dtau_du)
    equations = sum(int(np.isfinite(values).sum()) for values in known)
    fitting = [(one, t) for one, t in zip(sets, terms, strict=True) if len(t) <= MOST_TERMS * equations]
    fitting = list({t.tobytes(): (one, t) for one, t in reversed(fitting)}.values())[::-1]
    system.prepare([t for _, t in fitting])
    found = []
    for one, t in fitting:
        solution = system.solve(t)
        if solution is None:
            continue
        squares = ((solution.misses / system.ranges) ** 2)[:, slice(None) if only is None else [only]]
        parts = [
            _left_out(system, squares.mean(axis=1), part)
            for part in (system.alone, ~system.alone)
            if part.any()
        ]
        rmse = float(np.sqrt(np.mean([square for square, _ in parts])))
        spread = float(np.sqrt(np.sum([se**2 for _, se in parts]))) / len(parts)
        slope = partial(largest_slope, build_law(system, t, solution.coefficients), only)
        found.append(EnergyCandidate(one, t, rmse, spread / (2 * rmse) if rmse else 0.0, solution, slope))
    return found


def _left_out(system: EnergySystem, squares: Array, part: Mask) -> tuple[float, float]:
    """Return the trimmed mean error over the places of a part of the states, and its standard error."""
    _, place = np.unique(system.places[part], return_inverse=True)
    of_place = np.sort(np.bincount(place, squares[part]) / np.bincount(place))
    counted = of_place[: max(1, int(COUNTED * len(of_place)))]
    return float(counted.mean()), float(counted.std() / np.sqrt(len(counted)))


def _better(one: EnergyCandidate, other: EnergyCandidate) -> bool:
    return one.rmse + one.rmse_se + NEGLIGIBLE < other.rmse


def _fewest(candidates: list[EnergyCandidate]) -> EnergyCandidate:
    """Apply the one-standard-error rule among laws stable over the box, if one of them is about as good."""
    by_error = sorted(candidates, key=lambda c: c.rmse)
    near = (c for c in by_error if c.rmse <= affordable(by_error[0].rmse))
    stable = next((c for c in near if c.largest_slope() < 0), None)
    best = stable or by_error[0]
    limit = best.rmse + best.rmse_se + NEGLIGIBLE
    within = sorted((c for c in by_error if c.rmse <= limit), key=lambda c: c.n_terms)
    fewer = (c for c in within if c.n_terms < best.n_terms)
    return next((c for c in fewer if stable is None or c.largest_slope() < 0), best)


def largest_slope(law: EnergyPolynomialLaw, only: int | None = None) -> float:
    """Return the largest eigenvalue of ∂τ/∂u on a grid of the domain, N·m/rad: below zero for a stable law.

    With `only`, ∂τ/∂u of that axis while the others are held at zero.
    """
    in_p, in_u = STABILITY_GRID if only is None else ALONE_GRID
    sides = [np.linspace(law.domain.actuation[0], law.domain.actuation[1], in_p)]
    for k, side in enumerate(law.domain.deformation):
        sides.append(np.linspace(side[0], side[1], in_u) if only in (None, k) else np.zeros(1))
    at = np.array(list(product(*sides)))
    K = law.stiffness_in_box(at[:, 0], at[:, 1:])
    return float(-(np.linalg.eigvalsh(K) if only is None else K[:, only, only]).min())


def _choice(
    chosen: EnergyCandidate, candidates: list[EnergyCandidate], system: EnergySystem
) -> dict[str, Any]:
    """Return the chosen degrees and the table they were chosen from; errors are shares of the efforts' ranges."""
    table = [
        {
            **_degrees(c),
            "terms": c.n_terms,
            "rmse_of_range": c.rmse,
            "standard_error": c.rmse_se,
            "chosen": c is chosen,
        }
        for c in candidates
    ]
    several = system.data.explored == COUPLING
    shares = np.abs(chosen.solution.misses) / system.ranges
    return {
        "form": "energy",
        **_degrees(chosen),
        "terms": chosen.n_terms,
        "energies_fitted": system.with_energy,
        "left_out_rmse_of_range": chosen.rmse,
        "left_out_several_of_range": float(shares[several].max()) if several.any() else None,
        "cross_validation": table,
    }


def _degrees(one: EnergyCandidate) -> dict[str, Any]:
    """Return degrees of the energy; that of τ is one less."""
    own = one.sets[0]
    found: dict[str, Any] = {"degree": own.main, "actuation_degree": own.actuation}
    for beside in one.sets[1:]:
        assert isinstance(beside, CoupledTerms)
        found["coupled_degree"], found["coupled_actuation_degree"] = beside.main, beside.actuation
        found["lateral_degree"], found["even_in_lateral_axes"] = beside.lateral, beside.parity
    return found
