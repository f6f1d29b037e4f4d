"""Checks of a `PhysicsBackend` that declares batches (`Capabilities.batch`) or derivatives (`gradients`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pliant.interfaces.physics import Case, PhysicsBackend, Run
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Equilibrium, Inputs, Sensitivity
from pliant.testing.physics_bench import ANGLE_RAD, POSITION_M, bent_chain, pressed, settled_under
from pliant.testing.samples import PRESSURE_PA, linear_law, sample_chain
from pliant.testing.suite import CheckSkipped, Subject, Suite, require, require_close

suite = Suite("physics")
DIFFERENCE = 1e-3
SLOPE_SHARE = 2e-3


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
    engine: PhysicsBackend = subject.build()
    if not engine.capabilities.gradients:
        raise CheckSkipped(f"{subject.component.label} has no gradients")
    with engine.build(chain) as simulation:
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


PARTS = ("joint_angles", "markers_m")


def _loads(inputs: Inputs) -> dict[str, object]:
    return {"tip_force_n": inputs.tip_force_n, "moment_n_m": inputs.moment_n_m}
