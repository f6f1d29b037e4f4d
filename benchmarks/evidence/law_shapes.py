"""Shapes of a law's error: smooth functions of actuation and angle that stiffness, gain and offset cannot represent.

A raw shape is drawn from the bases of its split (`form_table.LAW_SHAPES`): no basis is in both, and none is one that a
diagnosis has for a law's error, polynomials of low order or a Gaussian process with a squared exponential. Over the
states (p, u) that the clean robot visits its part along

    1,  p,  u,  p u,  u|u|

is taken out by least squares: pressure offset, gain, stiffness and the law's own quadratic part are sums of these. What
is left is scaled so that its root mean square over these states is the wanted share of the law's torque range, which is
K_N times the largest pressure; its largest value is about four times that. A shape that takes more than
`MOST_OF_STIFFNESS` of the law's own stiffness anywhere among the states is drawn again: real joints do not snap.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from benchmarks.evidence import functional_truth
from benchmarks.evidence.form_table import LAW_SHAPES, SPLITS, Split
from benchmarks.evidence.forms import (
    BEND_NODES,
    LOWEST_BEND,
    LOWEST_SHARE,
    NODE_BEND,
    NODE_SHARE,
    SHARE_NODES,
    TYPICAL_ANGLE_RAD,
)
from benchmarks.evidence.protocols import protocol
from benchmarks.evidence.robots import B_E, M_A, M_E, PEAK_TORQUE_N_M, PRESSURE_MAX_PA, ROBOTS, Array
from benchmarks.evidence.truths import Truth
from scipy.ndimage import spline_filter

# Of the law's error: its root mean square over the states, in shares of the torque range; drawn evenly in logarithms.
SIZES = (0.003, 0.03)
# The working range of an angle, in typical angles: bases measure bending in it as they measure pressure in its largest.
WORKING_BEND = 1.8
MOST_OF_STIFFNESS = 0.6
DRAWS = 400
LINES = 5  # of ridges and folds
# Margin about the visited states, for the motion due to a hidden effect, rad.
AROUND_RAD = 0.05

Surface = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class LawShape:
    """An error of a joint law.

    Attributes:
        form: name of its basis; drawn: its numbers.
        table: (SHARE_NODES, BEND_NODES) spline coefficients in N·m for `forms.law_error`.
        rms, largest: over the states, in shares of the torque range.
        draws: shapes that were drawn until one was stiff enough everywhere.
    """

    form: str
    drawn: Mapping[str, float]
    table: Array
    rms: float
    largest: float
    draws: int


def draw_law(size: float, split: Split, share: Array, angle_rad: Array, rng: np.random.Generator) -> LawShape:
    """Draw a shape of this size over the states of pressure shares and angles, (s,) each.

    Raises:
        RuntimeError: no shape of the split is stiff enough at this size.
    """
    bend = angle_rad / TYPICAL_ANGLE_RAD
    nodes = np.meshgrid(*_nodes(), indexing="ij")
    ends = bend.min() - AROUND_RAD / TYPICAL_ANGLE_RAD, bend.max() + AROUND_RAD / TYPICAL_ANGLE_RAD
    inside = np.ix_(
        (_nodes()[0] >= 0.0) & (_nodes()[0] <= 1.0), (_nodes()[1] >= ends[0]) & (_nodes()[1] <= ends[1])
    )
    stiffness = B_E + M_E * TYPICAL_ANGLE_RAD * np.abs(nodes[1]) - M_A * PRESSURE_MAX_PA * nodes[0]
    said = np.linalg.pinv(sayable(share, bend))
    for count in range(1, DRAWS + 1):
        form, drawn, raw = _raw(split, rng)
        at_states, at_nodes = raw(share, bend), raw(nodes[0].ravel(), nodes[1].ravel())
        weights = said @ at_states
        left = at_states - sayable(share, bend) @ weights
        scale = size * PEAK_TORQUE_N_M / float(np.sqrt(np.mean(left**2)))
        values = (at_nodes - sayable(nodes[0].ravel(), nodes[1].ravel()) @ weights).reshape(
            nodes[0].shape
        ) * scale
        slope = np.gradient(values, NODE_BEND * TYPICAL_ANGLE_RAD, axis=1)
        if float((slope / stiffness)[inside].max()) <= MOST_OF_STIFFNESS:
            table = np.ascontiguousarray(spline_filter(values, order=3, mode="mirror"))
            largest = float(np.abs(left).max()) * scale / PEAK_TORQUE_N_M
            return LawShape(form, drawn, table, size, largest, count)
    raise RuntimeError(f"no shape of a law's error of {size:.1%} leaves the joint stiff")


@cache
def draw_law_shape(size: float, seed: int, split: Split, robot: str, runs: str) -> LawShape:
    """Return the error of a law by size and seed, over the states that the clean robot visits in a protocol."""
    return draw_law(
        size, split, *visited(robot, runs if runs == "payload" else "rich"), np.random.default_rng(seed)
    )


@cache
def visited(name: str, runs_of: str = "rich") -> tuple[Array, Array]:
    """Return (s,) shares of the largest pressure and angles of every joint of the clean robot in all runs.

    A law is of a module, not of the runs of one day: the poor protocol's single curve could say nearly any shape. Only
    payloads take the robot where `rich` does not.
    """
    robot = ROBOTS[name]
    runs = protocol(runs_of, robot)
    every = functional_truth.follow(robot, runs, Truth())
    shares = [
        np.repeat(run.pressure_pa / PRESSURE_MAX_PA, one.shape[1])
        for run, one in zip(runs, every, strict=True)
    ]
    return np.concatenate(shares), np.concatenate([one.ravel() for one in every])


def sayable(share: Array, bend: Array) -> Array:
    """Return (s, 5) regressors of stiffness, gain, offset and quadratic part at states (s,)."""
    return np.column_stack([np.ones_like(share), share, bend, share * bend, bend * np.abs(bend)])


def draw_pull(size: float, split: Split, rng: np.random.Generator) -> tuple[str, Array]:
    """Draw the error of the pull of a rod's tendon: its basis and values (SHARE_NODES,) at nodes of its share.

    A function of the actuation alone, without constant, linear and quadratic part.
    """
    form, _, raw = _raw(split, rng)
    share = np.linspace(0.0, 1.0, 101)
    nodes = _nodes()[0]
    said = np.linalg.pinv(np.vander(share, 3))
    along, at = raw(share, WORKING_BEND / 2 * share), np.clip(nodes, 0.0, 1.0)
    weights = said @ along
    left = along - np.vander(share, 3) @ weights
    values = raw(at, WORKING_BEND / 2 * at) - np.vander(at, 3) @ weights
    return form, values * size / float(np.sqrt(np.mean(left**2)))


def _nodes() -> tuple[Array, Array]:
    return LOWEST_SHARE + NODE_SHARE * np.arange(SHARE_NODES), LOWEST_BEND + NODE_BEND * np.arange(BEND_NODES)


def _raw(split: Split, rng: np.random.Generator) -> tuple[str, dict[str, float], Surface]:
    """Draw a raw shape: its basis, its numbers, and the function of pressure share and bend."""
    possible = LAW_SHAPES[SPLITS.index(split)]
    form = possible[int(rng.integers(len(possible)))]
    drawn = {name: float(rng.uniform(*ends)) for name, ends in form.ranges.items()}
    return form.name, drawn, SURFACES[form.name](SimpleNamespace(**drawn), rng)


def _plane_waves(v: Any, rng: np.random.Generator) -> Surface:
    """Draw random Fourier features: waves of any direction, `cycles` over the working range."""
    way, phase, size = rng.uniform(0, np.pi, 6), rng.uniform(0, 2 * np.pi, 6), rng.standard_normal(6)
    turns = 2 * np.pi * v.cycles * rng.uniform(0.7, 1.3, 6)

    def surface(share: Array, bend: Array) -> Array:
        along = np.outer(share, np.cos(way)) + np.outer(bend / WORKING_BEND, np.sin(way))
        return np.cos(turns * along + phase) @ size

    return surface


def _wave_products(v: Any, rng: np.random.Generator) -> Surface:
    """Draw products of a wave of the pressure and one of the angle."""
    phases, size = rng.uniform(0, 2 * np.pi, (2, 5)), rng.standard_normal(5)
    turns = 2 * np.pi * v.cycles * rng.uniform(0.6, 1.4, (2, 5))

    def surface(share: Array, bend: Array) -> Array:
        one = np.cos(np.outer(share, turns[0]) + phases[0])
        return (one * np.cos(np.outer(bend / WORKING_BEND, turns[1]) + phases[1])) @ size

    return surface


def _bumps(v: Any, rng: np.random.Generator) -> Surface:
    """Draw bumps at random places that decay as a power of the distance."""
    place = np.column_stack([rng.uniform(-0.1, 1.1, 9), rng.uniform(-0.4, 0.9, 9)])
    size, width = rng.standard_normal(9), v.width * rng.uniform(0.8, 1.2, 9)

    def surface(share: Array, bend: Array) -> Array:
        away = np.subtract.outer(share, place[:, 0]) ** 2
        away = away + np.subtract.outer(bend / WORKING_BEND, place[:, 1]) ** 2
        return (1.0 + away / width**2) ** -1.5 @ size

    return surface


def _ridges(v: Any, rng: np.random.Generator) -> Surface:
    """Draw soft steps across random lines."""
    along, size = _lines(rng), rng.standard_normal(LINES)
    return lambda share, bend: np.tanh(along(share, bend) / v.width) @ size


def _folds(v: Any, rng: np.random.Generator) -> Surface:
    """Draw planes that meet in rounded folds along random lines."""
    along, size = _lines(rng), rng.standard_normal(LINES)
    return lambda share, bend: np.sqrt(along(share, bend) ** 2 + v.width**2) @ size


def _lines(rng: np.random.Generator) -> Surface:
    """Return distances (s, `LINES`) of states from random lines through the working range."""
    way = rng.uniform(0, 2 * np.pi, LINES)
    through = np.column_stack([rng.uniform(0.1, 0.9, LINES), rng.uniform(-0.1, 0.6, LINES)])

    def distances(share: Array, bend: Array) -> Array:
        away = np.cos(way) * np.subtract.outer(share, through[:, 0])
        return away + np.sin(way) * np.subtract.outer(bend / WORKING_BEND, through[:, 1])

    return distances


SURFACES: Mapping[str, Callable[[Any, np.random.Generator], Surface]] = {
    "plane waves": _plane_waves,
    "products of waves": _wave_products,
    "rational bumps": _bumps,
    "tanh ridges": _ridges,
    "rounded folds": _folds,
}
