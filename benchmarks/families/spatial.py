"""The helical bellow on all three axes: stiffness at small angles, secants under moments, couplings, energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.interfaces.fem import ModuleSolver
from pliant.records.design import Array
from pliant.records.fem import FemState

MOMENTS = (3e-3, 6e-3)
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Row:
    """One axis at one pressure, moments on it alone.

    Attributes:
        held: what the main axis does: M_y = 0 ("free") or u_y as on the free branch ("held").
        tangent: −dM/du (N·m/rad) at M = 0.
        secants: M/u (N·m/rad) at the moments of `MOMENTS`, NaN where no state was reached.
    """

    axis: str
    pressure_pa: float
    held: str
    tangent: float
    secants: tuple[float, ...]


def condensed(stiffness: Array, kept: tuple[int, ...]) -> Array:
    """The stiffness (3, 3) of some axes, those that are left out being free."""
    out = [i for i in range(len(stiffness)) if i not in kept]
    K = stiffness[np.ix_(kept, kept)]
    if not out:
        return K
    cross = stiffness[np.ix_(kept, out)]
    reduced: Array = K - cross @ np.linalg.solve(stiffness[np.ix_(out, out)], cross.T)
    return reduced


def free_states(solver: ModuleSolver, pressures: tuple[float, ...]) -> list[FemState]:
    """States without moments, each from the one before."""
    states: list[FemState] = []
    state = solver.rest()
    for pressure in pressures:
        state = solver.free(pressure, state)
        states.append(state)
    return states


def secant(solver: ModuleSolver, free: FemState, axis: str, moment: float, held: bool) -> float:
    """M/u (N·m/rad) under a moment that turns the module by +u about an axis, by Newton on u (two states)."""
    place = AXES.index(axis)
    kept = tuple(sorted({place, 1})) if held else (place,)
    others = {"y": float(free.deformation[1])} if held else {}
    u, state = 0.0, free
    for _ in range(3):
        slope = condensed(-state.dtau_du, kept)[kept.index(place), kept.index(place)]
        # τ opposes: a moment that helps is −τ
        missing = moment + float(state.tau[place])
        u += missing / slope
        if state is not free and abs(missing) < 0.02 * moment:
            break
        state = solver.constrained(free.actuation, {**others, axis: u}, state)
    return float(moment / u)


def rows_of(
    solver: ModuleSolver, free: FemState, axes: tuple[str, ...] = ("z", "x"), secants: bool = True
) -> list[Row]:
    """Stiffness of the axes at one free state."""
    rows = []
    for axis in axes:
        place = AXES.index(axis)
        for held in (False, True):
            kept = tuple(sorted({place, 1})) if held else (place,)
            where = kept.index(place)
            tangent = float(condensed(-free.dtau_du, kept)[where, where])
            found = tuple(secant(solver, free, axis, m, held) for m in MOMENTS) if secants else ()
            rows.append(Row(axis, free.actuation, "held" if held else "free", tangent, found))
    return rows


def asymmetry(state: FemState) -> float:
    """Largest |K_ij − K_ji| / √(K_ii K_jj)."""
    K = -state.dtau_du
    size = np.sqrt(np.diag(K))
    return float(np.abs((K - K.T) / np.outer(size, size)).max())


def energy_error(solver: ModuleSolver, start: FemState, turn: dict[str, float]) -> float:
    """|ΔU − work| / work between two near states of one pressure, axes held at u ± turn/2 (midpoint: third order)."""
    low, mid, high = (
        solver.constrained(
            start.actuation,
            {a: float(start.deformation[AXES.index(a)]) + s * turn.get(a, 0.0) for a in AXES},
            start,
        )
        for s in (-0.5, 0.0, 0.5)
    )
    step = high.deformation - low.deformation
    work = start.actuation * (high.travel - low.travel) - float((low.tau + 4 * mid.tau + high.tau) @ step / 6)
    return abs((high.energy_j - low.energy_j - work) / work)
