"""Checks of a `PhysicsBackend` with contacts (`SceneBackend`): free bodies, friction, grasping arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.interfaces.physics import SceneBackend
from pliant.interfaces.simulation import SceneSimulation
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.design import Array
from pliant.records.law import Domain
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant.records.scene import Arm, Contact, FreeBody, Obstacle, Part, Scene, SceneState
from pliant.records.shape import Shape
from pliant.testing import Subject, agree, once, require
from pliant.testing.physics import capable
from pliant.testing.samples import (
    NO_GRAVITY_M_S2,
    OBJECT_KG,
    PRESSURE_PA,
    linear_law,
    lopsided_box,
    pinch_scene,
    pinching,
    sample_box,
    sample_finger,
    scene_numbers,
)
from pliant.testing.stand_ins import StandInSimulation

G = 9.81
WEIGHT_N = np.array([0.0, 0.0, OBJECT_KG * G])
CONTROL_S = 0.02
# Tolerances of every engine: creep of held objects, and difference of settled arms from statics.
CREEP_M_S = 1e-4
SETTLED_M = 5e-5
PLACE_M = 1e-9
STILL_RAD_S = 2e-4
HELD_S = 0.4
LIFT_M_S = np.array([0.0, 0.0, 0.03])


def _scene(
    subject: Subject, arms: Sequence[Arm] = (), objects: Sequence[FreeBody] = (), **more: object
) -> SceneSimulation:
    """Return a new simulation in an engine with contacts."""
    return capable(subject, SceneBackend).build_scene(Scene(tuple(arms), tuple(objects), **more))  # type: ignore[arg-type]


def _run(simulation: SceneSimulation, duration_s: float) -> SceneState:
    """Advance by steps of 20 ms, as tasks do; return the state."""
    for _ in range(round(duration_s / CONTROL_S)):
        simulation.step(CONTROL_S)
    return simulation.snapshot()


@dataclass(frozen=True, eq=False)
class Pinched:
    """A box that two fingers hold and lift: its contacts, the state, that `HELD_S` later, and both after `restore`."""

    contacts: Sequence[Contact]
    first: SceneState
    numbers: Array
    """Contacts of `first` at its time."""
    last: SceneState
    restored: SceneState
    last_again: SceneState


@once
def _pinched(subject: Subject) -> Pinched:
    """Pinch the box and lift it off the floor until nothing swings, then hold it."""
    with capable(subject, SceneBackend).build_scene(pinch_scene()) as simulation:
        simulation.apply(pinching())
        _run(simulation, 0.6)
        simulation.carry(LIFT_M_S)
        first = _run(simulation, 0.6)
        contacts, numbers, last = simulation.contacts(), _numbers(first), _run(simulation, HELD_S)
        simulation.restore(first)
        return Pinched(contacts, first, numbers, last, simulation.snapshot(), _run(simulation, HELD_S))


def _numbers(state: SceneState) -> Array:
    parts = [np.array(state.time_s), state.carriage_m, *state.coordinates, *state.rates]
    parts += [state.positions_m, state.rotations, state.velocities]
    return np.concatenate([np.ravel(part) for part in parts])


def _force_on_objects(contacts: Sequence[Contact]) -> Array:
    """Return (3,) the total force of all contacts on the first object."""
    part, total = Part("object"), np.zeros(3)
    for c in contacts:
        if part in (c.first, c.second):
            total += (1.0 if c.second == part else -1.0) * (c.normal_n * c.normal + c.friction_n)
    return total


def starts_where_the_scene_is(subject: Subject) -> None:
    """a built scene is at rest where the `Scene` puts arms and objects, at time 0."""
    turn = np.array([[0.0, -0.6, 0.8], [1, 0, 0], [0, 0.8, 0.6]])
    box, finger = (
        lopsided_box(position_m=np.array([0.1, -0.2, 0.3]), rotation=turn),
        sample_finger((0.02, 0.01, 0.5)),
    )
    with _scene(subject, [Arm(finger)], [box]) as simulation:
        state, markers = simulation.snapshot(), simulation.markers(0)
    agree(state.positions_m, [box.position_m], "position (m) of an object's own frame", atol=PLACE_M)
    agree(state.rotations, [box.rotation], "rotation of an object's own frame", atol=1e-9)
    agree(state.velocities, np.zeros((1, 6)), "velocity of an object at rest", atol=1e-12)
    agree(state.coordinates[0], np.zeros((3, 1)), "joint coordinates (rad) at rest", atol=1e-9)
    agree(markers, StandInSimulation(finger).markers(), "markers (m) of the straight arm", atol=1e-7)


def objects_fall(subject: Subject) -> None:
    """a free object falls with the scene's gravity and does not rotate, wherever its centre of mass is."""
    with _scene(subject, [], [lopsided_box(position_m=np.array([0.0, 0.0, 1.0]))]) as simulation:
        state = _run(simulation, 0.2)
    agree(state.velocities[0], [0, 0, -G * 0.2, 0, 0, 0], "velocity after 0.2 s of falling", atol=2e-3)
    agree(state.rotations[0], np.eye(3), "rotation of a falling object", atol=1e-6)
    fallen = G * 0.02
    agree(state.positions_m[0], [0, 0, 1.0 - fallen], "place (m) after 0.2 s of falling", atol=0.03 * fallen)


