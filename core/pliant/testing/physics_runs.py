"""Checks of a `PhysicsBackend` that follows histories (`Capabilities.internal_states`), settles batches (`batch`) or
derives (`gradients`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pliant.interfaces.physics import Case, PhysicsBackend, Run, Variation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Equilibrium, Inputs, Sensitivity
from pliant.records.term import LawTerm
from pliant.testing.physics_bench import (
    ANGLE_RAD,
    NO_GRAVITY,
    POSITION_M,
    bent_chain,
    needs,
    pressed,
    settled_under,
)
from pliant.testing.samples import PRESSURE_PA, linear_law, sample_chain
from pliant.testing.suite import Subject, Suite, require, require_close, require_refused

suite = Suite("physics")
DIFFERENCE = 1e-3
SLOPE_SHARE = 2e-3
PARTS = ("joint_angles", "markers_m")
GAIN, STIFFNESS = 8e-7, 0.04
RETARDATION_S, STEP_S = 0.5, 0.01


def dashpot(
    angle: float,
    rate: float,
    dt_s: float,
    actuation: float,
    temperature_c: float,
    old: Array,
    new: Array,
    c: Array,
) -> float:
    """M = −c u'."""
    return -c[0] * rate


def softening(
    angle: float,
    rate: float,
    dt_s: float,
    actuation: float,
    temperature_c: float,
    old: Array,
    new: Array,
    c: Array,
) -> float:
    """A joint that is softer once it has been bent."""
    new[0] = max(old[0], angle)
    return 1.0 - c[0] * old[0]


def sweep(specimen: str = "A") -> History:
    """Up and down without a clock, under a small side load."""
    levels = PRESSURE_PA * np.array([0.2, 0.6, 1.0, 0.5])
    return History.of({"pressure_pa": levels}, specimen=specimen, tip_force_n=[0.004, 0.006, 0.0])


def damaged() -> ChainModel:
    """Joints that remember their largest angle for good."""
    term = LawTerm("elastic", softening, (0.5,), n_states=1, keeps=True, needs_time=True)
    return sample_chain(modules=2).with_(terms=(term,))


@suite.check("`follow` without times gives, sample by sample, what `settle` gives under the same inputs.")
def follows_settled_states(subject: Subject) -> None:
    engine, chain, history = needs(subject, "internal_states"), bent_chain(payload=0.004), sweep()
    (path,), _ = engine.follow(chain, [history])
    require(np.all(path.converged), "a plain chain with a small load did not converge")
    with engine.build(chain) as simulation:
        for k in range(len(history)):
            simulation.apply(history.at(k))
            require_close(
                path.joint_angles[k],
                simulation.settle().joint_angles,
                f"joint angles (rad) of sample {k + 1} without a clock",
                atol=ANGLE_RAD / 10,
            )


@suite.check("time passes in `follow`: a dashpot lets a joint creep as U (1 − exp(−t/T)) after a step.")
def follows_time(subject: Subject) -> None:
    term = LawTerm("moment", dashpot, (RETARDATION_S * STIFFNESS,), needs_time=True)
    chain = sample_chain(linear_law(GAIN, STIFFNESS), modules=1, gravity=NO_GRAVITY).with_(terms=(term,))
    time_s: Array = STEP_S * np.arange(101, dtype=float)
    history = History.of({"pressure_pa": np.where(time_s > 0, PRESSURE_PA, 0.0)}, time_s)
    (path,), _ = needs(subject, "internal_states").follow(chain, [history])
    end = GAIN * PRESSURE_PA / STIFFNESS
    require_close(
        path.joint_angles[:, 0, 0],
        end * (1.0 - np.exp(-time_s / RETARDATION_S)),
        "u (rad) of a damped joint after a step of the pressure: rates, or durations of steps",
        atol=0.02 * end,
    )


@suite.check("damage goes on in the later runs of its specimen, and in no other.")
def keeps_damage_in_its_specimen(subject: Subject) -> None:
    runs = [sweep("A"), sweep("B"), sweep("A")]
    (first, other, again), _ = needs(subject, "internal_states").follow(damaged(), runs)
    require_close(
        other.joint_angles,
        first.joint_angles,
        "joint angles (rad) of a virgin specimen after another",
        atol=1e-9,
    )
    require(
        np.abs(again.joint_angles - first.joint_angles).max() > 10 * ANGLE_RAD,
        "the second run of a damaged specimen is that of a virgin one: `keeps` is ignored",
    )


@suite.check("`towards` gives the change of every path to first order, damage of earlier runs included.")
def differentiates(subject: Subject) -> None:
    engine, chain, step = needs(subject, "internal_states"), damaged(), 1e-4

    def pressed_by(factor: float) -> tuple[History, ...]:
        runs = (sweep("A"), sweep("A"))
        return tuple(h.with_actuation(pressure_pa=factor * h.actuation["pressure_pa"]) for h in runs)

    _, (change,) = engine.follow(chain, pressed_by(1.0), [Variation(chain, pressed_by(1.0 + step))])
    up, _ = engine.follow(chain, pressed_by(1.01))
    down, _ = engine.follow(chain, pressed_by(0.99))
    for number, (got, a, b) in enumerate(zip(change, up, down, strict=True), start=1):
        wanted = (a.joint_angles - b.joint_angles) / 0.02
        require_close(
            got.joint_angles / step,
            wanted,
            f"d joint angles (rad) / d pressure factor in run {number}",
            rtol=0.01,
        )


