"""A correct family, the box with its cavity off the axis, and invalid bodies."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.errors import InvalidDesignError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.meshing.hexahedra import cell_volumes
from pliant.records.design import MassProperties, ModuleMass
from pliant.records.fem import Link, ModuleProblem
from pliant.records.law import Domain
from pliant.registry.component import Component
from pliant.testing.box import BoxShape, box_problem
from pliant.testing.samples import linear_law
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


class PlainNumbers(BoxConfig):
    """A gap without a unit type."""

    gap: float = 1.5e-3


variants = Variants(Component("family", "small", f"{__name__}:BoxConfig", f"{__name__}:Box", "a box"))
broken = variants.row_adder(Box)
variants.add("parameters_have_units", config=f"{__name__}:PlainNumbers")


def meshed(check: str, change: Callable[[ModuleProblem], dict[str, Any]]) -> None:
    """Add a row: fields of the correct problem's mesh are changed."""
    broken(check, problem=lambda up, self, *a, **k: _remeshed(up(*a, **k), change))


def posed(check: str, **changes: Any) -> None:
    """Add a row: fields of the correct problem are changed."""
    broken(check, problem=lambda up, self, *a, **k: replace(up(*a, **k), **changes))


def weighed(check: str, change: Callable[[ModuleMass], ModuleMass]) -> None:
    """Add a row: the correct mass is changed."""
    broken(check, mass=lambda up, self, density: change(up(density)))


def _remeshed(problem: ModuleProblem, change: Callable[[ModuleProblem], dict[str, Any]]) -> ModuleProblem:
    return replace(problem, mesh=replace(problem.mesh, **change(problem)))


def _cracked(problem: ModuleProblem) -> dict[str, Any]:
    """Return fields of the mesh whose last cell has separate nodes; old nodes that only it used are removed."""
    mesh = problem.mesh
    own = np.arange(27) + len(mesh.nodes_m)
    nodes = np.concatenate([mesh.nodes_m, mesh.nodes_m[mesh.cells[-1]]])
    keep = np.unique(np.concatenate([mesh.cells[:-1].ravel(), own]))
    new = np.zeros(len(nodes), int)
    new[keep] = np.arange(len(keep))
    return {"nodes_m": nodes[keep], "cells": new[np.vstack([mesh.cells[:-1], own])]}


def _short_end(problem: ModuleProblem) -> dict[str, Any]:
    sets = problem.mesh.node_sets
    return {"node_sets": {**sets, "end": sets["end"][:-1]}}


def _tied_to_itself(up: Any, self: Any, *given: Any, **named: Any) -> ModuleProblem:
    end = (problem := up(*given, **named)).mesh.node_sets["end"]
    return replace(problem, links=(Link(end, end, {2: 1.0}),))


def _half_forgotten(up: Any, self: Any, refinement: int = 1, axes: Any = None) -> ModuleProblem:
    problem: ModuleProblem = up(refinement, axes)
    return problem if axes is None else replace(problem, energy_scale=2.0)


def _dead_weight(mass: ModuleMass) -> ModuleMass:
    return replace(mass, end=mass.end.joined(MassProperties(1e-3, mass.end.com_m, 1e-9 * np.eye(3))))


def _thin(mass: ModuleMass) -> ModuleMass:
    inertia = mass.end.inertia_kg_m2 + np.diag([0.0, 0.0, 3 * np.trace(mass.end.inertia_kg_m2)])
    return replace(mass, end=replace(mass.end, inertia_kg_m2=inertia))


def _jittered(problem: ModuleProblem) -> dict[str, Any]:
    nodes = problem.mesh.nodes_m
    return {"nodes_m": nodes + 1e-9 * np.random.default_rng().standard_normal(nodes.shape)}


MIRRORED, TURNED = (np.arange(27).reshape(3, 3, 3)[:, :, ::-1].ravel(), np.arange(9).reshape(3, 3).T.ravel())
meshed("elements_are_valid", lambda p: {"cells": p.mesh.cells[:, MIRRORED]})
meshed("mesh_is_one_closed_body", _cracked)
meshed("cavity_faces_point_into_the_cavity", lambda p: {"cavity": p.mesh.cavity[:, TURNED]})
meshed("cavity_is_closed", lambda p: {"cavity": p.mesh.cavity[:-1]})
meshed("end_sections_are_plane", _short_end)
posed("supports_hold_the_body", fixed={"start": (0,), "end": (0,), "symmetry": (1,)})
broken(
    "closed_form_matches_the_module",
    closed_form=lambda up, self, material: linear_law(domain=Domain.unbounded(1)),
)
broken("couplings_are_possible", problem=_tied_to_itself)
broken("smaller_pieces_share_the_module", problem=_half_forgotten)
broken("refinement_refines", problem=lambda up, self, *a, **k: up(1))
broken("refinement_refines", refines=False)
posed("piece_fits_the_module", deformation_scale=4.0)
posed("axes_fit_the_joint", main_axis="z")
broken("mass_matches_the_mesh", mass=lambda up, self, density: up(density / 2))
broken("mass_scales_with_density", mass=lambda up, self, density: up(1000.0))
weighed("mass_scales_with_density", _dead_weight)
meshed("regions_are_mesh_cells", lambda p: {"regions": {"floor": np.array([0])}})
broken(
    "mass_counts_regions_with_their_density",
    regions=("floor",),
    problem=lambda up, self, *a, **k: _remeshed(up(*a, **k), lambda p: {"regions": {"floor": np.array([0])}}),
    mass=lambda up, self, density, regions=None: up(density),
)
weighed("inertia_is_physical", _thin)
weighed("halves_are_in_their_places", lambda mass: ModuleMass(mass.end, mass.start))
broken(
    "impossible_designs_are_refused",
    __init__=lambda up, self, c: up(c.model_copy(update={"wall_m": abs(c.wall_m) or 1e-3})),
)
broken(
    "accepted_designs_have_meshes", __init__=lambda up, self, config: ActuatorFamily.__init__(self, config)
)
meshed("is_deterministic", _jittered)
