"""Plain least squares of one energy to few states, the term set chosen by states left out or by the check states.

States are chosen one by one by D-optimality of the equations that they bring (Fedorov, Theory of Optimal Experiments,
1972), for each term set. It is the baseline of `benchmarks.surrogates.states`.
"""

from __future__ import annotations

import numpy as np
from benchmarks.surrogates.truth import TrueStates

from pliant.records.design import Array, Design
from pliant.records.fem import ModuleData
from pliant.records.law import Domain
from pliant_plugins.surrogates.polynomial.energy import Exponents, main_sets, merge_exponents
from pliant_plugins.surrogates.polynomial.energy_system import EnergySystem

# Whether slopes, and travels and energies, are fitted.
KINDS = {
    "values": (False, False),
    "values, slopes": (True, False),
    "values, slopes, travel, energy": (True, True),
}
NUMBERS = (4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 30, 40)
MAX_DEGREE = 13
RIDGE = 1e-6


def select_data(states: TrueStates, rows: Array, slopes: bool) -> ModuleData:
    """Return chosen states as data of a module; without `slopes` those are unknown."""
    n = len(rows)
    known = 1.0 if slopes else np.nan
    return ModuleData(
        design=Design("bellow_bending", {}),
        joint="revolute",
        axes=("y",),
        main_axis="y",
        actuation_name="pressure_pa",
        actuation=states.actuation[rows],
        deformation=states.angle_rad[rows, None],
        tau=states.tau[rows, None],
        dtau_dp=known * states.dtau_dp[rows, None],
        dtau_du=known * states.dtau_du[rows, None, None],
        energy_j=states.energy_j[rows],
        travel=states.travel[rows],
        iterations=np.zeros(n, np.int64),
        wall_s=np.zeros(n),
        explored=np.full(n, "y"),
        branch=np.full(n, "constrained"),
        status=np.full(n, "ok"),
        role=np.full(n, "fit"),
    )


def build_system(states: TrueStates, rows: Array, kind: str) -> EnergySystem:
    """Return the linear system of these states."""
    slopes, energies = KINDS[kind]
    domain = Domain(states.box[0], states.box[1:])
    return EnergySystem(select_data(states, rows, slopes), domain, np.array([np.ptp(states.tau)]), energies)


def order(states: TrueStates, kind: str, terms: Exponents, count: int) -> Array:
    """Return places of the grid, each with the largest gain of log det of the information (places only)."""
    matrix, _, state = build_system(states, np.arange(states.grid), kind).rows(terms)
    matrix = matrix / np.linalg.norm(matrix, axis=0)
    blocks = np.stack([matrix[state == n] for n in range(states.grid)])
    inverse = np.eye(matrix.shape[1]) / RIDGE
    chosen: list[int] = []
    for _ in range(count):
        spread = np.eye(blocks.shape[1]) + blocks @ inverse @ np.swapaxes(blocks, 1, 2)
        gain = np.linalg.slogdet(spread)[1]
        gain[chosen] = -np.inf
        best = int(gain.argmax())
        B = blocks[best]
        inverse -= inverse @ B.T @ np.linalg.solve(spread[best], B @ inverse)
        chosen.append(best)
    return np.array(chosen)


def misses(
    states: TrueStates, system: EnergySystem, terms: Exponents, check: Array
) -> tuple[float, float, float] | None:
    """Return RMS and worst check error and leave-one-out RMS, as shares of the range; None: undetermined."""
    matrix, right, _ = system.rows(terms)
    if len(matrix) < len(terms):
        return None
    solution, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=1e-9)
    if rank < len(terms):
        return None
    basis = system.basis(terms)
    tau = -basis.derivative(states.actuation[check], states.angle_rad[check, None], (0, 1)) @ solution
    error = (tau - states.tau[check]) / np.ptp(states.tau)
    left = system.solve(terms)
    left_out = np.inf if left is None else float(np.sqrt(np.mean((left.misses / np.ptp(states.tau)) ** 2)))
    return float(np.sqrt(np.mean(error**2))), float(np.abs(error).max()), left_out


def least_squares(states: TrueStates, kind: str) -> dict[int, dict[str, tuple[float, float]]]:
    """Return (RMS, worst) on the check states by number of states: by cross-validation, and the best possible."""
    check = np.arange(states.grid, len(states.tau))
    result: dict[int, dict[str, tuple[float, float]]] = {}
    scores: dict[tuple[int, str], float] = {}
    for one in main_sets(MAX_DEGREE):
        terms = merge_exponents([one], 1, 0, KINDS[kind][1])
        places = order(states, kind, terms, max(NUMBERS))
        for number in NUMBERS:
            found = misses(states, build_system(states, places[:number], kind), terms, check)
            if found is None:
                continue
            rms, worst, left_out = found
            row = result.setdefault(number, {})
            for name, score in (("bound", rms), ("left out", left_out)):
                if score < scores.get((number, name), np.inf):
                    scores[number, name], row[name] = score, (rms, worst)
    return result
