"""Many FEM states of the reference bending module, kept in benchmarks/out: what few states are measured against."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from benchmarks.families.published_y import make_solver
from scipy.stats import qmc

from pliant.records.design import Array
from pliant.records.fem import FemState
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.families.reference import FINGER

MU_PA = 240e3
PRESSURE_PA = 15e3
SHARES = (-0.5, 1.2)  # of the largest free angle
LEVELS = (9, 13)  # Chebyshev–Lobatto nodes in p and u
CHECKS = 60
# The published study's box.
STUDY_SHARES = (0.0, 1.0)
STUDY_LEVELS = (7, 8)
COLUMNS = ("actuation", "angle_rad", "tau", "dtau_dp", "dtau_du", "energy_j", "travel")


@dataclass(frozen=True, eq=False)
class TrueStates:
    """States as columns (n,), the first `grid` of them on the grid, the others scattered in the same box."""

    actuation: Array
    angle_rad: Array
    tau: Array
    dtau_dp: Array
    dtau_du: Array
    energy_j: Array
    travel: Array
    box: Array
    grid: int


def truth(out: Path) -> TrueStates:
    """Return the states, solved if `out` does not contain them yet."""
    return _stored(out / "reference_module_states.json", SHARES, LEVELS, CHECKS)


def study_truth(out: Path) -> TrueStates:
    """Return the truth on the study's box, u from 0 to the largest free angle: a separate grid and scattered states."""
    grid = _stored(out / "reference_module_study_states.json", STUDY_SHARES, STUDY_LEVELS, 0)
    whole = truth(out)
    scattered = np.arange(len(whole.tau)) >= whole.grid
    inside = scattered & (whole.angle_rad >= grid.box[1, 0]) & (whole.angle_rad <= grid.box[1, 1])
    columns = [np.concatenate([getattr(grid, name), getattr(whole, name)[inside]]) for name in COLUMNS]
    return TrueStates(*columns, box=grid.box, grid=grid.grid)


def _stored(path: Path, shares: tuple[float, float], levels: tuple[int, int], checks: int) -> TrueStates:
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(_solve(shares, levels, checks)))
    stored = json.loads(path.read_text())
    columns = np.array(stored["states"]).T
    return TrueStates(*columns, box=np.array(stored["box"]), grid=stored["grid"])


def _solve(shares: tuple[float, float], levels: tuple[int, int], count: int) -> dict[str, object]:
    family = BellowBending(BellowBendingConfig.model_validate(FINGER))
    solver = make_solver(family.problem(), MU_PA)
    state, free = solver.rest(), []
    for pressure in np.linspace(0, PRESSURE_PA, 13)[1:]:
        state = solver.free(pressure, state)
        free.append(state)
    largest = max(one.angle_rad for one in free)
    box = np.array([[0.0, PRESSURE_PA], [shares[0] * largest, shares[1] * largest]])
    grid = np.array([(p, u) for p in _lobatto(*box[0], levels[0]) for u in _lobatto(*box[1], levels[1])])
    checks = box[:, 0] + np.ptp(box, axis=1) * qmc.Halton(2, seed=3).random(count).reshape(count, 2)
    solved: list[FemState] = [solver.rest(), *free]
    found = {}
    places = np.concatenate([grid, checks])
    while len(found) < len(places):
        # the unsolved place nearest to a solved one: short steps converge
        known = np.array([(one.actuation, one.angle_rad) for one in solved])
        left = np.array([k for k in range(len(places)) if k not in found])
        gap = np.linalg.norm((places[left][:, None] - known[None]) / np.ptp(box, axis=1), axis=2)
        place, start = np.unravel_index(gap.argmin(), gap.shape)
        state = solver.constrained(*(float(x) for x in places[left[place]]), start=solved[start])
        found[int(left[place])] = state
        solved.append(state)
    names = [
        {"tau": "moment_n_m", "dtau_dp": "dmoment_dp", "dtau_du": "dmoment_du"}.get(c, c) for c in COLUMNS
    ]
    rows = [[getattr(found[k], name) for name in names] for k in range(len(places))]
    return {"columns": COLUMNS, "box": box.tolist(), "grid": len(grid), "states": rows}


def _lobatto(low: float, high: float, n: int) -> Array:
    return (low + high) / 2 - (high - low) / 2 * np.cos(np.pi * np.arange(n) / (n - 1))
