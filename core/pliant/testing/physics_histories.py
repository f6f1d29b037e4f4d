"""Checks of a `PhysicsBackend` that follows histories (`Capabilities.internal_states`)."""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend, Variation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.term import LawTerm
from pliant.testing.physics_bench import ANGLE_RAD, NO_GRAVITY, bent_chain
from pliant.testing.samples import PRESSURE_PA, linear_law, sample_chain
from pliant.testing.suite import CheckSkipped, Subject, Suite, require, require_close

suite = Suite("physics")
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


def follower(subject: Subject) -> PhysicsBackend:
    """The engine, or `CheckSkipped` where it has no histories."""
    engine: PhysicsBackend = subject.build()
    if not engine.capabilities.internal_states:
        raise CheckSkipped(f"{subject.component.label} follows no histories")
    return engine


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
    engine, chain, history = follower(subject), bent_chain(payload=0.004), sweep()
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
    (path,), _ = follower(subject).follow(chain, [history])
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
    (first, other, again), _ = follower(subject).follow(damaged(), runs)
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
    engine, chain, step = follower(subject), damaged(), 1e-4

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
    engine = follower(subject)
    try:
        engine.follow(sample_chain(modules=1), [lost])
    except UserError as error:
        require("lost" in str(error) and "pressure_pa" in str(error), f"the message is: {error}")
        return
    require(False, "a run without a pressure was followed")
