"""Checks of a `PhysicsBackend`: conventions, honesty and the life of a simulation.

Statics is in `physics_loads`, scenes with contact in `physics_scene`, what engines may declare beside in
`physics_runs`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from pliant.interfaces.physics import Capabilities, PhysicsBackend, Simulation
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.law import Domain
from pliant.records.rollout import Inputs
from pliant.testing.physics_bench import (
    NO_GRAVITY,
    POSITION_M,
    bent_chain,
    chain_numbers,
    needs,
    pressed,
    settled_under,
)
from pliant.testing.physics_loads import suite as loads
from pliant.testing.physics_runs import suite as runs
from pliant.testing.physics_scene import suite as scenes
from pliant.testing.samples import (
    MODULE_LENGTH_M,
    linear_law,
    sample_chain,
)
from pliant.testing.suite import Subject, Suite, require, require_close, require_refused

suite = Suite("physics")
for other in (loads, runs, scenes):
    suite.checks.extend(other.checks)
KINDS = ("revolute", "spherical", "prismatic")


@suite.check("`capabilities` says which joints the engine has, before it is built.", declares=True)
def declares_its_capabilities(subject: Subject) -> None:
    given = type(subject.build()).capabilities
    require(isinstance(given, Capabilities), f"capabilities is {given!r}")
    require(
        given.joints and set(given.joints) <= set(KINDS), f"joints {given.joints} are not some of {KINDS}"
    )


@suite.check(
    "a built simulation is at rest: straight along the base's x axis, markers base, joints 1…n, tip."
)
def starts_straight(subject: Subject) -> None:
    chain = sample_chain(modules=4)
    with subject.build().build(chain) as simulation:
        markers = simulation.markers()
        length = MODULE_LENGTH_M
        depth = length * np.array([0.0, 0.5, 1.5, 2.5, 3.5, 4.0])
        wanted = np.stack([0 * depth, 0 * depth, -depth], axis=1)
        require_close(
            markers, wanted, "markers (m) of the straight chain: default base, order or unit", atol=POSITION_M
        )
        require_close(
            simulation.snapshot().position, np.zeros((4, 1)), "joint coordinates (rad) at rest", atol=1e-9
        )


@suite.check("without loads an equilibrium is the straight chain.")
def stays_at_rest_without_loads(subject: Subject) -> None:
    chain = sample_chain(modules=4, gravity=NO_GRAVITY)
    settled = settled_under(subject, chain, pressed(0.0))
    require_close(settled.joint_angles, np.zeros((4, 1)), "joint angles (rad) without any load", atol=1e-6)


@suite.check(
    "markers are where the joint angles say: rest frames turned between segments, rotations about y."
)
def markers_follow_the_kinematics(subject: Subject) -> None:
    chain = bent_chain()
    with subject.build().build(chain) as simulation:
        simulation.apply(pressed())
        settled = simulation.settle()
        wanted = ChainGeometry.of(chain).markers(settled.joint_angles)
        require_close(
            settled.markers_m, wanted, "markers_m (m) do not belong to joint_angles", atol=POSITION_M
        )
        require_close(
            simulation.markers(),
            settled.markers_m,
            "markers() differs from the settled markers_m",
            atol=POSITION_M,
        )


@suite.check("an input without a value raises `UserError` that names it.")
def refuses_missing_inputs(subject: Subject) -> None:
    with subject.build().build(sample_chain(modules=2)) as simulation:

        def driven_by_a_tendon() -> None:
            simulation.apply(Inputs({"tendon_force_n": 1.0}))
            simulation.settle()

        require_refused(
            driven_by_a_tendon,
            "a chain driven by pressure_pa settled without a value for it",
            "pressure_pa",
            "missing input",
        )


@suite.check("where a law is used outside its domain is reported: joint from 1, variable, excess.")
def reports_extrapolation(subject: Subject) -> None:
    box = Domain(np.array([0.0, 1e4]), np.array([[-1.0, 1.0]]))
    chain = sample_chain(linear_law(domain=box), modules=3, gravity=NO_GRAVITY)
    inside = settled_under(subject, chain, pressed(9e3))
    require(not inside.outside_domain, f"a state inside the domain is reported: {inside.outside_domain}")
    outside = [
        o for o in settled_under(subject, chain, pressed(12e3)).outside_domain if o.variable == "pressure_pa"
    ]
    require(
        {o.module for o in outside} == {1, 2, 3},
        "joints 1, 2, 3 are used 2 kPa above their domain; reported were "
        f"{sorted({o.module for o in outside})}",
    )
    require_close([o.excess for o in outside], [2e3] * len(outside), "the excess (Pa) reported", rtol=1e-6)


@suite.check("`restore` brings a snapshot back exactly.")
def restores_a_snapshot(subject: Subject) -> None:
    with subject.build().build(bent_chain()) as simulation:
        simulation.apply(pressed())
        simulation.settle()
        kept = simulation.snapshot()
        markers = simulation.markers()
        position, velocity = kept.position.copy(), kept.velocity.copy()
        simulation.apply(pressed(0.0))
        simulation.settle()
        moved = simulation.markers()
        require(np.abs(moved - markers).max() > 1e-3, "the chain does not move when the pressure is released")
        require(
            np.array_equal(kept.position, position),
            "the snapshot changed while the simulation went on: copy it",
        )
        simulation.restore(kept)
        again = simulation.snapshot()
        require_close(again.position, position, "joint coordinates after restore", atol=1e-12)
        require_close(again.velocity, velocity, "joint rates after restore", atol=1e-12)
        require_close(again.time_s, kept.time_s, "time (s) after restore", atol=1e-12)
        require_close(simulation.markers(), markers, "markers (m) after restore", atol=1e-9)


@suite.check("`step` advances time by the duration that was asked for, toward the equilibrium.")
def steps_forward_in_time(subject: Subject) -> None:
    with subject.build().build(sample_chain(modules=2)) as simulation:
        start = simulation.snapshot().time_s
        simulation.apply(pressed())
        simulation.step(0.05)
        simulation.step(0.013)
        require_close(
            simulation.snapshot().time_s - start,
            0.063,
            "time (s) passed in two steps of 0.05 s and 0.013 s: round up the last internal step",
            atol=2e-3,
        )
        position = simulation.snapshot().position
        require(np.all(np.isfinite(position)), "joint coordinates are not finite after 0.063 s")
        require(position.sum() > 1e-4, "the chain does not move under pressure")


@suite.check(
    "`dynamic` says whether `step` advances inertia; in other engines each step ends in equilibrium."
)
def dynamic_is_what_it_says(subject: Subject) -> None:
    engine: PhysicsBackend = subject.build()
    # Some grams at the tip: no joint with inertia goes a third of its way within two milliseconds.
    chain = sample_chain(modules=4, gravity=NO_GRAVITY, payload=0.05)
    with engine.build(chain) as simulation:
        start = simulation.markers()[-1]
        simulation.apply(pressed())
        simulation.step(0.002)
        moved = float(np.linalg.norm(simulation.markers()[-1] - start))
    whole = float(np.linalg.norm(settled_under(subject, chain, pressed()).tip_m - start))
    if engine.capabilities.dynamic:
        require(
            moved < 0.5 * whole,
            f"capabilities.dynamic is True, and 2 ms after a step of pressure a tip with 50 g has gone "
            f"{moved:.3g} m of {whole:.3g} m: no inertia holds it back",
        )
    else:
        require_close(
            moved,
            whole,
            "capabilities.dynamic is False, and the way (m) of the tip after a step is not that to its equilibrium",
            atol=20 * POSITION_M,
        )


@suite.check("two simulations of one engine do not know of each other.")
def simulations_are_independent(subject: Subject) -> None:
    backend: PhysicsBackend = subject.build()
    chain, other = sample_chain(modules=3), sample_chain(modules=5)
    with backend.build(chain) as first:
        first.apply(pressed())
        alone = first.settle().markers_m
        with backend.build(other) as second:
            second.apply(pressed(5e3))
            second.settle()
            require_close(
                first.markers(),
                alone,
                "markers (m) moved when another simulation ran: shared state",
                atol=1e-12,
            )
            require_close(
                first.settle().markers_m,
                alone,
                "settled markers (m) changed beside another one",
                atol=POSITION_M,
            )
        require_close(first.markers(), alone, "markers (m) changed when another one closed", atol=POSITION_M)


@suite.check("`close` frees the engine, twice is harmless, and a new simulation may follow.")
def closes_cleanly(subject: Subject) -> None:
    backend: PhysicsBackend = subject.build()
    simulation: Simulation = backend.build(sample_chain(modules=2))
    simulation.close()
    simulation.close()
    for _ in range(3):
        with backend.build(sample_chain(modules=2)) as again:
            require(np.all(np.isfinite(again.markers())), "markers after an earlier simulation was closed")


@suite.check("the chain is the caller's: it is not changed.")
def leaves_the_chain_alone(subject: Subject) -> None:
    chain = bent_chain(payload=0.004)
    before = chain_numbers(chain)
    settled_under(subject, chain, pressed())
    require(np.array_equal(before, chain_numbers(chain)), "an array of the chain was changed in place")


@suite.check(
    "`export` writes the file that it was asked for and names it first; engines without a format declare none."
)
def exports_a_file(subject: Subject) -> None:
    engine = needs(subject, "export")
    chain = bent_chain(payload=0.004)
    before = chain_numbers(chain)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"chain.{engine.capabilities.export}"
        written = engine.export(chain, path)
        require(
            bool(written) and written[0] == path, f"the files that it names are {written}, not {path} first"
        )
        absent = [str(file) for file in written if not file.is_file() or not file.stat().st_size]
        require(not absent, f"it names files that are missing or empty: {', '.join(absent)}")
        require(
            all(file.is_relative_to(path.parent) for file in written),
            "files are written elsewhere than beside it",
        )
    require(np.array_equal(before, chain_numbers(chain)), "an array of the chain was changed in place")
