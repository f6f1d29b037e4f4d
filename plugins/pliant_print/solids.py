"""A study's robot or module as checked solids with their numbers: volumes, walls, overhangs, masses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.errors import NotReachedError
from pliant.interfaces.family import ActuatorFamily
from pliant.pipeline.chain import base_rotation
from pliant.pipeline.segments import material_density, region_densities
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import simplified, solid, surface, united, volume_m3
from pliant_print.chain_solid import ChainSolid, chain_solid
from pliant_print.checks import SurfaceCheck, check_surface
from pliant_print.closing import ClosedChain, closed_chain, modules_volume_m3
from pliant_print.config import PrinterConfig, SolidConfig
from pliant_print.module_solid import BODY, LINKS, ModuleSolid, module_solid
from pliant_print.stack import study_pieces, study_refinement
from pliant_print.walls import MOST_RAYS, Overhang, Wall, best_direction, thinnest_wall

FEW_RAYS = 20_000  # of a candidate of a search
VOLUME_BAR = 5e-3  # of the FEM's volume


@dataclass(frozen=True, eq=False)
class Body:
    """One material of a solid.

    Attributes:
        name: `body`, a region of the mesh, `links` or `ribbon`.
        surface: in the frame of the file's choice, metres.
        check: defects of the surface.
        density_kg_m3: of its material; None where the study has none.
    """

    name: str
    surface: TriangleMesh
    check: SurfaceCheck
    density_kg_m3: float | None

    @property
    def mass_kg(self) -> float | None:
        return None if self.density_kg_m3 is None else self.density_kg_m3 * self.check.volume_m3


@dataclass(frozen=True, eq=False)
class PrintedSolid:
    """A robot or a module, ready to be written.

    Attributes:
        bodies: by material, in the frame of the chain's base (a module: in its own).
        modules_m3, fem_m3: volume of the modules, measured on the solid, and by the FEM's quadrature.
        module_walls: thinnest wall of each material of the modules, before cap and flange are added.
        thinnest: wall of all bodies together, as they are bonded to each other.
        standing, best: overhangs on the base, and in the best of six directions.
        base_rotation, base_position_m: pose of the base in the world.
        notes: sentences on what was added.
        closed: the closed chain; None for a module.
    """

    bodies: tuple[Body, ...]
    modules_m3: float
    fem_m3: float
    module_walls: Mapping[str, Wall]
    thinnest: Wall
    standing: Overhang
    best: Overhang
    base_rotation: Array
    base_position_m: Array
    notes: tuple[str, ...] = ()
    closed: ClosedChain | None = None

    @property
    def volume_error(self) -> float:
        """Difference of the modules' volume from the FEM's, as a share."""
        return self.modules_m3 / self.fem_m3 - 1


def printer_settings(study: Study) -> PrinterConfig:
    """Return the study's printer, or the default one."""
    return study.block("printer") or PrinterConfig()


def chain_with_settings(
    context: RunContext, study: Study
) -> tuple[ChainSolid, dict[str, Wall], SolidConfig, dict[str, float]]:
    """Return the chain's modules as solids, their thinnest walls, the closing parts, and densities by material."""
    pieces = study_pieces(context, study)
    config = study.block("solid") or SolidConfig()
    chain = chain_solid(pieces, config.inlet_bore_m)
    walls: dict[str, Wall] = {}
    modules: list[ModuleSolid] = list({id(p.module): p.module for p in pieces if p.module}.values())
    for module in modules:
        for name, wall in module_walls(module).items():
            if name not in walls or wall.thickness_m < walls[name].thickness_m:
                walls[name] = wall
    return chain, walls, config, densities(context, study, chain.first)


def module_walls(module: ModuleSolid, rays: int = MOST_RAYS) -> dict[str, Wall]:
    """Return the thinnest wall of each material of a module."""
    return {name: thinnest_wall(solid(part, name), rays) for name, part in module.bodies.items()}


