"""Material of a solid of several materials: each cell is evaluated by the law of its region."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.material import Hyperelastic, Material
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh


def material_solids(mesh: ModuleMesh, material: Material) -> tuple[tuple[IntArray, Material], ...]:
    """Return cells and law of each solid that has cells: the body, then the regions in their order."""
    number = mesh.region_numbers
    laws = (material, *(material.regions[name] for name in mesh.regions))
    parts = ((np.flatnonzero(number == place), own) for place, own in enumerate(laws))
    return tuple((cells, own) for cells, own in parts if len(cells))


def material_by_cell(mesh: ModuleMesh, material: Material) -> Material:
    """Return the material if the mesh has no regions, else a `ByRegion` with each cell's law."""
    return ByRegion(mesh, material) if mesh.regions else material


class ByRegion(Material):
    """The laws of a mesh's regions, for arrays whose first axis numbers its cells.

    `bulk_modulus_pa` is (m, 1), for quadrature points (m, q); constants of the whole solid are the body's.
    """

    def __init__(self, mesh: ModuleMesh, material: Material) -> None:
        super().__init__(material.config)
        self.body, self.regions = material, material.regions
        self._cells = material_solids(mesh, material)
        self._bulk = np.empty((len(mesh.cells), 1))
        for cells, own in self._cells:
            self._bulk[cells] = own.bulk_modulus_pa

    @property
    def shear_modulus_pa(self) -> float:
        return self.body.shear_modulus_pa

    @property
    def bulk_modulus_pa(self) -> Array:  # type: ignore[override]
        return self._bulk

    def energy(self, F: Array) -> Array:
        out = np.empty(F.shape[:-2])
        for cells, own in self._cells:
            out[cells] = own.energy(F[cells])
        return out

    def evaluate(self, F: Array) -> Hyperelastic:
        energy, stress, tangent = np.empty(F.shape[:-2]), np.empty(F.shape), np.empty((*F.shape, 3, 3))
        for cells, own in self._cells:
            law = own.evaluate(F[cells])
            energy[cells], stress[cells], tangent[cells] = law.energy, law.stress, law.tangent
        return Hyperelastic(energy, stress, tangent)
