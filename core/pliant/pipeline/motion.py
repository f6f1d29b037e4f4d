"""Motion of a finished simulation for viewers: surfaces as shapes, frames at equidistant times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.config.chain import RigidConfig
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.physics import MountBackend, PhysicsBackend
from pliant.interfaces.simulation import Simulation
from pliant.interfaces.task import SceneTask, Task
from pliant.interfaces.viewer import Handle
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import exp_map, log_map
from pliant.pipeline.chain import Module, RigidPiece, Segment, build_chain, module_like, rigid_rod, rod_module
from pliant.pipeline.engine_checks import check_capabilities, check_terms, no_mount
from pliant.pipeline.segments import DesignStages, chain_segments
from pliant.pipeline.study import StudyRun, build_study_chain, study_physics
from pliant.pipeline.visual import seen_surface
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.motion import Motion
from pliant.records.mount import Carrier
from pliant.records.rollout import Inputs, Rollout
from pliant.records.scene import Arm, FreeBody, Scene, SceneFrames
from pliant.records.shape import HalfShapes, Shape, TriangleMesh

# Radius of a module without one, relative to its length.
SEEN_RADIUS = 0.2


def run_motion(context: RunContext, run: StudyRun) -> Motion:
    """Return the motion of the study's first engine: frames of a scene, a chain's history, or its settled pose.

    Raises:
        UserError: the engine did not run.
    """
    result = run.engines[0].result if run.engines else None
    if result is None:
        raise UserError("nothing was simulated, so there is nothing to draw: the study needs a 'task' block.")
    task: Task | SceneTask = context.build("task", run.study.need("task", "a picture"))
    looks = drawn_chain(context, run)
    if isinstance(task, SceneTask):
        if result.frames is None or run.chain is None:
            raise UserError(f"task '{task.config.kind}' recorded no frames to draw.")
        # Scenes are laid out by collision shapes.
        return Motion(with_surfaces(task.scene(task.prepare(run.chain)), looks), result.frames)
    rollout: Rollout | None = result.rollout
    times, angles = (np.zeros(1), result.final.joint_angles[None])
    if rollout is not None:
        times, angles = rollout.time_s, rollout.joint_angles
    carrier = result.final.carrier if rollout is None else rollout.carrier
    scene, frames = chain_scene(task.prepare(looks)), chain_frames(times, angles)
    if carrier is None or looks.mount is None:
        return Motion(scene, frames)
    if rollout is None:
        carrier = Carrier.stacked([carrier])
        assert carrier is not None
    backend: PhysicsBackend = context.build("physics", study_physics(context, run.study))
    if not isinstance(backend, MountBackend):
        raise UserError(no_mount(backend.config.kind))
    return Motion(*on_arm(scene, frames, backend.mount_shapes(looks.mount), carrier))


def drawn_chain(context: RunContext, run: StudyRun) -> ChainModel:
    """Return the study's chain with its families' surfaces as shapes."""
    study = run.study
    config = study.need("chain", "a picture")
    segments = chain_segments(context, study, run.designs)
    designs = [run.designs[number] for number in run.segment_designs]
    worn = [_dressed(context, one, design) for one, design in zip(segments, designs, strict=True)]
    module = next(one.piece for one in worn if isinstance(one.piece, Module))
    dressed = []
    for written, segment in zip(config.as_segments(), worn, strict=True):
        module = segment.piece if isinstance(segment.piece, Module) else module
        dressed.append(replace(segment, piece=_rigid_look(written.rigid, segment.piece, module)))
    return build_chain(config, dressed)


def surface_at_rest(chain: ChainModel) -> TriangleMesh:
    """Return all surfaces of a straight chain in the world frame, without collision primitives.

    Raises:
        UserError: the chain has no surfaces.
    """
    straight = ChainGeometry.from_chain(chain).forward(np.zeros((chain.n_joints, len(chain.axes))))
    parts = [
        shape.mesh.placed(shape.rotation, shape.position_m).placed(straight.rotations[k], straight.origins[k])
        for k, shapes in enumerate(chain.shapes)
        for shape in shapes
        if shape.mesh is not None
    ]
    if not parts:
        raise UserError("the chain's modules have no surface: an STL needs a 'family' block.")
    whole = parts[0]
    for part in parts[1:]:
        whole = whole.joined(part)
    return whole


def with_surfaces(scene: Scene, looks: ChainModel) -> Scene:
    """Return the scene with the shapes of another chain on its arms, beside their own rigid ones."""

    def dressed(chain: ChainModel) -> ChainModel:
        rigid = [tuple(s for s in shapes if s.rigid and s.mesh is None) for shapes in chain.shapes]
        pairs = zip(looks.shapes, rigid or [()] * len(looks.shapes), strict=True)
        return chain.with_(shapes=tuple(seen + own for seen, own in pairs))

    return replace(scene, arms=tuple(replace(arm, chain=dressed(arm.chain)) for arm in scene.arms))


def chain_scene(chain: ChainModel) -> Scene:
    """Return the scene of one chain without objects."""
    return Scene((Arm(chain),), gravity_m_s2=np.asarray(chain.gravity_m_s2, float))


def chain_frames(time_s: Array, coordinates: Array) -> SceneFrames:
    """Return the frames of a chain alone: times (t,), joint coordinates (t, n, a)."""
    steps = len(time_s)
    none = np.zeros((steps, 0, 3)), np.zeros((steps, 0, 3, 3))
    return SceneFrames(np.asarray(time_s, float), np.zeros((steps, 3)), (coordinates,), *none)


def on_arm(
    scene: Scene, frames: SceneFrames, shapes: Sequence[tuple[Shape, ...]], carrier: Carrier
) -> tuple[Scene, SceneFrames]:
    """Return a chain's scene and frames with the arm that carries it; `carrier` has the frames' times."""
    seen = [k for k, one in enumerate(shapes) if one]
    objects = tuple(FreeBody.seen(f"body {k}", shapes[k]) for k in seen)
    placed = replace(
        frames,
        carriage_m=carrier.position_m,
        carriage_turns=carrier.rotation,
        positions_m=carrier.bodies_m[:, seen],
        rotations=carrier.body_rotations[:, seen],
    )
    return replace(scene, objects=objects, carriers=len(objects)), placed


def at_times(frames: SceneFrames, time_s: Array) -> SceneFrames:
    """Return the frames at other times, with linear interpolation of positions and rotations."""
    last = len(frames.time_s) - 1
    if last == 0:
        return sampled(frames, np.zeros(len(time_s), int))
    right = np.clip(np.searchsorted(frames.time_s, time_s, side="right"), 1, last)
    left = right - 1
    gap = np.maximum(frames.time_s[right] - frames.time_s[left], 1e-12)
    share = np.clip((time_s - frames.time_s[left]) / gap, 0.0, 1.0)

    def between(values: Array) -> Array:
        part = share.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((1.0 - part) * values[left] + part * values[right])

    turns = frames.rotations[left]
    if turns.size:
        turn = log_map(np.swapaxes(turns, -1, -2) @ frames.rotations[right])
        turns = turns @ exp_map(share[:, None, None] * turn)
    coordinates = tuple(between(q) for q in frames.coordinates)
    places = between(frames.carriage_m), coordinates, between(frames.positions_m)
    carried = frames.carriage_turns
    if carried is not None:
        turn = log_map(np.swapaxes(carried[left], -1, -2) @ carried[right])
        carried = carried[left] @ exp_map(share[:, None] * turn)
    return SceneFrames(np.asarray(time_s, float), *places, turns, carried)


def sampled(frames: SceneFrames, index: Sequence[int] | Array) -> SceneFrames:
    """Return a selection of the frames."""
    return SceneFrames(
        frames.time_s[index],
        frames.carriage_m[index],
        tuple(q[index] for q in frames.coordinates),
        frames.positions_m[index],
        frames.rotations[index],
        None if frames.carriage_turns is None else frames.carriage_turns[index],
    )


def _dressed(context: RunContext, segment: Segment, design: DesignStages) -> Segment:
    """Return the segment with its visible surfaces."""
    piece = segment.piece
    if not isinstance(piece, Module):
        return segment
    if design.family is None:
        if not (piece.shapes.start or piece.shapes.end):  # no radius is stated: a visible rod
            rod = rod_module(piece.law, piece.length_m, 0.0, SEEN_RADIUS * piece.length_m, piece.offset_m)
            return replace(segment, piece=replace(piece, shapes=rod.shapes))
        return segment
    family: ActuatorFamily = context.build("family", design.family)
    surface = seen_surface(family)

    def meshes(soft: TriangleMesh, rigid: TriangleMesh | None) -> tuple[Shape, ...]:
        shape = Shape("mesh", (), np.zeros(3), np.eye(3), soft)
        return (shape,) if rigid is None else (shape, replace(shape, mesh=rigid, rigid=True))

    shapes = HalfShapes(meshes(surface.start, surface.rigid_start), meshes(surface.end, surface.rigid_end))
    return replace(segment, piece=replace(piece, shapes=shapes))


def _rigid_look(config: RigidConfig | None, piece: Module | RigidPiece, like: Module) -> Module | RigidPiece:
    """Return a rigid piece with its visible shape: a module's surface for its section, a stub without a radius."""
    if config is None or isinstance(piece, Module):
        return piece
    look = piece
    if config.section == "module":
        look = module_like(like, piece.length_m)
    elif not piece.shapes:
        look = rigid_rod(piece.length_m, 0.0, 0.5 * piece.length_m)
    return replace(piece, shapes=look.shapes)


