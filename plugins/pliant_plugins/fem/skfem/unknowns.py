"""Unknowns of a module: nodal displacements under constraints, and the rod's globals (Θ, e).

x = (v, ϑ − 1, q/K, globals): three displacements per node, node by node; volume ratios and pressures where the element
is a mixed one; then the active ones of Θ_x, Θ_y, Θ_z, e in that order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pliant.errors import ContractError, UserError
from pliant.records.design import Array
from pliant.records.fem import IntArray, Link, ModuleProblem
from pliant.records.law import EXTENSION
from pliant_plugins.fem.constraints import Constraints, Forest
from pliant_plugins.fem.skfem.basis import PressureData

AXES = ("x", "y", "z")
STRAIN = 3  # place of e among the four globals


@dataclass(frozen=True)
class Globals:
    """The active globals q of a problem.

    Attributes:
        span_m: length L of the undeformed piece.
        active: places among (Θ_x, Θ_y, Θ_z, e).
        axes: names of the joint's axes, in the joint's order.
        places: place in q of each axis; a problem without axes and stretch has v alone.
        scales: module coordinate u = scale · q by axis (rad or m).
    """

    span_m: float
    active: tuple[int, ...]
    axes: tuple[str, ...]
    places: tuple[int, ...]
    scales: tuple[float, ...]

    @staticmethod
    def from_problem(problem: ModuleProblem) -> Globals:
        """Number the unknowns. Raises `UserError` for axes that the joint cannot have."""
        axes, scale = problem.axes, problem.deformation_scale
        if axes and problem.main_axis not in axes:
            raise UserError(f"main axis '{problem.main_axis}' is not among the module's axes {list(axes)}.")
        if problem.joint == "prismatic":
            if axes != ("x",):
                raise UserError(f"a prismatic module has the axis 'x' alone, not {list(axes)}.")
            return Globals(problem.span_m, (STRAIN,), axes, (0,), (scale * problem.span_m,))
        known = (*AXES, EXTENSION) if problem.joint == "extensible" and problem.stretches else AXES
        if not set(axes) <= set(known) or len(set(axes)) < len(axes):
            raise UserError(f"a module's axes are distinct ones of {', '.join(known)}, not {list(axes)}.")
        numbers = [known.index(axis) for axis in axes]
        turns = sorted(number for number in numbers if number != STRAIN)
        active = (*turns, STRAIN) if problem.stretches else tuple(turns)
        places = tuple(active.index(number) for number in numbers)
        scales = tuple(scale * problem.span_m if number == STRAIN else scale for number in numbers)
        return Globals(problem.span_m, active, axes, places, scales)

    @cached_property
    def count(self) -> int:
        """G, the number of active globals."""
        return len(self.active)

    @cached_property
    def turns(self) -> tuple[int, ...]:
        """Components of Θ that are active."""
        return tuple(i for i in self.active if i != STRAIN)

    @cached_property
    def stretches(self) -> bool:
        """Return whether e is active."""
        return STRAIN in self.active

    def split(self, x: Array) -> tuple[Array, float]:
        """Return (Θ (3,), e) of x."""
        full = np.zeros(4)
        full[list(self.active)] = x[len(x) - self.count :]
        return full[:3], float(full[STRAIN])

    def curvature(self, x: Array) -> tuple[Array, float]:
        """Return (k (3,), e) of x, k = Θ / ((1 + e) L)."""
        turn, strain = self.split(x)
        return turn / ((1 + strain) * self.span_m), strain

    def chain(self, bent: tuple[Array, float], gradient: Array, border: Array) -> tuple[Array, Array]:
        """Transform derivatives in (v, k, e) to (v, Θ, e): gradient (n + G,), Hessian's columns (n + G, G).

        `bent` is the `curvature`.
        """
        (k, strain), G = bent, self.count
        if G == 0:
            return gradient, border
        slope, grown = 1 / ((1 + strain) * self.span_m), 1 + strain
        T = np.diag([slope, slope, slope, 1.0])
        T[:3, STRAIN] = -k / grown
        T = T[np.ix_(self.active, self.active)]
        border = border @ T
        border[-G:] = T.T @ border[-G:]
        if self.stretches:
            # Σ ∂w/∂k_i ∂²k_i
            mixed = -slope / grown * gradient[-G:-1]
            border[-G:-1, -1] += mixed
            border[-1, -G:-1] += mixed
            border[-1, -1] += 2 / grown**2 * float(gradient[-G:-1] @ k[list(self.turns)])
        return np.concatenate([gradient[:-G], T.T @ gradient[-G:]]), border


def constraints(problem: ModuleProblem, pressures: PressureData | None = None) -> Constraints:
    """Return fixed, tied and linked displacements as one signed map, then volumes and pressures of mixed cells.

    Volumes and pressures at linked nodes are equal: a symmetry maps them to themselves.
    Raises `ContractError` for a node set that the mesh does not have.
    """
    first = problem.mesh.nodes_m.size
    count = 0 if pressures is None else pressures.count
    size = first + 2 * count
    forest = Forest(size)
    for name, components in problem.tied.items():
        nodes = _node_set(problem, name)
        for c in components:
            forest.join(np.full(len(nodes) - 1, 3 * nodes[0] + c), 3 * nodes[1:] + c, 1.0)
    for link in problem.links:
        for c, sign in link.signs.items():
            forest.join(3 * np.asarray(link.first) + c, 3 * np.asarray(link.second) + c, float(sign))
        for a, b in _linked_pressures(link, pressures, len(problem.mesh.nodes_m)):
            for begin in (first, first + count):
                forest.join(begin + a, begin + b, 1.0)
    for name, components in problem.fixed.items():
        for c in components:
            forest.fix(3 * _node_set(problem, name) + c)
    return forest.constraints()


def _linked_pressures(
    link: Link, pressures: PressureData | None, nodes: int
) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield numbers of the continuous pressures at linked nodes in the same solid, pairwise."""
    if pressures is None or pressures.vertices is None or pressures.solids is None:
        return
    for solid in np.unique(pressures.solids):
        own = np.flatnonzero(pressures.solids == solid)
        place = np.full(nodes, -1)
        place[pressures.vertices[own]] = own
        a, b = place[link.first], place[link.second]
        both = (a >= 0) & (b >= 0)
        yield a[both], b[both]


def _node_set(problem: ModuleProblem, name: str) -> IntArray:
    if name not in problem.mesh.node_sets:
        known = ", ".join(sorted(problem.mesh.node_sets))
        raise ContractError(f"the problem constrains the node set '{name}'; the mesh has {known}.")
    return problem.mesh.node_sets[name]
