"""Threads in the solid: an energy of the stretch along a direction, added to that of the cells' material.

w = ½ κ (λ − 1)², λ = |F d|, n = F d / λ, hence P = κ (λ − 1) n ⊗ d and, with 1 the unit tensor,

    A_ijkl = κ (n_i n_k + (1 − 1/λ) (1_ik − n_i n_k)) d_j d_l
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant.interfaces.material import Hyperelastic, Material
from pliant.records.design import Array
from pliant.records.fem import Fibres, IntArray, ModuleMesh
from pliant_plugins.fem.skfem.basis import CellData


def with_fibres(material: Material, fibres: Sequence[Fibres], mesh: ModuleMesh, data: CellData) -> Material:
    """Return the material with fibres at the cells' quadrature points; unchanged without fibres."""
    if not fibres:
        return material
    # place in a cell's own nodes of each of scikit-fem's
    place = np.argmax(mesh.cells[0][None, :] == data.nodes[0][:, None], axis=1)
    sets = []
    for one in fibres:
        along = data.value @ one.directions[:, place]
        unit = along / np.linalg.norm(along, axis=-1, keepdims=True)
        sets.append((np.asarray(one.cells), unit, one.stiffness_pa))
    return Threaded(material, sets)


class Threaded(Material):
    """A material with threads, for arrays of deformation gradients (m, q, 3, 3) at a mesh's quadrature points."""

    def __init__(self, matrix: Material, sets: Sequence[tuple[IntArray, Array, float]]) -> None:
        super().__init__(matrix.config)
        self.matrix, self._sets = matrix, sets

    @property
    def shear_modulus_pa(self) -> float:
        return self.matrix.shear_modulus_pa

    @property
    def bulk_modulus_pa(self) -> float:
        return self.matrix.bulk_modulus_pa

    def energy(self, F: Array) -> Array:
        return self.evaluate(F).energy

    def evaluate(self, F: Array) -> Hyperelastic:
        law = self.matrix.evaluate(F)
        energy, stress, tangent = law.energy.copy(), law.stress.copy(), law.tangent.copy()
        for cells, d, stiffness in self._sets:
            f = (F[cells] @ d[..., None])[..., 0]
            stretch = np.linalg.norm(f, axis=-1)[..., None]
            n, longer = f / stretch, stretch - 1
            energy[cells] += 0.5 * stiffness * longer[..., 0] ** 2
            stress[cells] += stiffness * (longer * n)[..., :, None] * d[..., None, :]
            along = n[..., :, None] * n[..., None, :]
            across = (longer / stretch)[..., None] * (np.eye(3) - along)
            tangent[cells] += stiffness * np.einsum("...ik,...j,...l->...ijkl", along + across, d, d)
        return Hyperelastic(energy, stress, tangent)
