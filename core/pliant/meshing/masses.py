"""Masses of a module from the mesh of the solved piece and its mirror images."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from pliant.errors import ContractError
from pliant.meshing.cells import cell_kind
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant.records.fem import ModuleMesh

UNIFORM: Mapping[str, float] = MappingProxyType({})
ORDER = 5  # Gauss rule that integrates second moments of quadratic cells exactly


def half_masses(
    mesh: ModuleMesh, density_kg_m3: float, mirror_y: bool = True, regions: Mapping[str, float] = UNIFORM
) -> ModuleMass:
    """Return the masses of a module whose solved piece is its `end` half, x ∈ [0, l/2], cut by y = 0.

    The `start` half is the mirror image in x = 0. Masses are those of the meshed solid, exact up to rounding; on curved
    walls they converge to the design's with the mesh.

    Args:
        mesh: the piece, in the module frame with the origin at the joint.
        density_kg_m3: of the solid.
        mirror_y: whether the piece is half the width, y ≥ 0 or y ≤ 0; False for the whole width.
        regions: densities of regions of the mesh that differ from the body's.
    """
    end = meshed_mass(mesh, density_kg_m3, regions)
    if mirror_y:
        end = end.joined(mirrored(end, 1))
    return ModuleMass(start=mirrored(end, 0), end=end)


def mirrored(piece: MassProperties, axis: int) -> MassProperties:
    """Return the piece's mirror image in the plane through the origin across axis 0, 1, 2 = x, y, z."""
    signs = np.ones(3)
    signs[axis] = -1.0
    return piece.rotated(np.diag(signs))


def meshed_mass(
    mesh: ModuleMesh, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM
) -> MassProperties:
    """Return mass, centre and inertia of the meshed solid, exact for its quadratic cells.

    `regions` are densities by region. Raises `ContractError` for a region that the mesh does not have.
    """
    return _point_mass_properties(*_points(mesh, density_kg_m3, regions))


def split_masses(
    mesh: ModuleMesh,
    span_m: float,
    density_kg_m3: float,
    mirror_y: bool = True,
    regions: Mapping[str, float] = UNIFORM,
) -> ModuleMass:
    """Return the masses of a whole module, x from 0 to span, about the joint in its middle.

    Their sum is exact; a cell crossed by the joint's plane is divided by its quadrature points.
    """
    x, dm = _points(mesh, density_kg_m3, regions)
    x = x - np.array([span_m / 2, 0.0, 0.0])
    ahead = x[:, 0] >= 0
    halves = [_point_mass_properties(x[chosen], dm[chosen]) for chosen in (~ahead, ahead)]
    if mirror_y:
        halves = [half.joined(mirrored(half, 1)) for half in halves]
    return ModuleMass(*halves)


def _points(mesh: ModuleMesh, density_kg_m3: float, regions: Mapping[str, float]) -> tuple[Array, Array]:
    """Return quadrature points (n, 3) in m and their masses (n,) in kg."""
    point, volume = cell_kind(mesh.cells).quadrature(mesh.nodes_m, mesh.cells, ORDER)
    density = np.full((len(mesh.cells), 1), density_kg_m3)
    for name, own in regions.items():
        if name not in mesh.regions:
            known = ", ".join(mesh.regions) or "none"
            raise ContractError(
                f"a density is given for the region '{name}'; the mesh's regions are {known}."
            )
        density[mesh.regions[name]] = own
    return point.reshape(-1, 3), (density * volume).ravel()


def _point_mass_properties(x: Array, dm: Array) -> MassProperties:
    """Return the mass properties of point masses dm (n,) at x (n, 3)."""
    mass = float(dm.sum())
    com = dm @ x / mass
    arm = x - com
    second = (dm * arm.T) @ arm  # ∫ r rᵀ dm
    return MassProperties(mass, com, np.trace(second) * np.eye(3) - second)