DRIVES = ("pressure_pa", "tendon_force_n")


class ChainHandle(Handle):
    """Handle on a chain's inputs from 0 to their highest values; loads are the task's."""

    def __init__(self, simulation: Simulation, highest: float) -> None:
        self.simulation = simulation
        names = dict.fromkeys(actuator.input for actuator in simulation.chain.actuators)
        self._limits = dict.fromkeys(names, (0.0, highest))
        self._time_s = 0.0

    @property
    def inputs(self) -> Mapping[str, tuple[float, float]]:
        return self._limits

    def advance(self, values: Mapping[str, float], duration_s: float) -> SceneFrames:
        held = {name: float(np.clip(values[name], *limits)) for name, limits in self._limits.items()}
        self.simulation.apply(Inputs(held))
        self.simulation.step(duration_s)
        self._time_s += duration_s
        return chain_frames(np.array([self._time_s]), self.simulation.snapshot().position[None])


def prepared_chain(context: RunContext, study: Study) -> tuple[ChainModel, PhysicsBackend, Any]:
    """Return the study's chain with its task's loads and its effects, its engine, and its task or None.

    Raises:
        UserError: the engine cannot simulate it, or effects act on the input.
    """
    model, backend, task = prepared_model(context, study)
    if model.inputs:
        raise UserError("effects on the input are not followed here: leave them out of 'effects'.")
    return model.chain, backend, task


def prepared_model(context: RunContext, study: Study) -> tuple[Model, PhysicsBackend, Any]:
    """Return the same as `prepared_chain` with the effects' maps of inputs and readings.

    Raises:
        UserError: the engine cannot simulate it.
    """
    chain = build_study_chain(context, study).chain
    physics = study_physics(context, study)
    backend: PhysicsBackend = context.build("physics", physics)
    check_capabilities(backend, chain, physics.kind)
    task = context.build("task", study.task) if study.task is not None else None
    model = Model(chain if task is None else task.prepare(chain))
    for effect in study.effects:
        model = context.build("effect", effect).apply(model)
    check_terms(backend, model.chain)
    return model, backend, task


def highest_actuation(study: Study, chain: ChainModel) -> float:
    """Return the task's pressure or tendon force, else the highest value in the domain of all laws.

    Raises:
        UserError: the highest actuation is not known.
    """
    stated = [getattr(study.task, name, None) for name in DRIVES]
    for value in (*stated, min(law.domain.actuation[1] for law in chain.laws)):
        if value is not None and np.isfinite(value) and value > 0:
            return float(value)
    raise UserError(
        "the range of the actuation is not stated: give the study a task with a pressure, or its law a 'domain'."
    )