@suite.check("`follow` refuses a history without an input of the chain; the message names run and input.")
def names_missing_inputs_of_runs(subject: Subject) -> None:
    lost = History.of({"tendon_force_n": np.ones(3)}, run="lost")
    engine = needs(subject, "internal_states")
    require_refused(
        lambda: engine.follow(sample_chain(modules=1), [lost]),
        "a run without a pressure was followed",
        r"(?s)(?=.*lost).*pressure_pa",
        "run and input",
    )


@suite.check(
    "`settle_batch` gives, case by case and in order, what `settle` gives; chains may differ in length."
)
def batches_settle_as_one_by_one(subject: Subject) -> None:
    chains = (sample_chain(modules=3), bent_chain(payload=0.004), sample_chain(linear_law(), modules=5))
    cases = [Case(chain, pressed(share * PRESSURE_PA)) for share in (0.4, 1.0) for chain in chains]
    found = subject.build().settle_batch(cases)
    require(len(found) == len(cases), f"{len(cases)} cases gave {len(found)} equilibria")
    for number, (case, got) in enumerate(zip(cases, found, strict=True), start=1):
        alone = settled_under(subject, case.chain, case.inputs)
        require(got.converged == alone.converged, f"case {number} converges in one way only")
        require_close(
            got.joint_angles,
            alone.joint_angles,
            f"joint angles (rad) of case {number} of a batch",
            atol=ANGLE_RAD,
        )
        require_close(
            got.markers_m, alone.markers_m, f"markers (m) of case {number} of a batch", atol=POSITION_M
        )


@suite.check(
    "`rollout_batch` goes through each history from rest, as `apply` and `step` do sample by sample."
)
def batches_roll_as_one_by_one(subject: Subject) -> None:
    time_s: Array = 0.02 * np.arange(4, dtype=float)
    rising = History.of({"pressure_pa": PRESSURE_PA * np.array([0.0, 0.3, 0.6, 1.0])}, time_s)
    falling = History.of({"pressure_pa": PRESSURE_PA * np.array([1.0, 0.5, 0.2, 0.0])}, time_s)
    chain = sample_chain(modules=2)
    engine: PhysicsBackend = subject.build()
    found = engine.rollout_batch([Run(chain, rising), Run(chain, falling)])
    require(len(found) == 2, f"2 runs gave {len(found)} rollouts")
    for got, history in zip(found, (rising, falling), strict=True):
        require_close(got.time_s, time_s, "time_s of a rollout", atol=1e-12)
        with engine.build(chain) as simulation:
            for k in range(len(history)):
                simulation.apply(history.at(k))
                simulation.step(0.02 if k else 0.0)
                require_close(
                    got.markers_m[k],
                    simulation.markers(),
                    f"markers (m) of sample {k + 1} of a rollout",
                    atol=POSITION_M,
                )


def derived(subject: Subject, chain: ChainModel, inputs: Inputs) -> Sensitivity:
    """Derivatives at an equilibrium, or `CheckSkipped` where the engine has none."""
    with needs(subject, "gradients").build(chain) as simulation:
        simulation.apply(inputs)
        simulation.settle()
        return simulation.sensitivity()


@suite.check(
    "`sensitivity` is the derivative of the settled answer with respect to inputs, loads and masses."
)
def sensitivities_are_differences(subject: Subject) -> None:
    chain = bent_chain(payload=0.004)
    inputs = pressed(tip_force_n=np.array([0.01, 0.02, 0.0]), moment_n_m=0.001)
    slopes = derived(subject, chain, inputs)
    x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])

    def moved(make: Callable[[float], tuple[ChainModel, Inputs]], by: float) -> tuple[Array, Array]:
        ends: list[Equilibrium] = [settled_under(subject, *make(sign * by)) for sign in (1.0, -1.0)]
        return tuple((getattr(ends[0], of) - getattr(ends[1], of)) / (2 * by) for of in PARTS)

    pushed = inputs.tip_force_n
    for name, column, scale, make in (
        ("pressure_pa", (), PRESSURE_PA, lambda d: (chain, pressed(PRESSURE_PA + d, **_loads(inputs)))),
        ("tip_force_n", (0,), 0.02, lambda d: (chain, replace(inputs, tip_force_n=pushed + d * x))),
        ("moment_n_m", (), 0.01, lambda d: (chain, replace(inputs, moment_n_m=inputs.moment_n_m + d))),
        ("payload_kg", (), 0.004, lambda d: (chain.with_(payload_kg=0.004 + d), inputs)),
        (
            "gravity_m_s2",
            (2,),
            9.81,
            lambda d: (chain.with_(gravity_m_s2=chain.gravity_m_s2 + d * z), inputs),
        ),
    ):
        require(name in slopes.joint_angles, f"no derivative with respect to {name} is given")
        for part, wanted in zip(PARTS, moved(make, DIFFERENCE * scale), strict=True):
            got = getattr(slopes, part)[name][(..., *column)]
            require_close(got, wanted, f"d {part} / d {name} against a central difference", rtol=SLOPE_SHARE)


def _loads(inputs: Inputs) -> dict[str, object]:
    return {"tip_force_n": inputs.tip_force_n, "moment_n_m": inputs.moment_n_m}
