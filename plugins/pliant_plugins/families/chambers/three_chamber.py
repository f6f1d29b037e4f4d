"""Three chambers around a bore as an `ActuatorFamily`: a round tube that bends about two axes and grows longer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.families import Need, check_design, half_cylinders
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.meshing.grids import carved_cavities, grid_cells, grid_lines, module_sets
from pliant.meshing.hexahedra import boundary_faces
from pliant.meshing.masses import UNIFORM, half_masses
from pliant.meshing.surfaces import half_skins
from pliant.records.actuation import joined, split_actuation_names
from pliant.records.design import Array, ModuleMass
from pliant.records.fem import IntArray, Link, ModuleMesh, ModuleProblem
from pliant.records.law import EXTENSIBLE_AXES, JointKind
from pliant.records.shape import HalfShapes, HalfSurfaces
from pliant.units import Length

ALL = ("x", "y", "z")
CHAMBERS = 3
# Elements through each wall, across a chamber, around it, and through half a rib.
THROUGH, ACROSS, AROUND, RIB = 1, 2, 4, 1


class ThreeChamberConfig(FamilyConfig):
    """A round tube with an open bore and three chambers in its wall, sectors of a ring with ribs between them."""

    kind: Literal["three_chamber"] = "three_chamber"
    radius_m: Length = Field(description="R: outer radius")
    bore_m: Length = Field(description="b: radius of the open bore along the axis")
    wall_m: Length = Field(description="t: thickness of the outer wall, and of that around the bore")
    rib_m: Length = Field(description="thickness of the ribs at the chambers' mean radius")
    module_length_m: Length = Field(description="l: length of one module")
    extends: bool = Field(
        default=False,
        description="whether the extension is a coordinate of the joint; else the length follows the pressures, "
        "without a force along the chain, and a chain keeps its own",
    )


class ThreeChamber(ActuatorFamily):
    """One design of three chambers with a pressure each, the first at +z, the others 120° and 240° on about x.

    One pressure bends the module away from its chamber, about any axis across x with two of them; all three make it
    longer. As in `two_chamber` the tube is wound and sections are alike. The joint is a ball joint: bending about y and
    z, twist about x. With `extends` it is an extensible one: a module also grows by e, under its pressures and under
    a force along it, and a chain of them grows with it.
    """

    joint: ClassVar[JointKind] = "spherical"
    axes: ClassVar[tuple[str, ...]] = ALL
    actuation: ClassVar[str] = joined(f"pressure_{k}_pa" for k in range(1, CHAMBERS + 1))
    config: ThreeChamberConfig

    def __init__(self, config: ThreeChamberConfig) -> None:
        super().__init__(config)
        check_design(config, _needs(config))
        if config.extends:
            self.joint, self.axes = "extensible", EXTENSIBLE_AXES  # type: ignore[misc]

    @property
    def module_length_m(self) -> float:
        return self.config.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Return the whole module from x = 0; warping is the same at both end sections."""
        mesh = build_mesh(self.config, self.config.module_length_m, refinement)
        first, second = (mesh.node_sets[name] for name in ("start", "end"))
        return ModuleProblem(
            mesh=mesh,
            span_m=self.config.module_length_m,
            reference_z_m=0.0,
            deformation_scale=1.0,
            energy_scale=1.0,
            fixed={"wound": (1, 2), "pin": (0,)},
            links=(Link(first, second, {0: 1.0, 1: 1.0, 2: 1.0}),),
            axes=axes or self.axes,
            joint=self.joint,
            actuation=self.actuation,
            contact_planes=(),
        )

    @cached_property
    def _half(self) -> ModuleMesh:
        return build_mesh(self.config, self.config.module_length_m / 2)

    def shapes(self) -> HalfShapes:
        """Return a cylinder for each half."""
        return half_cylinders(self.config.module_length_m, self.config.radius_m)

    def surface(self) -> HalfSurfaces:
        """Return the skin of the two halves."""
        return half_skins(self._half, mirror_y=False)

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Return the masses of the two halves; the winding has no mass."""
        return half_masses(self._half, density_kg_m3, mirror_y=False, regions=regions)


def build_mesh(config: ThreeChamberConfig, span_m: float, refinement: int = 1) -> ModuleMesh:
    """Build the mesh, x ∈ [0, span]; node sets `wound`, the outside, and `pin`, one of its nodes at the start."""
    inner, outer = config.bore_m + config.wall_m, config.radius_m - config.wall_m
    through, across, along_arc, rib = (refinement * n for n in (THROUGH, ACROSS, AROUND, RIB))
    r = grid_lines((config.bore_m, inner, outer, config.radius_m), (through, across, through))
    half_rib = config.rib_m / (inner + outer)
    sector = 2 * np.pi / CHAMBERS
    side = sector / 2 - half_rib
    sides = [k * sector + sign * side for k in range(CHAMBERS) for sign in (-1.0, 1.0)]
    between = [(k + 0.5) * sector for k in range(-1, CHAMBERS)]
    turn = np.sort([*sides, *between])
    nodes, ids = _ring(
        grid_lines((0.0, span_m), refinement), r, grid_lines(turn, (rib, along_arc, rib) * CHAMBERS)
    )
    cells = grid_cells(ids[:, ::-1])  # x, φ, r are left-handed
    middle = nodes[cells[:, 13]]
    radius = np.hypot(middle[:, 1], middle[:, 2])
    # φ from +z, turning as a positive rotation about x does: toward −y.
    around = np.arctan2(-middle[:, 1], middle[:, 2])
    hollow = {}
    for k, name in enumerate(split_actuation_names(ThreeChamber.actuation)):
        away = np.abs((around - k * sector + np.pi) % (2 * np.pi) - np.pi)
        hollow[name] = (away < sector / 2 - half_rib) & (radius > inner) & (radius < outer)
    nodes, cells, cavities = carved_cavities(nodes, cells, hollow)
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, span_m, (0.0, 0.0, config.radius_m))
    sets["wound"] = np.flatnonzero(np.hypot(nodes[:, 1], nodes[:, 2]) > config.radius_m * (1 - 1e-9))
    return ModuleMesh(nodes, cells, np.concatenate([*cavities.values()]), skin, sets, cavities=cavities)


def _ring(x: Array, r: Array, phi: Array) -> tuple[Array, IntArray]:
    """Return nodes (n, 3) and ids [x, φ, r] of a full turn about x, the last line of φ being the first."""
    X, P, R = np.meshgrid(x, phi[:-1], r, indexing="ij")
    nodes = np.stack([X, -R * np.sin(P), R * np.cos(P)], axis=-1).reshape(-1, 3)
    ids = np.arange(X.size, dtype=np.int64).reshape(X.shape)
    return nodes, np.concatenate([ids, ids[:, :1]], axis=1)


def _needs(config: ThreeChamberConfig) -> Iterator[Need]:
    """Yield the conditions under which the chambers fit."""
    around = config.bore_m + 2 * config.wall_m
    yield Need("radius > bore + 2 wall (room for the chambers)", config.radius_m, around)
    arc = np.pi / CHAMBERS * (config.radius_m + config.bore_m)
    yield Need("rib < π (radius + bore)/3 (ribs leave room between them)", config.rib_m, arc)
