"""A module problem as the model of a deck: 20-node elements, cap, sets, surfaces.

Decks are in mm: CalculiX has absolute thresholds for lengths, which modules fall below in m, and one of 1e-6 for
residual forces, below which it takes them for zero. Hence it is given mm, Pa and µN, people mm, MPa and N.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.by_region import material_solids
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem
from pliant_calculix.cap import Cap, Weights, build_cap, no_cap
from pliant_calculix.elements import HEX20, QUAD8, deck_faces
from pliant_calculix.materials import hyperelastic
from pliant_calculix.plates import STIFFNESS, Plates, build_plates

MM = 1e3  # per m
MPA = 1e-6  # per Pa
CAP_POISSON = 0.3


@dataclass(frozen=True, eq=False)
class Model:
    """The content of a deck before its first step.

    Attributes:
        problem: the module.
        cap: closes the cavity at the end section.
        start_cap: closes it at the start section, or nothing: only reactions there need it.
        element: element type of the body.
        pa: 1 Pa in the deck's unit of stress.
        solids: cells, numbered from 0, and `*HYPERELASTIC` card of the body and of each region.
        cap_law: that of the cap.
        plates: contact plates in the mirror planes, none without contact.
        contact_stiffness: stress per mm of overclosure.
    """

    problem: ModuleProblem
    cap: Cap
    start_cap: Cap
    element: str
    pa: float
    solids: tuple[tuple[IntArray, tuple[str, ...]], ...]
    cap_law: tuple[str, ...]
    plates: Plates
    contact_stiffness: float

    @cached_property
    def cells(self) -> IntArray:
        """(m, 20) node ids of the body's elements, from 0."""
        return self.problem.mesh.cells[:, HEX20]

    @cached_property
    def cavity(self) -> IntArray:
        """(f, 8) node ids of the wetted faces, normals into the cavity."""
        return self.problem.mesh.cavity[:, QUAD8]

    @cached_property
    def cavity_faces(self) -> tuple[IntArray, IntArray]:
        """Element (from 0) and face number of the wetted faces."""
        return deck_faces(self.problem.mesh.cells, self.problem.mesh.cavity)

    @cached_property
    def places_m(self) -> Array:
        """(n, 3) places of all nodes, the mesh's then the caps'; some of the mesh's are in no element."""
        caps = [self.cap.nodes_m, self.start_cap.nodes_m]
        return np.vstack([self.problem.mesh.nodes_m, *caps, self.plates.nodes_m])

    @cached_property
    def wedges(self) -> IntArray:
        """(w, 15) node ids of the caps' elements."""
        return np.vstack([self.cap.wedges, self.start_cap.wedges])

    @cached_property
    def follows(self) -> dict[tuple[int, int], Weights]:
        """Return the couplings of the caps' nodes."""
        return {**self.cap.follows, **self.start_cap.follows}

    @cached_property
    def used(self) -> IntArray:
        """Ids of the nodes that belong to elements."""
        return np.unique(
            np.concatenate([self.cells.ravel(), self.wedges.ravel(), self.plates.bricks.ravel()])
        )

    @cached_property
    def section(self) -> IntArray:
        """Ids of the nodes that stay in the plane of the end section."""
        end = np.intersect1d(self.problem.mesh.node_sets["end"], self.used)
        return np.concatenate([end, self.cap.front, self.plates.face("end")])

    @cached_property
    def node_sets(self) -> dict[str, IntArray]:
        """Nodes in elements, by the family's set; `start` has the front of its cap."""
        sets = dict(self.problem.mesh.node_sets)
        sets["start"] = np.concatenate([sets["start"], self.start_cap.front])
        return {name: np.intersect1d(nodes, self.used) for name, nodes in sets.items()}

    @cached_property
    def fixed(self) -> list[tuple[int, int]]:
        """(node, component) that are held at zero; the end section's plane is not among them."""
        held = {
            (int(node), component)
            for name, components in self.problem.fixed.items()
            for component in components
            if name != "end"
            for node in self.node_sets[name]
        }
        held |= {place for place, weights in self.follows.items() if not weights}
        held |= {(int(node), c) for node in self.plates.bricks.ravel() for c in (1, 2)}
        still = (*self.plates.face("start"), *self.plates.back("start"))
        held |= {(int(node), 0) for node in still}
        return sorted(held)

    @cached_property
    def planes(self) -> dict[float, IntArray]:
        """Nodes that stay in planes parallel to the end section, by their distance behind it in m."""
        behind = np.array([*sorted(self.cap.behind), *self.plates.back("end")], np.int64)
        depth = np.round(self.places_m[behind, 0] - self.problem.span_m, 12)
        return {0.0: self.section, **{float(d): behind[depth == d] for d in np.unique(depth)}}

    @property
    def extra(self) -> int:
        """Number of extra nodes that keep these planes."""
        return 1 + 3 * len(self.planes)

    @property
    def newton(self) -> float:
        """1 N in the deck's unit of force, stress times mm²."""
        return self.pa * MM**2

    @property
    def reference(self) -> int:
        """Id of the first of the extra nodes that no element has: they carry the end section's motion."""
        return len(self.places_m)


