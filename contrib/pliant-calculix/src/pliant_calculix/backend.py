"""The backend: `Calculix` makes a `CalculixSolver` for each module."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend, Held, ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import Branch, FemState, ModuleProblem
from pliant_calculix.config import CalculixConfig
from pliant_calculix.deck import Target, model_cards, path_cards, plane_cards
from pliant_calculix.model import MM, build_model
from pliant_calculix.program import Answer, Answers, RunFailedError, find, run
from pliant_calculix.reading import Reader

OVERLAP = 1e-4  # of the span: material this far beyond a mirror plane is self-contact
# Steps of the central differences that give slopes: of the piece's θ or strain, and of p / shear modulus.
HELD_STEP, PRESSURE_STEP = 2e-3, 2e-3
SMALLER = 0.05
OGDEN_TOLERANCE = 1e-3


class CalculixSolver(ModuleSolver):
    """States of one module, each by a run of `ccx` from rest.

    A state's `solution` are the displacements (m) of the mesh's nodes, flat. The start of a state is not used.
    """

    def __init__(self, config: CalculixConfig, problem: ModuleProblem, material: Material) -> None:
        self.config, self.problem = config, problem
        self.model = build_model(problem, material, config.element, config.cap_stiffness, pa=1.0)
        self.reader = Reader(self.model, material)
        self.revolute = problem.joint == "revolute"
        # near equal stretches CalculiX' Ogden law is too rough for less
        kinds = {own.resolved.config.kind for own in (material, *material.regions.values())}
        rough = OGDEN_TOLERANCE if "ogden" in kinds else 0.0
        self._tolerance = max(config.tolerance, rough)
        self._head = [
            *model_cards(self.model, ["A module of a soft robot, by Pliant"]),
            *plane_cards(self.model),
        ]
        self._pressure_step = PRESSURE_STEP * material.shear_modulus_pa
        self._held_step = HELD_STEP * (1.0 if self.revolute else problem.span_m)
        self._cavity_at_rest = self.reader.cavity_m3(np.zeros_like(self.model.places_m))
        find(config.program)

    def rest(self) -> FemState:
        """Return the undeformed state; its slopes are those of small loads."""
        begun = time.perf_counter()
        return self._state(Target(0.0, 0.0), "free", begun, None, 0)

    def free(self, actuation: float, start: FemState) -> FemState:
        """Solve for equilibrium at pressure `actuation` (Pa) without external moment, in one run for u and one for
        slopes.
        """
        begun = time.perf_counter()
        self._check(start)
        answers = self._run([Target(actuation, None)], "free")
        motion = answers.points[0].displacement[self.model.reference :, 0]
        span = MM * self.problem.span_m
        held = float(np.arctan(motion[3] / span)) if self.revolute else float(motion[0]) / MM
        return self._solve(Target(actuation, held), "free", begun, answers.iterations)

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        """Solve for equilibrium at pressure `actuation` (Pa) with fixed u. Raises `UserError` for an unknown axis."""
        begun = time.perf_counter()
        self._check(start)
        if isinstance(held, Mapping):
            if set(held) != set(self.problem.axes):
                raise UserError(
                    f"fem 'calculix' holds the axis {self.problem.main_axis} of this module, not "
                    f"{', '.join(held) or 'none'}."
                )
            held = held[self.problem.main_axis]
        return self._solve(Target(actuation, held / self.problem.deformation_scale), "constrained", begun, 0)

    def deformed_nodes(self, state: FemState) -> Array:
        """Return (n, 3) node positions in m; the start section stays in its plane."""
        nodes = self.problem.mesh.nodes_m
        places: Array = nodes + state.solution.reshape(nodes.shape)
        return places

    def _check(self, start: FemState) -> None:
        wanted = self.problem.mesh.nodes_m.size
        if start.solution.size != wanted:
            raise UserError(
                f"the start state has {start.solution.size} unknowns, this module {wanted}: "
                "it belongs to another mesh."
            )

    def _solve(self, target: Target, branch: Branch, begun: float, iterations: int) -> FemState:
        return self._state(target, branch, begun, target, iterations)

    def _state(
        self, at: Target, branch: Branch, begun: float, solved: Target | None, iterations: int
    ) -> FemState:
        """Return the state at a target with slopes by central differences; at rest no solution is needed first."""
        targets = ([] if solved is None else [solved]) + self._around(at)
        answers = self._run(targets, branch)
        efforts = [self._effort(a, t) for a, t in zip(answers.points, targets, strict=True)]
        here = answers.points[0] if solved is not None else _nothing(answers.points[0])
        more, less, pressed, relieved = efforts[-4:]
        dp, dh = self._steps(at)
        moved = self.reader.displacement_m(here, at)
        mesh_part = self._on_plane(moved, here, at)
        angle, energy = self.problem.deformation_scale, self.problem.energy_scale
        return FemState(
            actuation=at.pressure_pa,
            deformation=np.array([angle * (at.held or 0.0)]),
            tau=np.array([energy / angle * (efforts[0] if solved is not None else 0.0)]),
            dtau_dp=np.array([energy / angle * (pressed - relieved) / (2 * dp)]),
            dtau_du=np.array([[energy / angle**2 * (more - less) / (2 * dh)]]),
            energy_j=energy * self.reader.strain_energy(moved),
            travel=energy * (self.reader.cavity_m3(moved) - self._cavity_at_rest),
            axial_strain=self._strain(here, at),
            branch=branch,
            status="self_contact" if self._overlaps(mesh_part, at) else "ok",
            iterations=iterations + answers.iterations,
            wall_s=time.perf_counter() - begun,
            held=() if branch == "free" else (self.problem.main_axis,),
            solution=mesh_part.ravel(),
        )

    def _steps(self, at: Target) -> tuple[float, float]:
        """Return steps of pressure (Pa) and coordinate; small at rest, where rounding is no problem."""
        small = SMALLER if at == Target(0.0, 0.0) else 1.0
        return small * self._pressure_step, small * self._held_step

    def _around(self, at: Target) -> list[Target]:
        """Return targets with slightly higher and lower coordinate and pressure."""
        p, h = at.pressure_pa, at.held or 0.0
        dp, dh = self._steps(at)
        return [Target(p, h + dh), Target(p, h - dh), Target(p + dp, h), Target(p - dp, h)]

    def _run(self, targets: Sequence[Target], branch: Branch) -> Answers:
        """Solve the targets one after another in one run. Raises `StateNotConvergedError`."""
        deck = [*self._head, *path_cards(self.model, targets, self._tolerance)]
        nodes = self.model.reference + self.model.extra
        try:
            return run(
                self.config.program, deck, len(targets), nodes, self.config.timeout_s, self.config.keep
            )
        except RunFailedError as error:
            held = targets[0].held
            where = "" if held is None else f", {self.problem.deformation_scale * held:.4g} held"
            raise StateNotConvergedError(
                f"no {branch} equilibrium at {targets[0].pressure_pa:.6g} Pa{where}: {error}."
            ) from error

    def _effort(self, answer: Answer, target: Target) -> float:
        """Return the piece's τ, which opposes the actuation."""
        theta = (target.held or 0.0) if self.revolute else 0.0
        reaction = self.reader.reaction(answer, target.pressure_pa, theta)
        return -(reaction.moment_n_m if self.revolute else reaction.force_n)

    def _on_plane(self, moved: Array, answer: Answer, at: Target) -> Array:
        """Return displacements (n, 3) of the mesh's nodes, the end section exactly on its plane.

        The program prints seven digits; prescribed values are restored exactly.
        """
        mesh = self.problem.mesh
        moved = moved[: len(mesh.nodes_m)].copy()
        end = mesh.node_sets["end"]
        theta = (at.held or 0.0) if self.revolute else 0.0
        along = self._reference_motion_m(answer, at)
        height = mesh.nodes_m[end, 2] + moved[end, 2] - self.problem.reference_z_m
        moved[end, 0] = along + height * np.tan(theta) + self.problem.span_m - mesh.nodes_m[end, 0]
        moved[mesh.node_sets["start"], 0] = 0.0
        return moved

    def _reference_motion_m(self, answer: Answer, at: Target) -> float:
        """Return the displacement along the reference line of its intersection with the end plane."""
        if not self.revolute:
            return at.held or 0.0
        return float(answer.displacement[self.model.reference, 0]) / MM

    def _strain(self, answer: Answer, at: Target) -> float:
        """Return e of an arc perpendicular to both end planes."""
        along = self._reference_motion_m(answer, at)
        if not self.revolute:
            return along / self.problem.span_m
        theta = at.held or 0.0
        return float(np.cos(theta) * (1 + along / self.problem.span_m) / np.sinc(theta / np.pi)) - 1

    def _overlaps(self, moved: Array, at: Target) -> bool:
        """Return whether skin nodes crossed a mirror plane that neighbouring convolutions share."""
        mesh, span = self.problem.mesh, self.problem.span_m
        theta = (at.held or 0.0) if self.revolute else 0.0
        normal = np.array([np.cos(theta), 0.0, -np.sin(theta)])
        places = mesh.nodes_m + moved
        heights = places[np.unique(mesh.skin)] @ normal
        beyond = {
            "start": -float(places[np.unique(mesh.skin), 0].min()),
            "end": float(heights.max() - (places[mesh.node_sets["end"][0]] @ normal)),
        }
        return any(beyond[plane] > OVERLAP * span for plane in self.problem.contact_planes)


def _nothing(like: Answer) -> Answer:
    return Answer(np.zeros_like(like.displacement), np.zeros_like(like.force))


class Calculix(FEMBackend):
    """CalculiX: modules under pressure that bend about y or extend along x."""

    config: CalculixConfig
    knows = frozenset({"regions"})

    def solver(self, problem: ModuleProblem, material: Material) -> CalculixSolver:
        """Return solver. Raises `UserError` for another problem or material, `MissingDependencyError` without ccx."""
        self.check(problem, material)
        return CalculixSolver(self.config, problem, material)