def pushes_accelerate(subject: Subject) -> None:
    """`push` is a wrench at the centre of mass until the next one: it accelerates by F/m and M/I."""
    force, turning = np.array([0.04, 0.0, -0.02]), np.array([0.0, 3e-6, 0.0])
    boxes = lopsided_box(), sample_box(position_m=np.ones(3))
    with _scene(subject, [], boxes, gravity_m_s2=NO_GRAVITY_M_S2) as simulation:
        simulation.push(0, force)
        simulation.push(1, np.zeros(3), turning)
        _run(simulation, 0.1)
        simulation.push(0, np.zeros(3))
        simulation.push(1, np.zeros(3))
        velocities = _run(simulation, 0.1).velocities
    spin = 0.1 * turning / boxes[1].mass.inertia_kg_m2[1, 1]
    wanted = np.reshape([0.1 * force / OBJECT_KG, np.zeros(3), np.zeros(3), spin], (2, 6))
    cause = "point of attack, unit, or a push that goes on"
    agree(velocities, wanted, f"velocities after pushes of 0.1 s and 0.1 s of coasting: {cause}", atol=2e-3)


def rests_on_the_floor(subject: Subject) -> None:
    """an object rests on the floor; the contact forces carry its weight, within 1 %."""
    box = sample_box(position_m=np.array([0.0, 0.0, 0.116]))
    with _scene(subject, [], [box], floor_m=0.1) as simulation:
        state = _run(simulation, 1.0)
        contacts = simulation.contacts()
    agree(state.positions_m[0], [0, 0, 0.115], "place (m) of a box on the floor", atol=2e-4)
    require(contacts, "no contact is reported below a box at rest")
    pairs = [{c.first.kind, c.second.kind} for c in contacts]
    require(
        all(pair == {"object", "floor"} for pair in pairs),
        f"the contacts of a box on the floor are between {pairs}",
    )
    finding = "force (N) of the floor on a resting box: scale, sign or step of the forces"
    agree(_force_on_objects(contacts), WEIGHT_N, finding, rtol=0.01)
    agree([c.position_m[2] for c in contacts], 0.1, "height (m) of contacts", atol=2e-4)


def friction_is_the_product(subject: Subject) -> None:
    """friction of a pair is the product of both coefficients: just below it sticks, just above it slides."""
    product, along = 0.8 * 0.5, np.array([0.8, 0.6, 0.0])
    box = sample_box(half_m=(0.02, 0.02, 0.005), friction=0.8, position_m=np.array([0.0, 0.0, 0.005]))
    ways = []
    for share in (0.95, 1.05):
        angle = np.arctan(share * product)
        gravity = G * (np.sin(angle) * along - np.cos(angle) * np.array([0.0, 0.0, 1.0]))
        with _scene(subject, [], [box], floor_m=0.0, floor_friction=0.5, gravity_m_s2=gravity) as simulation:
            ways.append(1e3 * float(_run(simulation, 0.6).positions_m[0] @ along))
    free = 1e3 * 0.5 * G * 0.05 * product * 0.6**2
    slides = "% of the product of the coefficients a box slides"
    require(ways[0] < 0.5, f"at 95 {slides} {ways[0]:.3g} mm in 0.6 s: too little friction")
    cause = "too much friction, as if the larger coefficient counted"
    require(ways[1] > 0.4 * free, f"at 105 {slides} {ways[1]:.3g} mm in 0.6 s instead of {free:.3g}: {cause}")


