"""Solids from and to files through trimesh: STL, OBJ, PLY, OFF."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import MissingDependencyError, UserError
from pliant.records.design import Array, MassProperties
from pliant.records.shape import TriangleMesh
from pliant.regular_files import require_there

# Voxels of the decomposition: a hundred times fewer than V-HACD's usual, and a second of one core.
VOXELS = 20_000
READ = (".stl", ".obj", ".ply", ".off")
LARGEST_M = 2.0  # beyond it, a part was drawn in millimetres and read as metres


@dataclass(frozen=True, eq=False)
class Solid:
    """A watertight solid: its surface, its convex hull, and its mass properties for density 1.

    Attributes:
        surface, hull: in the file's frame, metres.
        volume_m3, hull_volume_m3: enclosed volumes.
        unit_mass: mass properties at 1 kg/m³.
    """

    surface: TriangleMesh
    hull: TriangleMesh
    volume_m3: float
    hull_volume_m3: float
    unit_mass: MassProperties

    def mass(self, density_kg_m3: float) -> MassProperties:
        """Return mass, centre and inertia of the homogeneous solid."""
        unit = self.unit_mass
        return MassProperties(density_kg_m3 * unit.mass_kg, unit.com_m, density_kg_m3 * unit.inertia_kg_m2)


def read_solid(path: Path, scale: float = 1.0) -> Solid:
    """Read a solid from a file; its lengths times `scale` are metres (0.001 for a file in millimetres).

    Raises:
        UserError: no such file, another format than `READ`, not watertight, no volume, or larger than anything
            that a gripper meets, which is a wrong unit.
        MissingDependencyError: trimesh is not installed.
    """
    trimesh = _trimesh()
    require_there(path, f"mesh '{path}'")
    if path.suffix.lower() not in READ:
        raise UserError(f"mesh '{path.name}' is none of {', '.join(READ)}.")
    try:
        read: Any = trimesh.load_mesh(path)
    except Exception as error:  # its readers raise whatever they stumble over
        why = "" if isinstance(error, ImportError) else f" ({error})"  # a package for odd encodings
        raise UserError(f"mesh '{path.name}' cannot be read as {path.suffix[1:].upper()}{why}.") from None
    if not isinstance(read, trimesh.Trimesh) or not len(read.faces):
        raise UserError(f"mesh '{path.name}' holds no triangles.")
    read.apply_scale(scale)
    _check(read, path, scale)
    hull = read.convex_hull
    properties = read.mass_properties
    return Solid(
        surface=_surface(read),
        hull=_surface(hull),
        volume_m3=float(read.volume),
        hull_volume_m3=float(hull.volume),
        unit_mass=MassProperties(
            float(read.volume), np.array(read.center_mass, float), np.array(properties["inertia"], float)
        ),
    )


@dataclass(frozen=True, eq=False)
class ConvexPart:
    """A convex surface in the solid's frame, and the enclosed volume."""

    surface: TriangleMesh
    volume_m3: float


def convex_parts(solid: Solid, most: int) -> tuple[ConvexPart, ...]:
    """Return the convex hull, or up to `most` convex parts that approximate the solid.

    By V-HACD (Mamou, Volumetric hierarchical approximate convex decomposition, 2016): voxels are cut by planes until
    the parts hardly enclose more than the solid. The same solid gives the same parts.

    Raises:
        MissingDependencyError: vhacdx is not installed.
    """
    if most == 1:
        return (ConvexPart(solid.hull, solid.hull_volume_m3),)
    trimesh = _trimesh()
    if find_spec("vhacdx") is None:
        raise MissingDependencyError("convex parts of a mesh need vhacdx: pip install 'pliant[concave]'.")
    surface = trimesh.Trimesh(solid.surface.vertices_m, solid.surface.faces, process=False)
    found = trimesh.decomposition.convex_decomposition(
        surface, maxConvexHulls=most, resolution=VOXELS, asyncACD=False
    )
    hulls = [trimesh.Trimesh(**one).convex_hull for one in found]
    return tuple(ConvexPart(_surface(hull), float(hull.volume)) for hull in hulls)


def write_stl(surface: TriangleMesh, path: Path) -> None:
    """Write the surface as a binary STL file in metres."""
    _trimesh().Trimesh(surface.vertices_m, surface.faces, process=False).export(path, file_type="stl")


def _check(read: Any, path: Path, scale: float) -> None:
    size = float(np.max(read.extents))
    if size > LARGEST_M:
        raise UserError(
            f"mesh '{path.name}' is {size:.3g} m long with scale {scale:g}; a file in millimetres needs 'scale: 0.001'."
        )
    if not read.is_watertight:
        edges: Array = np.sort(read.edges, axis=1)
        _, count = np.unique(edges, axis=0, return_counts=True)
        raise UserError(
            f"mesh '{path.name}' is not watertight: {int(np.sum(count != 2))} edges do not join two faces. "
            "Close it in the program that drew it; without a closed surface it has no volume and no mass."
        )
    with np.errstate(all="ignore"):  # the centre of what has no volume
        volume = float(read.volume)
    if volume <= 1e-6 * size**3:
        what = "is inside out (its normals point inward)" if volume < 0 else "encloses no volume"
        raise UserError(f"mesh '{path.name}' {what}: {1e9 * volume:.3g} mm³.")


def _surface(read: Any) -> TriangleMesh:
    return TriangleMesh(np.array(read.vertices, float), np.array(read.faces, np.int64))


def _trimesh() -> Any:
    try:
        import trimesh
    except ImportError:
        raise MissingDependencyError("meshes need trimesh: pip install 'pliant[grasp]'.") from None
    return trimesh
