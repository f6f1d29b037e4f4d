"""Bending bellows in a row as one body: clamped at the base, closed at the tip by a plate of the same rubber."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.meshing.stacking import capped, stacked
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.records.structure import StructureProblem
from pliant_plugins.families.bellow_bending.geometry import BellowGeometry
from pliant_plugins.families.bellow_bending.mesh import build_mesh

CAP_WALLS = 2.0  # thickness of the end cap over that of the wall: as thick as the plate
NEAR = 1e-6  # of the module: nodes nearer than this lie on a line


def build_structure(geometry: BellowGeometry, modules: int, refinement: int = 1) -> StructureProblem:
    """The body on x ∈ [0, N l + cap], half its width, y ≥ 0; the section x = 0 (mid-trough) is clamped all over.

    The tip's force acts on the plate's mid-plane at the end of the last module, across its width, so that its line
    of action is that of the chain's tip.
    """
    length = geometry.module_length_m
    body = stacked(build_mesh(geometry, refinement), geometry.half_length_m, modules)
    mesh = capped(body, modules * length, CAP_WALLS * geometry.wall_m, layers=refinement)
    x, y, z = mesh.nodes_m.T
    near = NEAR * length

    def nodes(at_x: float) -> Array:
        return np.abs(x - at_x) < near

    centre_line = (np.abs(y) < near) & (np.abs(z) < near)
    stations = [0.0, *(length * (k + 0.5) for k in range(modules)), modules * length]
    markers: IntArray = np.array([np.flatnonzero(nodes(s) & centre_line)[0] for s in stations])
    plate = (np.abs(y) < near) & (z < geometry.wall_m + near)
    sections = tuple(_upwards(np.flatnonzero(nodes(k * length) & plate), z) for k in range(modules + 1))
    tip = np.flatnonzero(
        nodes(modules * length) & (np.abs(z) < near) & (y < geometry.average_radius_m + near)
    )
    tip = tip[np.argsort(y[tip])]
    shares = np.gradient(y[tip]) * np.r_[0.5, np.ones(len(tip) - 2), 0.5]
    clamp = np.flatnonzero(nodes(0.0))
    mesh = replace(mesh, node_sets={**mesh.node_sets, "base": clamp})
    return StructureProblem(
        mesh=mesh,
        fixed={"base": (0, 1, 2), "symmetry": (1,)},
        tip=tip,
        tip_shares=shares / shares.sum(),
        markers=markers,
        sections=sections,
        modules=modules,
    )


def _upwards(ids: IntArray, z: Array) -> IntArray:
    return ids[np.argsort(z[ids])]
