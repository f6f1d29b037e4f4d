"""Where an equilibrium is expected, from those that are known.

Under efforts on the joint's axes alone the equilibria of a piece are a manifold x(z), f(z) over z = (actuations, the
globals of the axes), x the unknowns and f the efforts. A known equilibrium gives x and f and, by its condensed system
(`newton`), their slopes by z exactly. The nearest of them are interpolated, values and slopes, with a Gaussian kernel
about the tangent plane of the very nearest (Hermite interpolation: Wendland, Scattered Data Approximation, 2005,
ch. 16). Axes that are free are where the interpolated efforts on them vanish.

The prediction is only the start of Newton's method, whose result does not depend on it beyond the tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_plugins.fem.newton import Control, FemEquilibrium, FemSystem

NEIGHBOURS = 8  # known equilibria that are interpolated, for each component of z
LENGTH = 1.0  # of the kernel, by what is covered along each component
NUGGET = 1e-10  # of the kernel's diagonal
ITERATIONS = 8  # for the axes that are free
CLOSE = 1e-4  # of the covered range: uncertainty of these


@dataclass(frozen=True, eq=False)
class Anchor:
    """A known equilibrium.

    Attributes:
        z: (d,) actuations, then the globals of the joint's axes.
        x: (n,) unknowns, the globals last; `x_by_z` (n, d).
        effort: (k,) on the axes; `effort_by_z` (k, d).
    """

    z: Array
    x: Array
    x_by_z: Array
    effort: Array
    effort_by_z: Array

    @staticmethod
    def from_equilibrium(system: FemSystem, known: FemEquilibrium, places: tuple[int, ...]) -> Anchor:
        """Linearise at an equilibrium at which efforts act on the globals at `places` alone."""
        point, reduced, G = known.point, known.reduced, system.count
        S, b = reduced.stiffness, reduced.actuation.reshape(G, -1)
        axes, others = np.array(places), np.setdiff1d(np.arange(G), places)
        m = b.shape[1]
        change = np.zeros((G, m + len(axes)))
        change[axes, m + np.arange(len(axes))] = 1.0
        driven = np.column_stack([b[others], -S[np.ix_(others, axes)]])
        change[others] = np.linalg.solve(S[np.ix_(others, others)], driven)
        inner = -reduced.solved[:, 1 : 1 + G] @ change
        inner[:, :m] += reduced.solved[:, 1 + G :]
        slopes = np.column_stack([system.step(v, q) for v, q in zip(inner.T, change.T, strict=True)])
        by_actuation, by_axes = reduced.slopes(places)
        x = point.x
        return Anchor(
            z=np.concatenate([np.atleast_1d(point.actuation), x[-G:][axes]]),
            x=x,
            x_by_z=slopes,
            effort=-point.residual[-G:][axes],
            effort_by_z=np.column_stack([by_actuation, by_axes]),
        )


def expected(
    known: Array, anchor: Callable[[int], Anchor], target: Control, places: tuple[int, ...]
) -> Array | None:
    """Return x (n,) expected at the equilibrium under a control; None if fewer than two are known.

    `known` (N, d) are the z of the known equilibria, `anchor` gives the i-th of them.
    """
    if len(known) < 2:
        return None
    levels, axes = np.atleast_1d(np.asarray(target.actuation, float)), list(places)
    given = np.concatenate([np.ones(len(levels), bool), target.held[axes]])
    z = np.concatenate([levels, target.goal[axes]])
    width = np.ptp(np.vstack([known, np.where(given, z, known[0])]), axis=0)
    # components that never moved carry no information
    moved = width > 0
    scale = np.where(moved, width, 1.0)
    apart = np.where(given, (known - z) / scale, 0.0)
    order = np.argsort(np.sum(apart**2, axis=1), kind="stable")
    patch = _Patch.from_anchors([anchor(int(i)) for i in order[: NEIGHBOURS * len(z)]], scale, moved)
    free = np.flatnonzero(~given)
    if len(free):
        found = patch.released(z, free, free - len(levels), target.effort[axes])
        if found is None:
            return None
        z = found
    return patch.at(z)


@dataclass(frozen=True, eq=False)
class _Patch:
    """Neighbouring anchors, the nearest first, with the factors of the kernel's matrix among them."""

    near: list[Anchor]
    scale: Array
    moved: Array  # (d,) of bools
    factors: tuple[Array, IntArray]

    @staticmethod
    def from_anchors(near: list[Anchor], scale: Array, moved: Array) -> _Patch:
        z = np.array([anchor.z for anchor in near])[:, moved] / scale[moved]
        matrix = _kernel(z, z)
        return _Patch(near, scale, moved, lu_factor(matrix + NUGGET * np.diag(np.diag(matrix))))

    def at(self, z: Array, what: Literal["x", "effort"] = "x") -> Array:
        """Return x (n,) or f (k,)."""
        first, weights = self.near[0], self._weights(z)
        by_slope = np.zeros((len(self.near), len(z)))
        by_slope[:, self.moved] = weights[:, 1:] * self.scale[self.moved]
        values = weights[:, 0]
        # about the plane of the first: the weights' contribution to that plane is subtracted
        along = z - first.z - values @ (self._known - first.z) - by_slope.sum(axis=0)
        total = (1 - values.sum()) * getattr(first, what) + getattr(first, f"{what}_by_z") @ along
        for anchor, value, slope in zip(self.near, values, by_slope, strict=True):
            total += value * getattr(anchor, what)
            total += getattr(anchor, f"{what}_by_z") @ slope
        return np.asarray(total)

    @cached_property
    def _known(self) -> Array:
        """(N, d) places of the anchors."""
        return np.array([anchor.z for anchor in self.near])

    def released(self, z: Array, free: IntArray, axes: IntArray, effort: Array) -> Array | None:
        """Return z with free components of the axes `axes` under `effort`; None if that is not found."""
        z = z.copy()
        z[free] = self.near[0].z[free]
        for _ in range(ITERATIONS):
            borne = self.at(z, "effort")[axes]
            slopes = np.empty((len(axes), len(free)))
            for column, place in enumerate(free.tolist()):
                aside = z.copy()
                aside[place] += CLOSE * self.scale[place]
                slopes[:, column] = (self.at(aside, "effort")[axes] - borne) / (CLOSE * self.scale[place])
            step = np.linalg.solve(slopes, effort[axes] - borne)
            z[free] += step
            if np.all(np.abs(step) <= CLOSE * self.scale[free]):
                return z
        return None

    def _weights(self, z: Array) -> Array:
        """Return (N, 1 + d') of the anchors' values and of their scaled slopes, d' being the components that moved."""
        at = self._known[:, self.moved] / self.scale[self.moved]
        row = _kernel((z[self.moved] / self.scale[self.moved])[None], at)[0]
        return np.asarray(lu_solve(self.factors, row)).reshape(len(self.near), -1)


def _kernel(a: Array, b: Array) -> Array:
    """Return (M (1 + d), N (1 + d)) Gaussian kernel of places a (M, d) and b (N, d), with its slopes by both."""
    d = a.shape[1]
    apart = (a[:, None] - b[None]) / LENGTH
    value = np.exp(-0.5 * np.sum(apart**2, axis=-1))[..., None]
    full = np.empty((len(a), len(b), 1 + d, 1 + d))
    full[..., 0, :1] = value
    full[..., 0, 1:] = value * apart / LENGTH
    full[..., 1:, 0] = -value * apart / LENGTH
    second = np.eye(d) - apart[..., :, None] * apart[..., None, :]
    full[..., 1:, 1:] = value[..., None] * second / LENGTH**2
    return full.swapaxes(1, 2).reshape(len(a) * (1 + d), len(b) * (1 + d))
