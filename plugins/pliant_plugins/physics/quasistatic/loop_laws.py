"""Laws as the compiled loops of histories take them: tables of bicubic cells, or functions that are called.

Laws of several actuations, and those of joints with several axes, are called as they are: tables over all of their
variables would be large, or coarse.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant_plugins.physics.compiled.laws import PackedLaws

PRESSURE_NODES = 33
ANGLE_NODES = 241
# Cubic Hermite basis on [0, 1]: coefficients of 1, x, x², x³ from value and slope at both ends.
HERMITE = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]], float)


class LawTable(NamedTuple):
    """cells (p, u, 4, 4): coefficients of xᵃ yᵇ in each; grid: first p, step, first u, step."""

    cells: Array
    grid: Array


def tabulate(law: JointLaw, actuation: tuple[float, float]) -> LawTable:
    """Tabulate cells over the given actuation and the law's domain extended by its width on both sides.

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


def _packed(laws: Sequence[JointLaw]) -> tuple[PackedLaws, Array] | None:
    """Return the laws' scalar forms and (l, 2) α and γ of `JointLaw.unwrap`; None where one has no scalar form."""
    known = [law.unwrap() for law in laws]
    packed = PackedLaws.from_laws([law for law, _, _ in known])
    if packed is None:
        return None
    return packed, np.array([number for _, *number in known], float).reshape(-1, 2)


class WideLaws(NamedTuple):
    """Laws of several actuations as the loop calls them: addresses (l,), spans (l, 2) of the parameters (P,).

    `around` (l, 2) has α and γ of `JointLaw.unwrap`; then come as many zeros as a law may have actuations, and space
    for one call: deformation, effort, its slopes by all of them and by the deformation.
    """

    addresses: Any
    spans: Any
    parameters: Array
    around: Array
    zeros: Array
    at: Array
    value: Array
    by_a: Array
    by_u: Array

    @staticmethod
    def from_laws(laws: Sequence[JointLaw]) -> WideLaws | None:
        """Pack laws; return None if one of them has no scalar form."""
        if (found := _packed(laws)) is None:
            return None
        packed, around = found
        most = max(packed.counts, default=1)
        space = (np.zeros(most), np.empty(1), np.empty(1), np.empty(most), np.empty((1, 1)))
        return WideLaws(packed.addresses, packed.spans, packed.parameters, around, *space)


def is_wide(law: JointLaw) -> bool:
    """Return whether a law takes several actuations at once."""
    return len(law.actuations) > 1


class CalledLaws(NamedTuple):
    """Laws as `joint_effort` calls them: addresses (l,), spans (l, 2) of the parameters (P,), `less_rest` (l,).

    `around` (l, 2) has α and γ of `JointLaw.unwrap`.
    """

    addresses: Any
    spans: Any
    parameters: Array
    less: Array
    around: Array

    @staticmethod
    def from_laws(laws: Sequence[JointLaw]) -> CalledLaws | None:
        """Pack laws; return None if one of them has no scalar form."""
        if (found := _packed(laws)) is None:
            return None
        packed, around = found
        return CalledLaws(packed.addresses, packed.spans, packed.parameters, packed.less, around)
