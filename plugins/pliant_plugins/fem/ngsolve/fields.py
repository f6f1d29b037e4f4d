"""Stress, energy and stretch at the mesh's nodes, for pictures: evaluated in each cell, averaged where cells meet.

In a mixed law the volume ratio is the pressure's, Ĵ = 1 + q/K, and F̂ = (Ĵ/J)^⅓ F is what the material sees, so that
nearly incompressible solids show the pressure that was solved for and not the noise of K (J − 1).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.interfaces.material import Material
from pliant.meshing.hexahedra import shape_slopes
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem
from pliant_plugins.fem.ngsolve.library import ngs
from pliant_plugins.fem.ngsolve.mesh import LATTICE
from pliant_plugins.fem.rod_solver import field_values


def deformation_gradients(
    problem: ModuleProblem, scalar: Any, displacement: Array, turn: Array, strain: float
) -> Array:
    """F (m, 27, 3, 3) at the cells' nodes, less the section's rotation.

    Args:
        scalar: the H1 space of one displacement component.
        displacement: (unknowns, 3) coefficients of v in m.
        turn: Θ (3,).
        strain: e.
    """
    mesh = problem.mesh
    slopes = np.einsum("mai,qaj->mqij", mesh.nodes_m[mesh.cells], shape_slopes(LATTICE))
    inverse = np.linalg.inv(slopes)
    S = np.empty((len(mesh.cells), 27, 3, 3))
    rho = np.empty((len(mesh.cells), 27, 2))
    for cell in range(len(mesh.cells)):
        element = ngs.ElementId(ngs.VOL, cell)
        shape, local = scalar.GetFE(element), displacement[list(scalar.GetDofNrs(element))]
        for place, point in enumerate(LATTICE):
            by_reference = np.array(shape.CalcDShape(*point))
            S[cell, place] = local.T @ by_reference @ inverse[cell, place]
            rho[cell, place] = (np.array(shape.CalcShape(*point)) @ local)[1:]
    S += np.eye(3)
    S[..., 0, 0] += strain
    rho += mesh.nodes_m[mesh.cells][..., 1:] - np.array([0.0, problem.reference_z_m])
    k = turn / ((1 + strain) * problem.span_m)
    across = np.cross(k, np.concatenate([np.zeros((*rho.shape[:2], 1)), rho], axis=-1))
    return np.asarray(S + across[..., :, None] * S[..., :1, :])


def nodal_fields(material: Material, F: Array, pressure: Array | None, cells: IntArray) -> dict[str, Array]:
    """Fields (n,) of `ModuleFields` from F (m, 27, 3, 3) and, of a mixed law, q (m, 27) in Pa."""
    J = np.linalg.det(F)
    ratio = J if pressure is None else 1 + pressure / material.bulk_modulus_pa
    seen = (ratio / J)[..., None, None] ** (1 / 3) * F
    law = material.evaluate(seen)
    stress = law.stress @ np.swapaxes(seen, -1, -2) / ratio[..., None, None]
    values = field_values(seen, stress, law.energy, ratio)
    count = np.bincount(cells.ravel())
    return {name: np.bincount(cells.ravel(), value.ravel()) / count for name, value in values.items()}
