"""Contact of rigid parts with their mirror image: an edge that moves with the end section and must not cross x = 0.

The edge's position is a function of the globals alone, the same as that of a tendon's hole (`potentials.drawn`): with W
drawn out of a hole there, it is d = W − (L + x) beyond the plane. It stores area · φ(d), φ that of `contact`: rigid
links yield as a wall of the flexure would, by less than a hundredth of it.
"""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import ModuleProblem, Tendon
from pliant_plugins.fem.skfem.contact import ContactSkin
from pliant_plugins.fem.skfem.potentials import Jet, drawn


def edges(problem: ModuleProblem, turn: Array, strain: float) -> list[Jet]:
    """Return the distance of each edge beyond the plane (m), with gradient and Hessian in (Θ_x, Θ_y, Θ_z, e)."""
    span, height, found = problem.span_m, problem.reference_z_m, []
    for stop in problem.stops:
        value, first, second = drawn(Tendon(stop.x_m, stop.z_m), span, height, turn, strain, 0.0)
        found.append((value - span - stop.x_m, first[:4], second[:4, :4]))
    return found


def stop_energy(problem: ModuleProblem, skin: ContactSkin, turn: Array, strain: float) -> list[Jet]:
    """Return the energy of each edge that touches its image (J)."""
    found = []
    for stop, (depth, first, second) in zip(problem.stops, edges(problem, turn, strain), strict=True):
        if depth > 0:
            value, slope, bend = (stop.area_m2 * float(part) for part in skin.law(np.array(depth)))
            found.append((value, slope * first, bend * np.outer(first, first) + slope * second))
    return found