def printed_chain(context: RunContext, study: Study) -> PrintedSolid:
    """Return the study's robot, closed, from its families' meshes.

    Raises:
        UserError: the study has no chain or no family with a mesh.
        NotReachedError: a surface is not closed or crosses itself, or the volume is not the FEM's.
    """
    chain, walls, config, density = chain_with_settings(context, study)
    closed = closed_chain(chain, config, min(wall.thickness_m for wall in walls.values()))
    assert study.chain is not None
    return _checked(
        closed.bodies,
        modules_volume_m3(closed),
        sum(chain.fem_volumes_m3.values()),
        walls,
        density,
        printer_settings(study),
        base_rotation(study.chain.base),
        np.array(study.chain.base.position_m, float),
        closed,
    )


def printed_module(context: RunContext, study: Study) -> PrintedSolid:
    """Return one module of the study's family in its own frame, open at both ends as its FEM is."""
    family: ActuatorFamily = context.build("family", study.need("family", "the solid of a module"))
    module = module_solid(family, study_refinement(study))
    bodies = {name: simplified(solid(part, name)) for name, part in module.bodies.items()}
    return _checked(
        bodies,
        sum(volume_m3(body) for body in bodies.values()),
        sum(module.volumes_m3.values()),
        module_walls(module),
        densities(context, study, module),
        printer_settings(study),
        np.eye(3),
        np.zeros(3),
    )


def _checked(
    bodies: Mapping[str, Any],
    modules_m3: float,
    fem_m3: float,
    walls: Mapping[str, Wall],
    density: Mapping[str, float],
    printer: PrinterConfig,
    rotation: Array,
    position_m: Array,
    closed: ClosedChain | None = None,
) -> PrintedSolid:
    made = []
    for name, body in bodies.items():
        skin = surface(body)
        made.append(Body(name, skin, check_surface(skin), density.get(name)))
    unsound = [one for one in made if not one.check.sound]
    if unsound:
        one = unsound[0]
        raise NotReachedError(
            f"the body '{one.name}' is no sound solid: {one.check.open_edges} open edges, {one.check.crossings} "
            "pairs of triangles that cross. Nothing was written; solve a finer mesh (fem.refinement: 2)."
        )
    if abs(modules_m3 / fem_m3 - 1) > VOLUME_BAR:
        raise NotReachedError(
            f"the modules' solid has {1e9 * modules_m3:.5g} mm³ and the FEM's mesh {1e9 * fem_m3:.5g} mm³; nothing was "
            "written."
        )
    whole = united(bodies.values())
    thinnest = thinnest_wall(whole)
    standing, best = best_direction(surface(whole), printer.max_overhang_rad)
    return PrintedSolid(
        tuple(made),
        modules_m3,
        fem_m3,
        dict(walls),
        thinnest,
        standing,
        best,
        rotation,
        position_m,
        closed.notes if closed else (),
        closed,
    )


def densities(context: RunContext, study: Study, module: ModuleSolid) -> dict[str, float]:
    """Return the density by material; that of rigid links is the family's mass without the mesh over their volume."""
    soft = material_density(study)
    if soft is None:
        return {}
    found = {BODY: soft, **region_densities(study)}
    if LINKS in module.bodies:
        family: ActuatorFamily = context.build("family", study.need("family", "a solid"))
        mass = family.mass(soft, region_densities(study)) if family.regions else family.mass(soft)
        whole = mass.start.mass_kg + mass.end.mass_kg
        meshed = sum(found.get(k, soft) * v for k, v in module.volumes_m3.items() if k != LINKS)
        found[LINKS] = (whole - meshed - soft * family.unmeshed_volume_m3) / module.volumes_m3[LINKS]
    return found


def thinnest_wall_m(context: RunContext, study: Study) -> float:
    """Return the thinnest wall of the study's modules, for formulas of a search."""
    pieces = study_pieces(context, study)
    modules = {id(piece.module): piece.module for piece in pieces if piece.module}
    return min(wall.thickness_m for one in modules.values() for wall in module_walls(one, FEW_RAYS).values())
