"""A Gaussian process of Π with all that a state knows, and the states that it would have solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from benchmarks.surrogates.truth import Truth
from scipy.optimize import minimize

from pliant.pipeline.sampling.gaussian import Orders, Process
from pliant.records.design import Array

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
    """Powers of the cubic that observations of these derivatives see."""
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
    def of(states: Truth, scale: float) -> Views:
        """Efforts over `scale`, Π over that and the half-width in u."""
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
        """Some of the states."""
        return Views(self.places[rows], {key: column[rows] for key, column in self.derivatives.items()})

    def seen(self, rows: Sequence[int] | Array, orders: Orders) -> Array:
        """What states observe, place by place."""
        columns = [self.derivatives[int(a), int(b)][rows] for a, b in orders]
        return np.stack(columns, axis=1).ravel()


def likeliest(designs: Sequence[Views], orders: Orders) -> Array:
    """(2,) lengths that the states of all these designs make likeliest together."""

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
    """Places, each the one after which the mean variance of the effort over all of them is least.

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
    """(n,) scaled effort at all places from what the states `rows` observe; None where they do not fix the trend."""
    if len(rows) * len(orders) <= len(trend(orders)) + 1:
        return None
    one = states.rows(rows)
    process = Cubic(one.places, orders, one.seen(np.arange(len(rows)), orders), lengths)
    while process._factor is None:
        process = replace(process, lengths=0.7 * process.lengths)
    return -process.predict(states.places, EFFORT)[0][:, 0]
