"""A solid of several materials as one: each cell is evaluated by the law of its region."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.material import Hyperelastic, Material
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh


def solids_of(mesh: ModuleMesh, material: Material) -> tuple[tuple[IntArray, Material], ...]:
    """Cells and law of each solid that has cells: the body, then the regions in their order."""
    number = region_numbers(mesh)
    laws = (material, *(material.regions[name] for name in mesh.regions))
    parts = ((np.flatnonzero(number == place), own) for place, own in enumerate(laws))
    return tuple((cells, own) for cells, own in parts if len(cells))


def material_by_cell(mesh: ModuleMesh, material: Material) -> Material:
    """The material itself where the mesh has no regions, else the one that knows each cell's law."""
    return ByRegion(mesh, material) if mesh.regions else material


class ByRegion(Material):
    """The laws of a mesh's regions, for arrays whose first axis numbers its cells.

    `bulk_modulus_pa` is (m, 1), as quadrature points (m, q) need it; constants of the solid as a whole are the body's.
    """

    def __init__(self, mesh: ModuleMesh, material: Material) -> None:
        super().__init__(material.config)
        self.body, self.regions = material, material.regions
        self._cells = solids_of(mesh, material)
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


def region_numbers(mesh: ModuleMesh) -> IntArray:
    """(m,) for each cell the place of its region in `mesh.regions` from 1; 0 for the body."""
    numbers = np.zeros(len(mesh.cells), np.int64)
    for number, cells in enumerate(mesh.regions.values(), 1):
        numbers[cells] = number
    return numbers
