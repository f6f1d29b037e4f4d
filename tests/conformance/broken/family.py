"""A good family, the box with its cavity off the axis, and bodies that are none."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from broken import Variants
from pliant.errors import InvalidDesignError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.meshing.hexahedra import cell_volumes
from pliant.records.design import MassProperties, ModuleMass
from pliant.records.fem import Link, ModuleProblem
from pliant.registry.component import Component
from pliant.testing.box import BoxShape, box_problem
from pliant.units import Length


class BoxConfig(FamilyConfig):
    """A rectangular tube with a thick floor."""

    kind: Literal["small"] = "small"
    width_m: Length = 9e-3
    wall_m: Length = 1.5e-3
    floor_m: Length = 3e-3
    height_m: Length = 8.5e-3
    module_length_m: Length = 12e-3


class Box(ActuatorFamily):
    """One design of the box."""

    config: BoxConfig

    def __init__(self, config: BoxConfig) -> None:
        super().__init__(config)
        values = config.canonical()
        for name in ("width_m", "wall_m", "floor_m", "height_m", "module_length_m"):
            if values[name] <= 0:
                raise InvalidDesignError(f"box needs {name} > 0, but it is {values[name]:g} m.")
        for room in (config.width_m - 2 * config.wall_m, config.height_m - config.floor_m - config.wall_m):
            if room <= 0:
                raise InvalidDesignError(f"box needs room for its cavity, short by {-room:g} m.")

    @property
    def module_length_m(self) -> float:
        return self.config.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        c = self.config
        y = (0.0, c.width_m / 2 - c.wall_m, c.width_m / 2)
        z = (0.0, c.floor_m, c.height_m - c.wall_m, c.height_m)
        return box_problem(BoxShape(y, z, c.module_length_m / 2), refinement)

    def mass(self, density_kg_m3: float) -> ModuleMass:
        mesh = self.problem().mesh
        volumes = 2 * cell_volumes(mesh.nodes_m, mesh.cells)
        centres = mesh.nodes_m[mesh.cells[:, 13]]
        sizes = np.ptp(mesh.nodes_m[mesh.cells], axis=1)
        sizes[:, 1] = self.config.width_m
        mass = density_kg_m3 * volumes.sum()
        com = np.append(volumes @ centres[:, [0, 2]], 0.0)[[0, 2, 1]] / volumes.sum()
        inertia = np.zeros((3, 3))
        for volume, centre, size in zip(volumes, centres - com, sizes, strict=True):
            own = (size @ size * np.eye(3) - np.diag(size**2)) / 12
            arm = centre * [1, 0, 1]
            inertia += density_kg_m3 * volume * (own + arm @ arm * np.eye(3) - np.outer(arm, arm))
        mirror = np.diag([-1.0, 1.0, 1.0])
        return ModuleMass(
            MassProperties(mass, mirror @ com, mirror @ inertia @ mirror), MassProperties(mass, com, inertia)
        )


variants = Variants(Component("family", "small", "broken.family:BoxConfig", "broken.family:Box", "a box"))


class Falsified(Box):
    """Changes the problem or its mesh after the good one made it."""

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        problem = super().problem(refinement)
        mesh = replace(problem.mesh, **self.mesh_changes(problem))
        return replace(problem, **{"mesh": mesh, **self.changes(problem)})

    def mesh_changes(self, problem: ModuleProblem) -> dict[str, Any]:
        return {}

    def changes(self, problem: ModuleProblem) -> dict[str, Any]:
        return {}


@variants.by("elements_are_valid", "inverted or collapsed")
class LeftHanded(Falsified):
    """Cells in mirrored order."""

    def mesh_changes(self, problem: ModuleProblem) -> dict[str, Any]:
        order = np.arange(27).reshape(3, 3, 3)[:, :, ::-1].ravel()
        return {"cells": problem.mesh.cells[:, order]}


@variants.by("mesh_is_one_closed_body", "nodes coincide")
class Cracked(Falsified):
    """The last cell has nodes of its own."""

    def mesh_changes(self, problem: ModuleProblem) -> dict[str, Any]:
        mesh = problem.mesh
        own = np.arange(27) + len(mesh.nodes_m)
        nodes = np.concatenate([mesh.nodes_m, mesh.nodes_m[mesh.cells[-1]]])
        # the old nodes that only the last cell used go
        keep = np.unique(np.concatenate([mesh.cells[:-1].ravel(), own]))
        new = np.zeros(len(nodes), int)
        new[keep] = np.arange(len(keep))
        return {"nodes_m": nodes[keep], "cells": new[np.vstack([mesh.cells[:-1], own])]}


@variants.by("cavity_faces_point_into_the_cavity", "swap its a and b")
class InwardCavity(Falsified):
    """Cavity normals into the solid."""

    def mesh_changes(self, problem: ModuleProblem) -> dict[str, Any]:
        return {"cavity": problem.mesh.cavity[:, np.arange(9).reshape(3, 3).T.ravel()]}


@variants.by("end_sections_are_plane", "node set 'end' has")
class MissingEndNodes(Falsified):
    """An end set without its last node."""

    def mesh_changes(self, problem: ModuleProblem) -> dict[str, Any]:
        sets = problem.mesh.node_sets
        return {"node_sets": {**sets, "end": sets["end"][:-1]}}


@variants.by("supports_hold_the_body", "hold 5 of 6 rigid motions")
class Floating(Falsified):
    """Nothing holds z."""

    def changes(self, problem: ModuleProblem) -> dict[str, Any]:
        return {"fixed": {"start": (0,), "end": (0,), "symmetry": (1,)}}


@variants.by("couplings_are_possible", "pairs a node with itself")
class TiedToItself(Falsified):
    """A link of the end section with itself."""

    def changes(self, problem: ModuleProblem) -> dict[str, Any]:
        end = problem.mesh.node_sets["end"]
        return {"links": (Link(end, end, {2: 1.0}),)}


@variants.by("smaller_pieces_are_of_the_same_module", "a forgotten mirror half")
class HalfForgotten(Falsified):
    """For one axis the other half of the width is forgotten."""

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        problem = super().problem(refinement, axes)
        return problem if axes is None else replace(problem, energy_scale=2.0)


@variants.by("refinement_refines", "the argument is not used")
class NeverFiner(Box):
    """Ignores the refinement."""

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        return super().problem(1)


@variants.by("piece_fits_the_module", "more than the module's length")
class WrongScale(Falsified):
    """A piece counted too often."""

    def changes(self, problem: ModuleProblem) -> dict[str, Any]:
        return {"deformation_scale": 4.0}


@variants.by("axes_fit_the_joint", "main axis 'z'")
class WrongAxis(Falsified):
    """Bends about an axis that the joint does not have."""

    def changes(self, problem: ModuleProblem) -> dict[str, Any]:
        return {"main_axis": "z"}


@variants.by("mass_is_that_of_the_mesh", "not that of the meshed body")
class ForgottenMirror(Box):
    """The mass of half the width."""

    def mass(self, density_kg_m3: float) -> ModuleMass:
        return super().mass(density_kg_m3 / 2)


@variants.by("mass_scales_with_density", "mass ignores the density")
class FixedDensity(Box):
    """Always silicone."""

    def mass(self, density_kg_m3: float) -> ModuleMass:
        return super().mass(1000.0)


@variants.by("mass_scales_with_density", "mass is not proportional to the density")
class DeadWeight(Box):
    """A constant mass at the tip, though no part of the module is rigid."""

    def mass(self, density_kg_m3: float) -> ModuleMass:
        good = super().mass(density_kg_m3)
        return replace(good, end=good.end.joined(MassProperties(1e-3, good.end.com_m, 1e-9 * np.eye(3))))


@variants.by("inertia_is_physical", "triangle inequality")
class ThinInertia(Box):
    """Far too much inertia about one axis."""

    def mass(self, density_kg_m3: float) -> ModuleMass:
        good = super().mass(density_kg_m3)
        inertia = good.end.inertia_kg_m2 + np.diag([0.0, 0.0, 3 * np.trace(good.end.inertia_kg_m2)])
        return replace(good, end=replace(good.end, inertia_kg_m2=inertia))


@variants.by("halves_are_in_their_places", "start half's centre of mass")
class SwappedHalves(Box):
    """Start and end exchanged."""

    def mass(self, density_kg_m3: float) -> ModuleMass:
        good = super().mass(density_kg_m3)
        return ModuleMass(good.end, good.start)


@variants.by_config("parameters_have_units", "'gap' is a plain float")
class PlainNumbers(BoxConfig):
    """A gap in whatever unit."""

    gap: float = 1.5e-3


@variants.by("impossible_designs_are_refused", "wall_m = -0.001 m was accepted")
class Trusting(Box):
    """Takes the size of a negative wall."""

    def __init__(self, config: BoxConfig) -> None:
        super().__init__(config.model_copy(update={"wall_m": abs(config.wall_m) or 1e-3}))


@variants.by("accepted_designs_have_meshes", "was accepted, but")
class NeverChecks(Box):
    """Builds anything; thick walls turn the cavity inside out."""

    def __init__(self, config: BoxConfig) -> None:
        ActuatorFamily.__init__(self, config)


@variants.by("is_deterministic", "two meshes of one design differ")
class Jitter(Falsified):
    """Random node positions, a micrometre."""

    def mesh_changes(self, problem: ModuleProblem) -> dict[str, Any]:
        nodes = problem.mesh.nodes_m
        return {"nodes_m": nodes + 1e-9 * np.random.default_rng().standard_normal(nodes.shape)}
