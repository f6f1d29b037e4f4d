"""Checks of a `PhysicsBackend` with contacts (`Capabilities.contacts`): free bodies, friction, arms that hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant.interfaces.physics import SceneSimulation
from pliant.records.design import Array
from pliant.records.law import Domain
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant.records.scene import Arm, Contact, Part, Scene, SceneState
from pliant.testing.physics_bench import needs
from pliant.testing.samples import PRESSURE_PA, linear_law
from pliant.testing.scenes import (
    NO_GRAVITY_M_S2,
    OBJECT_KG,
    lopsided_box,
    pinch_scene,
    pinching,
    sample_box,
    sample_finger,
    scene_numbers,
)
from pliant.testing.stand_ins import StandIn, StandInConfig
from pliant.testing.suite import Subject, Suite, require, require_close

suite = Suite("physics")
G = 9.81
CONTROL_S = 0.02
# The bar of every engine: what is held creeps no faster, and settled arms agree with statics.
CREEP_M_S = 1e-4
SETTLED_M = 5e-5
PLACE_M = 1e-9
STILL_RAD_S = 2e-4
LIFT_M_S = np.array([0.0, 0.0, 0.03])


def run(simulation: SceneSimulation, duration_s: float) -> SceneState:
    """Steps of 20 ms, as tasks take them."""
    for _ in range(round(duration_s / CONTROL_S)):
        simulation.step(CONTROL_S)
    return simulation.snapshot()


def force_on(contact: Contact, part: Part) -> Array:
    """(3,) the whole force of a contact on one of its bodies."""
    force: Array = contact.normal_n * contact.normal + contact.friction_n
    return force if contact.second == part else -force


def total_on(contacts: Sequence[Contact], part: Part) -> Array:
    """(3,) the whole force of all contacts on a body."""
    touching = [force_on(c, part) for c in contacts if part in (c.first, c.second)]
    return np.sum(touching, axis=0) if touching else np.zeros(3)


def held(simulation: SceneSimulation) -> None:
    """Pinch the box and lift it off the floor, until nothing swings."""
    simulation.apply(pinching())
    run(simulation, 0.6)
    simulation.carry(LIFT_M_S)
    run(simulation, 0.6)


@suite.check("a built scene is at rest where the `Scene` puts arms and objects, at time 0.")
def starts_where_the_scene_is(subject: Subject) -> None:
    box = lopsided_box(
        position_m=np.array([0.1, -0.2, 0.3]), rotation=np.array([[0.0, -0.6, 0.8], [1, 0, 0], [0, 0.8, 0.6]])
    )
    finger = sample_finger((0.02, 0.01, 0.5))
    with needs(subject, "contacts").build_scene(Scene((Arm(finger),), (box,))) as simulation:
        state = simulation.snapshot()
        require_close(
            state.positions_m, [box.position_m], "position (m) of an object's own frame", atol=PLACE_M
        )
        require_close(state.rotations, [box.rotation], "rotation of an object's own frame", atol=1e-9)
        require_close(state.velocities, np.zeros((1, 6)), "velocity of an object at rest", atol=1e-12)
        require_close(state.coordinates[0], np.zeros((3, 1)), "joint coordinates (rad) at rest", atol=1e-9)
        straight = StandIn(StandInConfig()).build(finger).markers()
        require_close(simulation.markers(0), straight, "markers (m) of the straight arm", atol=1e-7)


@suite.check(
    "a free object falls with the scene's gravity and does not turn, wherever its centre of mass is."
)
def objects_fall(subject: Subject) -> None:
    box = lopsided_box(position_m=np.array([0.0, 0.0, 1.0]))
    with needs(subject, "contacts").build_scene(Scene((), (box,))) as simulation:
        state = run(simulation, 0.2)
    require_close(
        state.velocities[0], [0, 0, -G * 0.2, 0, 0, 0], "velocity after 0.2 s of falling", atol=2e-3
    )
    require_close(state.rotations[0], np.eye(3), "rotation of a falling object", atol=1e-6)
    require_close(
        state.positions_m[0], [0, 0, 1.0 - G * 0.02], "place (m) after 0.2 s of falling", atol=0.03 * G * 0.02
    )


@suite.check("`push` is a wrench at the centre of mass until the next one: it accelerates by F/m and M/I.")
def pushes_accelerate(subject: Subject) -> None:
    force, turning = np.array([0.04, 0.0, -0.02]), np.array([0.0, 3e-6, 0.0])
    scene = Scene((), (lopsided_box(), sample_box(position_m=np.ones(3))), gravity_m_s2=NO_GRAVITY_M_S2)
    inertia = scene.objects[1].mass.inertia_kg_m2[1, 1]
    with needs(subject, "contacts").build_scene(scene) as simulation:
        simulation.push(0, force)
        simulation.push(1, np.zeros(3), turning)
        run(simulation, 0.1)
        simulation.push(0, np.zeros(3))
        simulation.push(1, np.zeros(3))
        velocities = run(simulation, 0.1).velocities
    wanted = [0.1 * force / OBJECT_KG, np.zeros(3), np.zeros(3), 0.1 * turning / inertia]
    require_close(
        velocities,
        np.reshape(wanted, (2, 6)),
        "velocities after pushes of 0.1 s and 0.1 s of coasting: point of attack, unit, or a push that goes on",
        atol=2e-3,
    )


@suite.check("an object rests on the floor; the contact forces carry its weight, within 1 %.")
def rests_on_the_floor(subject: Subject) -> None:
    box = sample_box(position_m=np.array([0.0, 0.0, 0.116]))
    with needs(subject, "contacts").build_scene(Scene((), (box,), floor_m=0.1)) as simulation:
        state = run(simulation, 1.0)
        contacts = simulation.contacts()
    require_close(state.positions_m[0], [0, 0, 0.115], "place (m) of a box on the floor", atol=2e-4)
    require(contacts, "no contact is reported below a box at rest")
    require(
        all({c.first.kind, c.second.kind} == {"object", "floor"} for c in contacts),
        f"the contacts of a box on the floor are between {[(c.first.kind, c.second.kind) for c in contacts]}",
    )
    weight = OBJECT_KG * G
    require_close(
        total_on(contacts, Part("object")),
        [0, 0, weight],
        "force (N) of the floor on a resting box: scale, sign or step of the forces",
        atol=0.01 * weight,
    )
    require_close(
        [c.position_m[2] for c in contacts], [0.1] * len(contacts), "height (m) of contacts", atol=2e-4
    )


@suite.check(
    "friction of a pair is the product of both coefficients: just below it sticks, just above it slides."
)
def friction_is_the_product(subject: Subject) -> None:
    product = 0.8 * 0.5
    engine = needs(subject, "contacts")
    along = np.array([0.8, 0.6, 0.0])
    ways = []
    for share in (0.95, 1.05):
        angle = np.arctan(share * product)
        gravity = G * (np.sin(angle) * along - np.cos(angle) * np.array([0.0, 0.0, 1.0]))
        box = sample_box(half_m=(0.02, 0.02, 0.005), friction=0.8, position_m=np.array([0.0, 0.0, 0.005]))
        scene = Scene((), (box,), floor_m=0.0, floor_friction=0.5, gravity_m_s2=gravity)
        with engine.build_scene(scene) as simulation:
            ways.append(float(run(simulation, 0.6).positions_m[0] @ along))
    free = 0.5 * G * 0.05 * product * 0.6**2
    require(
        ways[0] < 5e-4,
        f"at 95 % of the product of the coefficients a box slides {1e3 * ways[0]:.3g} mm in 0.6 s: too little friction",
    )
    require(
        ways[1] > 0.4 * free,
        f"at 105 % of the product of the coefficients a box slides {1e3 * ways[1]:.3g} mm in 0.6 s instead of "
        f"{1e3 * free:.3g}: too much friction, as if the larger coefficient counted",
    )


@suite.check(
    "an arm alone in a scene comes to rest where statics puts its chain, under every load, within 0.05 mm."
)
def arms_settle_in_equilibrium(subject: Subject) -> None:
    finger = sample_finger(law=linear_law(stiffness=0.04), modules=2, payload=0.004, gravity=(0, 0, 0))
    inputs = Inputs(
        {"pressure_pa": PRESSURE_PA},
        tip_force_n=np.array([0.0, 0.0, -0.1]),
        moment_n_m=-0.002,
        forces=(PointForce(1, np.array([0.005, 0.0, 0.004]), np.array([0.2, 0.0, 0.1])),),
        cords=(Cord(2, np.array([0.005, 0.0, 0.0]), np.array([0.05, 0.0, 0.02]), 0.3),),
    )
    scene = Scene((Arm(finger),))
    statics = StandIn(StandInConfig()).build(finger.with_(gravity_m_s2=scene.gravity_m_s2))
    statics.apply(inputs)
    wanted = statics.settle()
    with needs(subject, "contacts").build_scene(scene) as simulation:
        simulation.apply([inputs])
        for _ in range(20):
            state = run(simulation, 0.2)
            if np.abs(state.rates[0]).max() < STILL_RAD_S:
                break
        require_close(
            simulation.markers(0),
            wanted.markers_m,
            "markers (m) of an arm at rest: gravity of the scene, laws, loads at points, or damping that holds",
            atol=SETTLED_M,
        )
        require_close(state.coordinates[0], wanted.joint_angles, "joint coordinates (rad) at rest", atol=2e-3)


@suite.check("`carry` moves every arm with the carriage by v·t, until the next `carry`.")
def carriage_moves_arms(subject: Subject) -> None:
    velocity = np.array([0.02, -0.01, 0.03])
    arms = (Arm(sample_finger()), Arm(sample_finger((0.1, 0.0, 0.0))))
    with needs(subject, "contacts").build_scene(Scene(arms, gravity_m_s2=NO_GRAVITY_M_S2)) as simulation:
        before = [simulation.markers(k) for k in range(2)]
        simulation.carry(velocity)
        run(simulation, 0.2)
        simulation.carry(np.zeros(3))
        state = run(simulation, 0.4)
        require_close(state.carriage_m, 0.2 * velocity, "carriage_m after 0.2 s and a stop", atol=1e-7)
        for k in range(2):
            moved = simulation.markers(k) - before[k]
            require_close(moved[0], 0.2 * velocity, f"way (m) of the base of arm {k}", atol=1e-6)
            require_close(moved, np.tile(0.2 * velocity, (5, 1)), f"way (m) of arm {k}", atol=SETTLED_M)


@suite.check(
    "contacts name the arm first; normals point to the second body, forces act on it and carry the weight."
)
def contacts_have_signs(subject: Subject) -> None:
    scene = pinch_scene()
    with needs(subject, "contacts").build_scene(scene) as simulation:
        held(simulation)
        contacts, state = simulation.contacts(), simulation.snapshot()
    touching = [c for c in contacts if "arm" in (c.first.kind, c.second.kind)]
    require(touching, "two fingers that hold a box report no contact with it")
    require(
        all(c.first.kind == "arm" and c.second == Part("object") for c in touching),
        f"a contact of arm and object is reported as {touching[0].first.kind}, {touching[0].second.kind}",
    )
    require(
        {c.first.number for c in touching} == {0, 1} and all(1 <= c.first.body <= 3 for c in touching),
        f"fingers 0 and 1 touch with bodies 1 to 3; reported were {sorted({c.first for c in touching})}",
    )
    for contact in touching:
        towards = 1.0 if contact.first.number == 0 else -1.0
        require(
            contact.normal_n >= 0.0 and contact.normal[0] * towards > 0.5,
            f"finger {contact.first.number} presses by {contact.normal_n:.3g} N along {contact.normal}: "
            "the normal points from first to second",
        )
        require_close(np.linalg.norm(contact.normal), 1.0, "length of a normal", atol=1e-6)
        require_close(contact.friction_n @ contact.normal, 0.0, "friction (N) along the normal", atol=1e-4)
        require(
            np.abs(contact.position_m - state.positions_m[0]).max() < 0.022,
            f"a contact at {contact.position_m} is not at the box",
        )
    weight = OBJECT_KG * G
    require_close(
        total_on(contacts, Part("object")),
        [0, 0, weight],
        "force (N) of two fingers on what they hold still: friction's sign or scale",
        atol=0.05 * weight,
    )


@suite.check("what two fingers hold rises with the carriage and creeps by at most 0.1 mm/s.")
def held_objects_do_not_creep(subject: Subject) -> None:
    with needs(subject, "contacts").build_scene(pinch_scene()) as simulation:
        held(simulation)
        first = simulation.snapshot()
        last = run(simulation, 0.6)
    risen = float(last.positions_m[0, 2] - first.positions_m[0, 2])
    carried = float(last.carriage_m[2] - first.carriage_m[2])
    require(
        risen > 0.5 * carried,
        f"the box rose {1e3 * risen:.3g} mm while the carriage rose {1e3 * carried:.3g}",
    )
    creep = abs(risen - carried) / (last.time_s - first.time_s)
    require(
        creep <= CREEP_M_S,
        f"a held box creeps by {1e3 * creep:.3g} mm/s: friction is regularised too softly, or does not feel the "
        "carriage's velocity",
    )


@suite.check(
    "`restore` brings a scene in contact back exactly, and the same steps then give the same motion."
)
def restores_a_scene(subject: Subject) -> None:
    with needs(subject, "contacts").build_scene(pinch_scene()) as simulation:
        held(simulation)
        kept = simulation.snapshot()
        numbers = _numbers(kept).copy()
        once = _numbers(run(simulation, 0.2))
        require(
            np.abs(once - numbers).max() > 1e-3, "the carriage moves, and the snapshot after it is the same"
        )
        require(
            np.array_equal(_numbers(kept), numbers), "the snapshot changed while the scene went on: copy it"
        )
        simulation.restore(kept)
        require_close(_numbers(simulation.snapshot()), numbers, "state after restore", atol=1e-12)
        again = _numbers(run(simulation, 0.2))
    require_close(again, once, "state 0.2 s after restore: caches of contacts or internal steps", atol=1e-9)


def _numbers(state: SceneState) -> Array:
    parts: list[Array] = [np.array(state.time_s), state.carriage_m, *state.coordinates, *state.rates]
    parts += [state.positions_m, state.rotations, state.velocities]
    return np.concatenate([np.ravel(part) for part in parts])


@suite.check(
    "where laws of a scene are used outside their domain: joints are numbered through all arms in a row."
)
def scenes_report_extrapolation(subject: Subject) -> None:
    wide, narrow = Domain.unbounded(1), Domain(np.array([0.0, 1e4]), np.array([[-2.0, 2.0]]))
    arms = tuple(
        Arm(sample_finger((x, 0.0, 0.0), linear_law(stiffness=0.2, domain=box)))
        for x, box in ((0.0, wide), (0.1, narrow))
    )
    with needs(subject, "contacts").build_scene(Scene(arms)) as simulation:
        simulation.apply(pinching(9e3))
        simulation.step(CONTROL_S)
        require(not simulation.outside_domain(), "a state inside the domains is reported")
        simulation.apply(pinching(12e3))
        simulation.step(CONTROL_S)
        found = simulation.outside_domain()
    require(
        {o.module for o in found} == {4, 5, 6},
        f"joints 4, 5, 6 of two arms of 3 leave their domain; reported were {sorted({o.module for o in found})}",
    )
    require_close([o.excess for o in found], [2e3] * len(found), "the excess (Pa) reported", rtol=1e-6)


@suite.check("two scenes of one engine do not know of each other; `close` twice is harmless.")
def scenes_are_independent(subject: Subject) -> None:
    engine = needs(subject, "contacts")
    box = sample_box(position_m=np.array([0.0, 0.0, 0.5]))
    first, other = engine.build_scene(Scene((), (box,))), engine.build_scene(pinch_scene())
    other.apply(pinching())
    other.carry(LIFT_M_S)
    for _ in range(5):
        first.step(CONTROL_S)
        other.step(CONTROL_S)
    other.close()
    state = run(first, 0.1)
    first.close()
    first.close()
    require_close(
        state.velocities[0],
        [0, 0, -G * 0.2, 0, 0, 0],
        "velocity of an object beside another scene",
        atol=2e-3,
    )


@suite.check("the scene is the caller's: it is not changed.")
def leaves_the_scene_alone(subject: Subject) -> None:
    scene = pinch_scene()
    before = scene_numbers(scene)
    with needs(subject, "contacts").build_scene(scene) as simulation:
        simulation.apply(pinching())
        run(simulation, 0.1)
    require(np.array_equal(before, scene_numbers(scene)), "an array of the scene was changed in place")