def arms_settle_in_equilibrium(subject: Subject) -> None:
    """a single arm in a scene settles at the pose of the chain's statics, under every load, within 0.05 mm."""
    finger = sample_finger(law=linear_law(stiffness=0.04), modules=2, payload=0.004, gravity=(0, 0, 0))
    inputs = Inputs(
        {"pressure_pa": PRESSURE_PA},
        tip_force_n=np.array([0.0, 0.0, -0.1]),
        moment_n_m=-0.002,
        forces=(PointForce(1, np.array([0.005, 0.0, 0.004]), np.array([0.2, 0.0, 0.1])),),
        cords=(Cord(2, np.array([0.005, 0.0, 0.0]), np.array([0.05, 0.0, 0.02]), 0.3),),
    )
    statics = StandInSimulation(finger.with_(gravity_m_s2=Scene((Arm(finger),)).gravity_m_s2))
    statics.apply(inputs)
    wanted = statics.settle()
    with _scene(subject, [Arm(finger)]) as simulation:
        simulation.apply([inputs])
        for _ in range(20):
            state = _run(simulation, 0.2)
            if np.abs(state.rates[0]).max() < STILL_RAD_S:
                break
        markers = simulation.markers(0)
    cause = "gravity of the scene, laws, loads at points, or damping that holds"
    agree(markers, wanted.markers_m, f"markers (m) of an arm at rest: {cause}", atol=SETTLED_M)
    agree(state.coordinates[0], wanted.joint_angles, "joint coordinates (rad) at rest", atol=2e-3)


def obstacles_hold_arms(subject: Subject) -> None:
    """a fixed obstacle stops an arm; the reported forces hold the arm where it stands, by the chain's statics."""
    finger = sample_finger(modules=2)
    wall = Shape("box", (0.01, 0.02, 0.05), np.array([0.017, 0.0, -0.03]), np.eye(3))
    inputs = Inputs({"pressure_pa": PRESSURE_PA})
    obstacles = (Obstacle("wall", (wall,)),)
    with _scene(subject, [Arm(finger)], obstacles=obstacles, gravity_m_s2=NO_GRAVITY_M_S2) as simulation:
        simulation.apply([inputs])
        for _ in range(20):
            state = _run(simulation, 0.2)
            if np.abs(state.rates[0]).max() < STILL_RAD_S:
                break
        contacts, markers = simulation.contacts(), simulation.markers(0)
    require(contacts, "an arm that is bent into a wall reports no contact")
    pose = ChainGeometry.from_chain(finger).forward(state.coordinates[0])
    forces = []
    for contact in contacts:
        named = contact.first.kind == "arm" and contact.second == Part("obstacle")
        require(named, f"a contact of arm and obstacle is reported as {contact.first}, {contact.second}")
        require(contact.normal[0] > 0.5, f"the normal of an arm and the wall beside it is {contact.normal}")
        body = contact.first.body
        local = pose.rotations[body].T @ (contact.position_m - pose.origins[body])
        forces.append(PointForce(body, local, -contact.normal_n * contact.normal - contact.friction_n))
    statics = StandInSimulation(finger.with_(gravity_m_s2=np.array(NO_GRAVITY_M_S2)))
    statics.apply(Inputs(inputs.actuation, forces=tuple(forces)))
    cause = "an arm passes through an obstacle, or contacts have other forces than those that act"
    agree(
        markers, statics.settle().markers_m, f"markers (m) of an arm at a wall: {cause}", atol=2 * SETTLED_M
    )


def carriage_moves_arms(subject: Subject) -> None:
    """`carry` moves every arm with the carriage by v·t, until the next `carry`."""
    velocity = np.array([0.02, -0.01, 0.03])
    arms = Arm(sample_finger()), Arm(sample_finger((0.1, 0.0, 0.0)))
    with _scene(subject, arms, gravity_m_s2=NO_GRAVITY_M_S2) as simulation:
        before = [simulation.markers(k) for k in range(2)]
        simulation.carry(velocity)
        _run(simulation, 0.2)
        simulation.carry(np.zeros(3))
        state = _run(simulation, 0.4)
        moved = [simulation.markers(k) - before[k] for k in range(2)]
    agree(state.carriage_m, 0.2 * velocity, "carriage_m after 0.2 s and a stop", atol=1e-7)
    for k, way in enumerate(moved):
        agree(way[0], 0.2 * velocity, f"way (m) of the base of arm {k}", atol=1e-6)
        agree(way, np.tile(0.2 * velocity, (5, 1)), f"way (m) of arm {k}", atol=SETTLED_M)


