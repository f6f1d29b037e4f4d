"""A law of several axes from whole states: least squares of one energy, its terms chosen by leaving places out."""

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
from pliant.records.fem import COUPLING, ModuleData
from pliant.records.law import JointLaw
from pliant_plugins.surrogates.polynomial.energy import (
    PARITIES,
    Coupling,
    Exponents,
    Main,
    coupling_sets,
    main_sets,
    terms_of,
)
from pliant_plugins.surrogates.polynomial.energy_apart import (
    COUNTED,
    choice_of,
    compared,
    fit_apart,
    quality,
)
from pliant_plugins.surrogates.polynomial.energy_law import EnergyLaw
from pliant_plugins.surrogates.polynomial.energy_system import EnergySystem, Solution, error_bar
from pliant_plugins.surrogates.polynomial.scoring import report_axes
from pliant_plugins.surrogates.polynomial.states import Mask, effort_ranges, split
from pliant_plugins.surrogates.stability import affordable

# More terms than this share of the equations are never worth while.
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
class Candidate:
    """A set of terms, its error on places left out as a share of the ranges, and the solution for all states.

    Places of the main axis alone and others count alike in `rmse`.
    """

    sets: tuple[Main | Coupling, ...]
    terms: Exponents
    rmse: float
    rmse_se: float
    solution: Solution
    largest_slope: Callable[[], float]

    @property
    def n_terms(self) -> int:
        return len(self.terms)


def fit_energy(data: ModuleData, max_main: int, with_energy: bool = True) -> FittedLaw:
    """One law of all axes, fitted to every trusted state of role "fit"; scored on states of role "check".

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
        choice = {**choice_of(apart, by_itself), **beside}
        return FittedLaw(law, report_axes(law, states, choice, apart.largest_slope))
    error = error_bar(system, chosen.terms, chosen.solution)
    law = replace(
        law_of(system, chosen.terms, chosen.solution.coefficients).pruned(system.ranges), error=error
    )
    choice = {**_choice(chosen, candidates, system), "terms_kept": len(law.coefficients), **beside}
    return FittedLaw(law, report_axes(law, states, choice, chosen.largest_slope()))


def choose(system: EnergySystem, max_main: int) -> tuple[Candidate, list[Candidate]]:
    """The chosen candidate and all that were tried with lateral terms (all, of one axis).

    First the terms of the main axis alone, by the states that hold or free only that; then, beside them, those of
    lateral axes by all states. Each time the fewest terms win whose error is within one standard error of the
    smallest, among stable laws if one of them is about as good. Where lateral terms cannot follow what happens
    beside the main axis, its own states weigh more, if that is better on places left out. Evenness in every lateral
    axis is given up only where a set without it is better by more than its own standard error. Raises `UserError`
    where no set is determined.
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
    system: EnergySystem, base: tuple[Main | Coupling, ...], max_main: int
) -> tuple[Candidate | None, list[Candidate]]:
    """The best set of lateral terms beside those of the main axis, and all that were tried."""
    data = system.data
    symmetric = all(system.deformation_map[k, 0] == 0 for k, a in enumerate(data.axes) if a != data.main_axis)
    chosen: Candidate | None = None
    candidates: list[Candidate] = []
    for parity in PARITIES if symmetric else PARITIES[-1:]:
        if chosen is not None:
            last = chosen.sets[-1]
            assert isinstance(last, Coupling)
            wider = _tried(system, [(*base, replace(last, parity=parity))])
            if not any(_better(one, chosen) for one in wider):
                continue
        found = _tried(system, [(*base, one) for one in coupling_sets(parity, max_main)])
        candidates += found
        if found and (chosen is None or _better(_fewest(found), chosen)):
            chosen = _fewest(found)
    return chosen, candidates


