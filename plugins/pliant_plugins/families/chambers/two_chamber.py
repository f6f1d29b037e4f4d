"""Two opposed chambers as an `ActuatorFamily`: a rectangular tube with a web between them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.families import Need, QuarterModule
from pliant.interfaces.family import FamilyConfig
from pliant.meshing.grids import block, carved_cavities, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.actuation import joined, split_actuation_names
from pliant.records.fem import ModuleMesh
from pliant.units import Length

# Elements through walls and web, across each chamber, and along half its width.
THROUGH, ACROSS, ASIDE = 2, 3, 4


class TwoChamberConfig(FamilyConfig):
    """A tube of width w and height h with two rectangular chambers, one above and one below a web at mid-height."""

    kind: Literal["two_chamber"] = "two_chamber"
    width_m: Length = Field(description="w: outer width along y")
    height_m: Length = Field(description="h: outer height along z")
    wall_m: Length = Field(description="t: thickness of the outer walls")
    web_m: Length = Field(description="thickness of the web between the chambers")
    module_length_m: Length = Field(description="l: length of one module")


class TwoChamber(QuarterModule):
    """One design of two opposed chambers with a pressure each; the first is at +z and bends toward −z.

    The tube is wound: threads around it, which do not stretch, allow elongation and bending and keep the outline of
    each section (the limit of a close winding; Suzumori, Iikura and Tanaka, IEEE ICRA 1991, wind their actuators so).
    Sections are identical, so that a slice of one element along x is enough. The length follows the pressures, without
    a force along the chain, and is no coordinate of the joint: a chain of modules keeps its length. The winding has no
    mass.
    """

    actuation: ClassVar[str] = joined(("pressure_1_pa", "pressure_2_pa"))
    fixed: ClassVar = {"start": (0,), "end": (0,), "symmetry": (1,), "wound": (1, 2)}
    config: TwoChamberConfig

    def needs(self) -> Iterator[Need]:
        c = self.config
        yield Need("height > 2 wall + web (room for two chambers)", c.height_m, 2 * c.wall_m + c.web_m)
        yield Need("width > 2 wall (room for the chambers)", c.width_m, 2 * c.wall_m)

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        return build_mesh(self.config, refinement)


def build_mesh(config: TwoChamberConfig, refinement: int = 1) -> ModuleMesh:
    """Build the mesh, x ∈ [0, l/2], y ≥ 0; node set `wound` is the outside of the tube."""
    through, across, aside = (refinement * n for n in (THROUGH, ACROSS, ASIDE))
    w, h, t, web = config.width_m / 2, config.height_m / 2, config.wall_m, config.web_m / 2
    y = grid_lines((0.0, w - t, w), (aside, through))
    upper = grid_lines((web, h - t, h), (across, through))
    z = np.concatenate([-upper[::-1], grid_lines((-web, web), through)[1:-1], upper])
    span = config.module_length_m / 2
    nodes, ids = numbered(block(grid_lines((0.0, span), refinement), y, z))
    cells = grid_cells(ids)
    middle = nodes[cells[:, 13]]
    inside = middle[:, 1] < w - t
    hollow = {
        name: inside & (sign * middle[:, 2] > web) & (sign * middle[:, 2] < h - t)
        for name, sign in zip(split_actuation_names(TwoChamber.actuation), (1.0, -1.0), strict=True)
    }
    nodes, cells, cavities = carved_cavities(nodes, cells, hollow)
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, span)
    near = 1e-9 * config.height_m
    outside = (np.abs(nodes[:, 1] - w) < near) | (np.abs(np.abs(nodes[:, 2]) - h) < near)
    sets["wound"] = np.flatnonzero(outside)
    return ModuleMesh(nodes, cells, np.concatenate([*cavities.values()]), skin, sets, cavities=cavities)
