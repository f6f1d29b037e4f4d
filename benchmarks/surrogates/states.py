"""Number of FEM states needed for a law of the reference bending module: python -m benchmarks.surrogates.states

    python -m benchmarks.surrogates.states --skip-least-squares

States are chosen from the places of a grid before any is solved, once for each kind of data, and laws of the first k
of them are scored on scattered states, as shares of the effort's range. Estimators:

- process: Π is a cubic plus a Gaussian process (`Cubic`), its lengths the likeliest for the k states;
- process, lengths of others: lengths likeliest for every fourth design of examples/designs/bending_grid.csv, which this
  module is not part of;
- polynomial, regularised: all terms of Π, with a prior chosen by the evidence of the k states (`posterior.prior_of`);
- Polynomial: the surrogate in the product, which may choose fewer terms instead and needs at least 6 states;
- least squares: sets of terms, chosen by states left out (a user can) and by the check states (the bound), with states
  chosen for each set apart (`states_least_squares`).

The process with the lengths of others chooses the states: each the one after which the mean variance of the effort
over the box is least (Cohn, Neural Networks 9, 1996), after the few that its cubic needs, which are spread. Kinds of
data: efforts; with slopes; with travel (−∂Π/∂p); with travel and energy: each FEM state gives all of them. Boxes: the
sampler's, u from −0.5 to 1.2 times the largest free angle, and the published study's, from 0 to 1 times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from benchmarks.output import OUT, Bar, make_parser, write
from benchmarks.surrogates.kinds import table
from benchmarks.surrogates.states_least_squares import KINDS as BASELINE_KINDS
from benchmarks.surrogates.states_least_squares import least_squares, select_data
from benchmarks.surrogates.truth import TrueStates, study_truth, truth
from scipy.optimize import minimize

from pliant.errors import UserError
from pliant.pipeline.sampling.gaussian import Orders, Process
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.records.law import Domain
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.fit import MORE_WITH_POTENTIAL
from pliant_plugins.surrogates.polynomial.posterior import CoefficientPosterior, all_terms, fit_prior
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial
from pliant_plugins.surrogates.polynomial.system import System, values_at

# Derivatives of Π by (p, u) that each kind of data observes: τ, its slopes, travel, energy.
KINDS: dict[str, Orders] = {
    "values": np.array([[0, 1]]),
    "values, slopes": np.array([[0, 1], [1, 1], [0, 2]]),
    "values, slopes, travel": np.array([[0, 1], [1, 1], [0, 2], [1, 0]]),
    "values, slopes, travel, energy": np.array([[0, 1], [1, 1], [0, 2], [1, 0], [0, 0]]),
}
EFFORT = KINDS["values"]
TREND_DEGREE = 3
START = (2.0, 1.0)
FAILED = 1e10


def trend(orders: Orders) -> Orders:
    """Return powers of the cubic that observations of these derivatives depend on."""
    full = [(i, j) for i in range(TREND_DEGREE + 1) for j in range(TREND_DEGREE + 1 - i)]
    return np.array([power for power in full if np.any(np.all(np.array(power) >= orders, axis=1))])


@dataclass(frozen=True, eq=False)
class Cubic(Process):
    """The process with a full cubic for its trend, as far as the observations see it."""

    @cached_property
    def _trend_orders(self) -> Orders:
        return trend(self.orders)


class Unseen(Cubic):
    """The same before anything is observed: deviations for σ = 1."""

    variance = 1.0


@dataclass(frozen=True, eq=False)
class Views:
    """States of one module in the box [−1, 1]²: places (n, 2) and derivatives of Π by their orders (n,), scaled."""

    places: Array
    derivatives: dict[tuple[int, int], Array]

    @staticmethod
    def from_states(states: TrueStates, scale: float) -> Views:
        """Scale efforts by `scale`, Π by that and the half-width in u."""
        half, centre = np.ptp(states.box, axis=1) / 2, states.box.mean(axis=1)
        places = (np.column_stack([states.actuation, states.angle_rad]) - centre) / half
        unit = scale * half[1]
        return Views(
            places,
            {
                (0, 1): -states.tau / scale,
                (1, 1): -states.dtau_dp * half[0] / scale,
                (0, 2): -states.dtau_du * half[1] / scale,
                (1, 0): -states.travel * half[0] / unit,
                (0, 0): (states.energy_j - states.actuation * states.travel) / unit,
            },
        )

    def rows(self, rows: Sequence[int]) -> Views:
        """Select some of the states."""
        return Views(self.places[rows], {key: column[rows] for key, column in self.derivatives.items()})

    def seen(self, rows: Sequence[int] | Array, orders: Orders) -> Array:
        """Return the observations of states, place by place."""
        columns = [self.derivatives[int(a), int(b)][rows] for a, b in orders]
        return np.stack(columns, axis=1).ravel()


def likeliest(designs: Sequence[Views], orders: Orders) -> Array:
    """Return the (2,) lengths with the highest joint likelihood for the states of all these designs."""

    def cost(logarithms: Array) -> float:
        lengths = np.exp(logarithms)
        try:
            return sum(
                Cubic(one.places, orders, one.seen(np.arange(len(one.places)), orders), lengths).cost()
                for one in designs
            )
        except np.linalg.LinAlgError:
            return FAILED

    options = {"maxiter": 60, "xatol": 0.01, "fatol": 0.05}
    return np.exp(minimize(cost, np.log(START), method="Nelder-Mead", options=options).x)


def greedy(places: Array, orders: Orders, lengths: Array, count: int) -> list[int]:
    """Return places, each the one with the least mean variance of the effort over all of them.

    The first ones, as many as the trend needs, are spread: each the farthest from those before.
    """
    goal = places[::2]
    chosen = [int(np.argmax(places.sum(axis=1)))]
    while len(chosen) < -(-len(trend(orders)) // len(orders)):
        apart = np.linalg.norm(places[:, None] - places[chosen][None], axis=2).min(axis=1)
        chosen.append(int(apart.argmax()))
    while len(chosen) < count:
        left = [k for k in range(len(places)) if k not in chosen]
        doubts = [_doubt(places[[*chosen, k]], orders, lengths, goal) for k in left]
        chosen.append(left[int(np.argmin(doubts))])
    return chosen


def _doubt(places: Array, orders: Orders, lengths: Array, goal: Array) -> float:
    process = Unseen(places, orders, np.zeros(len(places) * len(orders)), lengths)
    try:
        mean = float(np.mean(process.predict(goal, EFFORT)[1] ** 2))
    except (np.linalg.LinAlgError, AssertionError):
        return np.inf
    return mean if np.isfinite(mean) else np.inf


def predicted(states: Views, rows: list[int], orders: Orders, lengths: Array) -> Array | None:
    """Return (n,) scaled effort at all places from observations at `rows`; None if the trend is undetermined."""
    if len(rows) * len(orders) <= len(trend(orders)) + 1:
        return None
    one = states.rows(rows)
    process = Cubic(one.places, orders, one.seen(np.arange(len(rows)), orders), lengths)
    while process._factor is None:
        process = replace(process, lengths=0.7 * process.lengths)
    return -process.predict(states.places, EFFORT)[0][:, 0]


BOXES = {"sampler's box": truth, "study's box": study_truth}
NUMBERS = (4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20)
VALUES_NUMBERS = (*NUMBERS, 24, 30)
GOAL, ENOUGH = 1e-4, 8
EVERY = 4
DEGREE = 9
# Further choices of states, for the sensitivity to the choice.
BESIDE, VARIED = (6, 7, 8, 10), (0.8, 1.0, 1.25)
BASELINE = {"left out": "least squares", "bound": "least squares, bound"}
# RMS and worst on the scattered states, worst of all known states; by number of states.
Curve = dict[int, tuple[float, ...]]


def _scaled_views(data: ModuleData) -> Views:
    good = np.isin(data.status, TRUSTED)
    u = data.deformation[good, 0]
    box = np.array([[0.0, data.actuation.max()], [u.min(), u.max()]])
    columns = (data.tau[good, 0], data.dtau_dp[good, 0], data.dtau_du[good, 0, 0])
    states = TrueStates(data.actuation[good], u, *columns, data.energy_j[good], data.travel[good], box, 0)
    return Views.from_states(states, float(np.ptp(states.tau)))


def known_data(states: TrueStates, rows: Array, kind: str) -> ModuleData:
    """Return states as data of a module, restricted to the quantities of the kind."""
    data = select_data(states, rows, "slopes" in kind)
    return data if "energy" in kind else replace(data, travel=np.full(len(rows), np.nan))


def held_back(states: TrueStates, rows: list[int], kind: str) -> Array | None:
    """Return (n,) scaled efforts of the polynomial of all terms; None for a kind without rows."""
    if kind == "values, slopes, travel":
        return None
    energy = "energy" in kind
    data = known_data(states, np.array(rows), kind).axis("y")
    system = System(data, Domain(states.box[0], states.box[1:]))
    terms = all_terms(DEGREE + energy * MORE_WITH_POTENTIAL, potential=energy)
    posterior = CoefficientPosterior.from_system(system, terms, fit_prior(system, terms))
    x, v = Views.from_states(states, 1.0).places.T
    return values_at(terms, x, v) @ posterior.solution * system.range / np.ptp(states.tau)


def component(states: TrueStates, rows: list[int], kind: str) -> Array | None:
    """Return (n,) scaled efforts of `Polynomial`; None if it refuses the data, or for a kind without rows."""
    if kind == "values, slopes, travel":
        return None
    scattered = np.arange(states.grid, len(states.tau))
    data = known_data(states, np.concatenate([rows, scattered]), kind)
    data = replace(data, role=np.where(np.arange(len(data)) < len(rows), "fit", "check"))
    try:
        law = Polynomial(PolynomialConfig(max_degree=DEGREE)).fit_module(data).law
    except UserError:
        return None
    return law.evaluate(states.actuation, states.angle_rad[:, None]).tau[:, 0] / np.ptp(states.tau)


def curves(states: TrueStates, kind: str, others: Array) -> tuple[dict[str, Curve], list[int]]:
    """Return errors of each estimator by number of states, and the places in the order in which they are chosen."""
    views, orders = Views.from_states(states, float(np.ptp(states.tau))), KINDS[kind]
    numbers = VALUES_NUMBERS if kind == "values" else NUMBERS
    order = greedy(views.places[: states.grid], orders, others, max(numbers))
    true = states.tau / np.ptp(states.tau)

    def process(rows: list[int]) -> Array | None:
        if predicted(views, rows, orders, others) is None:
            return None
        return predicted(views, rows, orders, likeliest([views.rows(rows)], orders))

    estimators: dict[str, Callable[[list[int]], Array | None]] = {
        "process": process,
        "process, lengths of others": lambda rows: predicted(views, rows, orders, others),
        "polynomial, held back": lambda rows: held_back(states, rows, kind),
        "Polynomial": lambda rows: component(states, rows, kind),
    }
    found: dict[str, Curve] = {name: {} for name in estimators}
    for number in numbers:
        for name, estimator in estimators.items():
            told = estimator(order[:number])
            if told is not None:
                error = np.abs(told - true)
                scattered = error[states.grid :]
                rms = float(np.sqrt(np.mean(scattered**2)))
                found[name][number] = (rms, float(scattered.max()), float(error.max()))
    return {name: curve for name, curve in found.items() if curve}, order


def orders_beside(states: TrueStates, kind: str, others: Array) -> dict[int, list[float]]:
    """Return RMS of the regularised polynomial by number of states, for lengths varied by a fifth."""
    places, true = Views.from_states(states, 1.0).places[: states.grid], states.tau / np.ptp(states.tau)
    found: dict[int, list[float]] = {number: [] for number in BESIDE}
    for factors in np.ndindex(3, 3):
        lengths = others * np.array([VARIED[k] for k in factors])
        order = greedy(places, KINDS[kind], lengths, max(BESIDE))
        for number in BESIDE:
            told = held_back(states, order[:number], kind)
            found[number].append(float(np.sqrt(np.mean((told - true)[states.grid :] ** 2))))
    return found


def baseline(states: TrueStates, kind: str) -> dict[str, Curve]:
    """Return the curves of least squares."""
    found = least_squares(states, kind)
    return {
        name: {number: row[key] for number, row in sorted(found.items()) if key in row}
        for key, name in BASELINE.items()
    }


def needed(curve: Curve, which: int, lasting: bool = True) -> float:
    """Return the least number of states within the goal, if `lasting` with all larger ones; inf if none is."""
    good = [number for number, errors in curve.items() if errors[which] <= GOAL]
    if lasting:
        good = [number for number in good if all(m in good for m in curve if m >= number)]
    return float(min(good, default=np.inf))


def show(kind: str, found: dict[str, Curve]) -> None:
    """Print one table: RMS / worst by number of states."""
    print(f"\n  {kind}: RMS / worst on scattered states, worst of all known states")
    for name, curve in found.items():
        cells = [f"{k}: " + " / ".join(f"{error:.0e}" for error in errors) for k, errors in curve.items()]
        print(f"    {name}")
        for start in range(0, len(cells), 5):
            print("      " + "   ".join(cells[start : start + 5]))
        parts = [f"RMS {needed(curve, 0):g} (first {needed(curve, 0, False):g})"]
        parts.append(f"worst {needed(curve, 1):g} (first {needed(curve, 1, False):g})")
        print(f"      states for 1e-4: {', '.join(parts)}")


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--skip-least-squares", action="store_true")
    options = parser.parse_args()
    designs = [_scaled_views(data) for data in table("bending_grid").data[::EVERY]]  # of every fourth design
    lengths = {kind: likeliest(designs, orders) for kind, orders in KINDS.items()}
    print("lengths of other designs:", {kind: one.round(2).tolist() for kind, one in lengths.items()})
    results: dict[str, Any] = {"lengths": {kind: one.tolist() for kind, one in lengths.items()}}
    bars = []
    for box, source in BOXES.items():
        states = source(OUT)
        scattered = len(states.tau) - states.grid
        print(
            f"\n{box}: {states.grid} places, {scattered} scattered states, range {np.ptp(states.tau):.4g} N·m"
        )
        for kind in KINDS:
            found, order = curves(states, kind, lengths[kind])
            if kind in BASELINE_KINDS and not options.skip_least_squares:
                found |= baseline(states, kind)
            show(kind, found)
            beside = {} if kind not in BASELINE_KINDS else orders_beside(states, kind, lengths[kind])
            for number, errors in beside.items():
                within = sum(error <= GOAL for error in errors)
                print(
                    f"    {number} states chosen in {len(errors)} ways, polynomial held back: RMS median "
                    f"{np.median(errors):.0e}, worst {max(errors):.0e}, {within} within 1e-4"
                )
            places = np.stack([states.actuation, states.angle_rad], axis=1)[order].tolist()
            results[f"{box}, {kind}"] = {"curves": found, "order": places, "rms_of_other_orders": beside}
            bars += [
                Bar(f"{box}, {kind}: states for 1e-4, {name}, {m}", needed(curve, k), ENOUGH, "states", True)
                for name, curve in found.items()
                for k, m in enumerate(("RMS", "worst"))
            ]
    print()
    write("surrogate_states", results, bars)


if __name__ == "__main__":
    main()