def law_of(system: EnergySystem, terms: Exponents, coefficients: Array) -> EnergyLaw:
    """The law of a solution, without its terms of the actuation alone."""
    data, kept = system.data, terms[:, 1:].any(axis=1)
    return EnergyLaw(
        system.basis(terms[kept]),
        coefficients[kept],
        system.domain,
        axes=data.axes,
        joint=data.joint,
        actuation_name=data.actuation_name,
    )


def _tried(
    system: EnergySystem, sets: Sequence[tuple[Main | Coupling, ...]], only: int | None = None
) -> list[Candidate]:
    """Candidates of those sets that the states determine; `only` scores, and keeps stable, one axis."""
    data = system.data
    main = data.axes.index(data.main_axis)
    terms = [terms_of(one, len(data.axes), main, system.with_energy) for one in sets]
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
        slope = partial(largest_slope, law_of(system, t, solution.coefficients), only)
        found.append(Candidate(one, t, rmse, spread / (2 * rmse) if rmse else 0.0, solution, slope))
    return found


def _left_out(system: EnergySystem, squares: Array, part: Mask) -> tuple[float, float]:
    """Mean over the places of a part of the states, the most missed of them left aside, and its standard error."""
    _, place = np.unique(system.places[part], return_inverse=True)
    of_place = np.sort(np.bincount(place, squares[part]) / np.bincount(place))
    counted = of_place[: max(1, int(COUNTED * len(of_place)))]
    return float(counted.mean()), float(counted.std() / np.sqrt(len(counted)))


def _better(one: Candidate, other: Candidate) -> bool:
    return one.rmse + one.rmse_se + NEGLIGIBLE < other.rmse


def _fewest(candidates: list[Candidate]) -> Candidate:
    """The one-standard-error rule among laws that are stable over the box, if one of them is about as good."""
    by_error = sorted(candidates, key=lambda c: c.rmse)
    near = (c for c in by_error if c.rmse <= affordable(by_error[0].rmse))
    stable = next((c for c in near if c.largest_slope() < 0), None)
    best = stable or by_error[0]
    limit = best.rmse + best.rmse_se + NEGLIGIBLE
    within = sorted((c for c in by_error if c.rmse <= limit), key=lambda c: c.n_terms)
    fewer = (c for c in within if c.n_terms < best.n_terms)
    return next((c for c in fewer if stable is None or c.largest_slope() < 0), best)


def largest_slope(law: EnergyLaw, only: int | None = None) -> float:
    """Largest eigenvalue of ∂τ/∂u on a grid of the law's domain, N·m/rad: below zero where the law is stable.

    With `only`, ∂τ/∂u of that axis while the others are held at zero.
    """
    in_p, in_u = STABILITY_GRID if only is None else ALONE_GRID
    sides = [np.linspace(*_ends(law.domain.actuation), in_p)]
    for k, side in enumerate(law.domain.deformation):
        sides.append(np.linspace(*_ends(side), in_u) if only in (None, k) else np.zeros(1))
    at = np.array(list(product(*sides)))
    K = law.stiffness_in_box(at[:, 0], at[:, 1:])
    return float(-(np.linalg.eigvalsh(K) if only is None else K[:, only, only]).min())


def _ends(side: Array) -> tuple[float, float]:
    return float(side[0]), float(side[1])


def _choice(chosen: Candidate, candidates: list[Candidate], system: EnergySystem) -> dict[str, Any]:
    """The chosen degrees and the table they were chosen from; errors are shares of the efforts' ranges."""
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


def _degrees(one: Candidate) -> dict[str, Any]:
    """Degrees of the energy; that of τ is one less."""
    own = one.sets[0]
    found: dict[str, Any] = {"degree": own.main, "actuation_degree": own.actuation}
    for beside in one.sets[1:]:
        assert isinstance(beside, Coupling)
        found["coupled_degree"], found["coupled_actuation_degree"] = beside.main, beside.actuation
        found["lateral_degree"], found["even_in_lateral_axes"] = beside.lateral, beside.parity
    return found
