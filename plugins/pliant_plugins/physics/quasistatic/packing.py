"""Chains and histories as the arrays that the compiled loop reads; a one-axis law as a table of bicubic cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.law import JointLaw
from pliant_plugins.physics.stepping import check_driven


@dataclass(frozen=True, eq=False)
class Drive:
    """What changes from sample to sample, of all runs one after another: N samples, m actuators."""

    pressure: Array
    force: Array
    moment: Array
    payload: Array
    temperature: Array
    angles: Array

    @staticmethod
    def of(chain: ChainModel, histories: Sequence[History]) -> Drive:
        """Raises `UserError` where a history lacks an input of the chain, or a number of it."""
        join = np.concatenate
        if any(a.input not in h.actuation for a in chain.actuators for h in histories):
            check_driven(chain, histories)
        drive = Drive(
            pressure=np.stack(
                [join([h.actuation[a.input] for h in histories]) for a in chain.actuators], axis=1
            ),
            force=join([h.tip_force_n for h in histories]),
            moment=join([h.moment_n_m for h in histories]),
            payload=join(
                [
                    np.full(len(h), chain.payload_kg) if h.payload_kg is None else h.payload_kg
                    for h in histories
                ]
            ),
            temperature=join([h.temperature_c for h in histories]),
            angles=join([h.base_angles_rad for h in histories]),
        )
        if not all(np.all(np.isfinite(values)) for values in vars(drive).values()):
            check_driven(chain, histories)
        return drive


@dataclass(frozen=True, eq=False)
class Clock:
    """Time and order: duration of the step to each sample, whether a run starts there, whose specimen it is."""

    duration: Array
    start: Any
    specimen: Any
    n_specimens: int
    substeps: Any

    @staticmethod
    def of(chain: ChainModel, histories: Sequence[History], longest_step_s: float) -> Clock:
        """Steps longer than `longest_step_s` are cut into equal parts.

        Raises:
            UserError: a time that is not a number.
        """
        names = list(dict.fromkeys(h.specimen for h in histories))
        lengths = [len(h) for h in histories]
        first = np.cumsum([0, *lengths[:-1]])
        timed = [h.time_s is not None for h in histories]
        time = np.concatenate([np.zeros(len(h)) if h.time_s is None else h.time_s for h in histories])
        if not np.all(np.isfinite(time)):
            check_driven(chain, histories)
        duration = np.diff(time, prepend=time[:1])
        duration[first] = 0.0
        duration[~np.repeat(timed, lengths)] = np.inf
        start = np.zeros(len(duration), np.bool_)
        start[first] = True
        specimen = np.repeat([names.index(h.specimen) for h in histories], lengths)
        finite = np.where(np.isfinite(duration), duration, 0.0)
        substeps = np.maximum(1, np.ceil(finite / longest_step_s - 1e-9)).astype(np.int64)
        return Clock(duration, start, specimen, len(names), substeps)


PRESSURE_NODES = 33
ANGLE_NODES = 241
# Cubic Hermite basis on [0, 1]: coefficients of 1, x, x², x³ from value and slope at both ends.
HERMITE = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]], float)


@dataclass(frozen=True, eq=False)
class LawTable:
    """cells (p, u, 4, 4): coefficients of xᵃ yᵇ in each; grid: first p, step, first u, step."""

    cells: Array
    grid: Array


def tabulate(law: JointLaw, actuation: tuple[float, float]) -> LawTable:
    """Cells over the given actuation and the law's domain with as much again on both sides.

    Values and first slopes of τ agree with the law at the nodes; between them the error is of fourth order in
    the spacing. A law without a domain is tabulated over ±π.
    """
    p = np.linspace(*actuation, PRESSURE_NODES)
    low, high = law.domain.deformation[0]
    if np.isfinite(low) and np.isfinite(high):
        width = high - low
        low, high = max(-np.pi, low - width), min(np.pi, high + width)
    else:
        low, high = -np.pi, np.pi
    u = np.linspace(low, high, ANGLE_NODES)
    grid_p, grid_u = np.meshgrid(p, u, indexing="ij")
    effort = law.evaluate(grid_p.ravel(), grid_u.reshape(-1, 1))
    shape, dp, du = grid_p.shape, p[1] - p[0], u[1] - u[0]
    value = effort.tau.reshape(shape)
    in_p, in_u = effort.dtau_dp.reshape(shape) * dp, effort.dtau_du.reshape(shape) * du
    mixed = np.gradient(in_u, axis=0, edge_order=2)
    corners = np.empty((len(p) - 1, len(u) - 1, 4, 4))
    for row, (by_value, by_u) in enumerate(((value, in_u), (in_p, mixed))):
        for end in range(2):
            rows = slice(end, len(p) - 1 + end)
            for side in range(2):
                columns = slice(side, len(u) - 1 + side)
                corners[:, :, 2 * row + end, side] = by_value[rows, columns]
                corners[:, :, 2 * row + end, 2 + side] = by_u[rows, columns]
    # HERMITE @ corners @ HERMITE.T of every cell, as one product of two matrices: much faster.
    cells = corners.reshape(-1, 16) @ np.kron(HERMITE, HERMITE).T
    return LawTable(cells.reshape(corners.shape), np.array([p[0], dp, u[0], du]))