def contacts_have_signs(subject: Subject) -> None:
    """contacts name the arm first; normals point to the second body, forces act on it and carry the weight."""
    contacts, state = _pinched(subject).contacts, _pinched(subject).first
    touching = [c for c in contacts if "arm" in (c.first.kind, c.second.kind)]
    require(touching, "two fingers that hold a box report no contact with it")
    named = all(c.first.kind == "arm" and c.second == Part("object") for c in touching)
    as_what = f"{touching[0].first.kind}, {touching[0].second.kind}"
    require(named, f"a contact of arm and object is reported as {as_what}")
    parts = {c.first for c in touching}
    own = {part.number for part in parts} == {0, 1} and all(1 <= part.body <= 3 for part in parts)
    require(own, f"fingers 0 and 1 touch with bodies 1 to 3; reported were {sorted(parts)}")
    for contact in touching:
        number, normal = contact.first.number, contact.normal
        presses = f"finger {number} presses by {contact.normal_n:.3g} N along {normal}"
        towards = contact.normal_n >= 0.0 and normal[0] * (1.0, -1.0)[number] > 0.5
        require(towards, f"{presses}: the normal points from first to second")
        agree(np.linalg.norm(normal), 1.0, "length of a normal", atol=1e-6)
        agree(contact.friction_n @ normal, 0.0, "friction (N) along the normal", atol=1e-4)
        near = np.abs(contact.position_m - state.positions_m[0]).max() < 0.022
        require(near, f"a contact at {contact.position_m} is not at the box")
    finding = "force (N) of two fingers on what they hold still: friction's sign or scale"
    agree(_force_on_objects(contacts), WEIGHT_N, finding, rtol=0.05)


def held_objects_do_not_creep(subject: Subject) -> None:
    """an object held by two fingers rises with the carriage and creeps by at most 0.1 mm/s."""
    first, last = _pinched(subject).first, _pinched(subject).last
    risen = 1e3 * float(last.positions_m[0, 2] - first.positions_m[0, 2])
    carried = 1e3 * float(last.carriage_m[2] - first.carriage_m[2])
    rose = f"the box rose {risen:.3g} mm while the carriage rose {carried:.3g}"
    require(risen > 0.5 * carried, rose)
    creep = abs(risen - carried) / (last.time_s - first.time_s)
    cause = "friction is regularised too softly, or does not feel the carriage's velocity"
    require(creep <= 1e3 * CREEP_M_S, f"a held box creeps by {creep:.3g} mm/s: {cause}")


def restores_a_scene(subject: Subject) -> None:
    """`restore` reproduces a scene in contact exactly, and the same steps then give the same motion."""
    held = _pinched(subject)
    first, last = _numbers(held.first), _numbers(held.last)
    moved = np.abs(last - held.numbers).max() > 1e-3
    require(moved, "the carriage moves, and the snapshot after it is the same")
    same = np.array_equal(first, held.numbers)
    require(same, "the snapshot changed while the scene went on: copy it")
    agree(_numbers(held.restored), first, "state after restore", atol=1e-12)
    finding = f"state {HELD_S:g} s after restore: caches of contacts or internal steps"
    agree(_numbers(held.last_again), last, finding, atol=1e-9)


def scenes_report_extrapolation(subject: Subject) -> None:
    """use of a scene's laws outside their domain is reported; joints are numbered across all arms."""
    boxes = Domain.unbounded(1), Domain(np.array([0.0, 1e4]), np.array([[-2.0, 2.0]]))
    laws = [linear_law(stiffness=0.2, domain=box) for box in boxes]
    with _scene(
        subject, [Arm(sample_finger((0.1 * k, 0.0, 0.0), law)) for k, law in enumerate(laws)]
    ) as simulation:
        found = []
        for pressure_pa in (9e3, 12e3):
            simulation.apply(pinching(pressure_pa))
            simulation.step(CONTROL_S)
            found.append(simulation.outside_domain())
    require(not found[0], "a state inside the domains is reported")
    modules = sorted({o.module for o in found[1]})
    require(
        modules == [4, 5, 6], f"joints 4, 5, 6 of two arms of 3 leave their domain; reported were {modules}"
    )
    agree([o.excess for o in found[1]], 2e3, "the excess (Pa) reported", rtol=1e-6)


def scenes_are_independent(subject: Subject) -> None:
    """two scenes of one engine are independent; `close` twice is harmless."""
    first = _scene(subject, [], [sample_box(position_m=np.array([0.0, 0.0, 0.5]))])
    other = capable(subject, SceneBackend).build_scene(pinch_scene())
    other.apply(pinching())
    other.carry(LIFT_M_S)
    for _ in range(5):
        first.step(CONTROL_S)
        other.step(CONTROL_S)
    other.close()
    state = _run(first, 0.1)
    first.close()
    first.close()
    finding = "velocity of an object beside another scene"
    agree(state.velocities[0], [0, 0, -G * 0.2, 0, 0, 0], finding, atol=2e-3)


def leaves_the_scene_alone(subject: Subject) -> None:
    """the scene belongs to the caller and is not changed."""
    scene = pinch_scene()
    before = scene_numbers(scene)
    with capable(subject, SceneBackend).build_scene(scene) as simulation:
        simulation.apply(pinching())
        _run(simulation, 0.1)
    require(np.array_equal(before, scene_numbers(scene)), "an array of the scene was changed in place")