def build_model(
    problem: ModuleProblem,
    material: Material,
    element: str,
    cap_stiffness: float,
    pa: float,
    closed_start: bool = False,
    contact: bool = False,
) -> Model:
    """Build the model of a module, its walls limited by the mirror planes with `contact`.

    Raises `UserError` for what this backend does not solve.
    """
    _check(problem)
    nodes = problem.mesh.nodes_m
    cap = build_cap(problem, nodes)
    nodes = np.vstack([nodes, cap.nodes_m])
    start_cap = build_cap(problem, nodes, "start") if closed_start else no_cap()
    shear = cap_stiffness * material.shear_modulus_pa * pa
    bulk = 2 * shear * (1 + CAP_POISSON) / (3 * (1 - 2 * CAP_POISSON))
    cap_law = ("*HYPERELASTIC, NEO HOOKE", f"{shear / 2:.10g}, {2 / bulk:.10g}")
    solids = tuple(
        (cells, tuple(hyperelastic(own, pa))) for cells, own in material_solids(problem.mesh, material)
    )
    plates = build_plates(problem, len(nodes) + len(start_cap.nodes_m), contact)
    stiffness = STIFFNESS * material.shear_modulus_pa * pa
    return Model(problem, cap, start_cap, element, pa, solids, cap_law, plates, stiffness)


def _check(problem: ModuleProblem) -> None:
    """Raise `UserError` with the first reason why a problem cannot be solved here."""
    wanted = ("x",) if problem.joint == "prismatic" else ("y",)
    reasons = {
        f"frame 'rod' only, not '{problem.frame}'": problem.frame != "rod",
        f"modules driven by pressure only, not by '{problem.actuation}'": problem.actuation != "pressure_pa",
        "revolute joints about y and prismatic ones along x only, not axes "
        f"{', '.join(problem.axes)} of a {problem.joint} joint": (
            problem.joint not in ("revolute", "prismatic") or problem.axes != wanted
        ),
        "modules whose line may stretch, not inextensible ones": not problem.stretches,
        "pieces whose start and end sections stay plane (fixed: start and end in component 0)": (
            any(problem.fixed.get(name, ()) != (0,) for name in ("start", "end"))
        ),
        "pieces held by mirror planes and by nodes of the start section only": not _held_plainly(problem),
    }
    for reason, applies in reasons.items():
        if applies:
            raise UserError(f"fem 'calculix' solves {reason}; use fem.kind 'skfem'.")


def _held_plainly(problem: ModuleProblem) -> bool:
    """Return whether the fixed components are the same in the frame of the sections and in space."""
    start = problem.mesh.node_sets["start"]
    return all(
        name == "end" or component == 1 or problem.joint == "prismatic" or np.isin(nodes, start).all()
        for name, components in problem.fixed.items()
        for nodes in [problem.mesh.node_sets[name]]
        for component in components
    )
