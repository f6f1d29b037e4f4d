"""Common parts of the checks of effects: a model, parameter values, and observations at each place of an effect."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from pliant.errors import ContractError
from pliant.interfaces.effect import Effect, EffectConfig, EffectParameter, Model, Readings
from pliant.interfaces.physics import HistoryBackend, PhysicsBackend
from pliant.mechanics.kinematics import ChainGeometry, base_rotations, trajectory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.registry.discovery import discover
from pliant.testing import CheckSkipped, Subject, once
from pliant.testing.histories import HeldMotion, drive, first_joint, triangles
from pliant.testing.samples import PRESSURE_PA, chain_numbers, sample_chain, softening_law

PRESSURES = np.array([0.0, 2e3, 5e3, 9e3, 15e3])
ANGLES = np.array([-0.2, 0.05, 0.2, 0.36, 0.5])
MODULES = 3
STEP_S = 0.25
WARM_C = 35.0
PAYLOAD_KG = 0.003
# Offset of the probe's tendon forces, and the share of the first input that drives the others.
PAID_OUT_N, SECOND = 3e3, 0.4


def sample_model(subject: Subject, modules: int = MODULES, **chain: Any) -> Model:
    """Return three modules that carry a payload, driven by the input that the effect under test needs.

    A law has no units: the tendon force in newtons equals the pressure in pascals. If one input does not suit the
    effect, three drive the chain, the second one against the others.
    """
    effect, law, chain = subject.build(), softening_law(), chain or {"payload": PAYLOAD_KG}
    law = replace(law, actuation_name=type(effect).actuation or law.actuation_name)
    name, unit = law.actuation_name.rsplit("_", 1)
    three = [{"input": f"{name}_{k}_{unit}", "sign": -1 if k == 2 else 1} for k in (1, 2, 3)]
    alone = Model(sample_chain(law, modules=modules, **chain))
    several = Model(sample_chain(law, modules=modules, **{**chain, "actuators": three}))
    fails, suits = (
        effect.unsuited(one.chain, [probe_run(inputs=model_inputs(one))]) for one in (alone, several)
    )
    return several if fails and not suits else alone


def model_inputs(model: Model) -> tuple[str, ...]:
    """Return the names of the model's inputs."""
    return tuple(actuator.input for actuator in model.chain.actuators)


def parameters(subject: Subject) -> tuple[EffectParameter, ...]:
    """Return the parameters of the effect under test."""
    return cast(type[EffectConfig], subject.model).fit_parameters()


def applied(subject: Subject, values: Mapping[str, float], model: Model | None = None) -> Model:
    """Return the model with the effect at these parameter values."""
    effect: Effect = subject.build(subject.configured(values))
    return effect.apply(model or sample_model(subject))


def absent(subject: Subject) -> dict[str, float]:
    """Return neutral strengths, and shapes at the end of their plausible range that is farther from neutral."""
    forms = cast(type[EffectConfig], subject.model).form_parameters()
    shapes = {p.name: _far(p) for p in (*parameters(subject), *forms) if p.role != "strength"}
    return shapes | {p.name: p.neutral for p in parameters(subject) if p.role == "strength"}


def strong(subject: Subject) -> dict[str, float]:
    """Return strengths at the plausible end that is farther from neutral, and shapes at their typical value."""
    return {p.name: _far(p) if p.role == "strength" else p.neutral for p in parameters(subject)}


def both_ends(subject: Subject) -> Iterator[dict[str, float]]:
    """Yield all strengths at their low plausible end, then at their high one; shapes at their typical value."""
    for end in (0, 1):
        yield {p.name: p.plausible[end] if p.role == "strength" else p.neutral for p in parameters(subject)}


def _far(parameter: EffectParameter) -> float:
    return max(parameter.plausible, key=lambda value: abs(value - parameter.neutral))


def probe_run(
    run: str = "probe", specimen: str = "", timed: bool = True, inputs: Sequence[str] = ("pressure_pa",)
) -> History:
    """Return a run up, down and up again at two rates with pauses, at a raised temperature, under a small load.

    The run has the payload. At the end the valve closes: the command returns to 2 kPa for five seconds, and the
    chambers keep their pressure. Further inputs are driven by 40 % of the first one; tendons are also paid out.
    """
    fast, p_fast = triangles((PRESSURE_PA, 2e3), 6e3, STEP_S, holds_s=2.0)
    slow, p_slow = triangles((PRESSURE_PA,), 1.5e3, 2 * STEP_S)
    closed = 2 * STEP_S * np.arange(1.0, 11.0)
    time_s = np.concatenate([fast, fast[-1] + 2 * STEP_S + slow, fast[-1] + 2 * STEP_S + slow[-1] + closed])
    commanded = np.concatenate([p_fast, p_slow, np.full(len(closed), 2e3)])
    return History.from_arrays(
        {
            name: (commanded - PAID_OUT_N * name.startswith("tendon")) * (SECOND if k else 1.0)
            for k, name in enumerate(inputs)
        },
        time_s if timed else None,
        run=run,
        specimen=specimen,
        moment_n_m=1e-3,
        temperature_c=WARM_C,
        payload_kg=PAYLOAD_KG,
        valve_open=np.where(np.arange(len(time_s)) < len(time_s) - len(closed), 1.0, 0.0),
    )


def probe_motion(actuation: float = 0.6 * PRESSURE_PA) -> HeldMotion:
    """Return a motion of a joint to 0.7 rad and back to −0.2 rad at two rates, with pauses."""
    fast, u_fast = triangles((0.7, -0.2, 0.4), 0.5, 0.05, holds_s=1.0)
    slow, u_slow = triangles((0.3, 0.0), 0.05, 0.5)
    time_s = np.append(fast, fast[-1] + 0.5 + slow)
    return HeldMotion.from_angles(time_s, np.append(u_fast, u_slow), actuation, WARM_C)


def inputs_seen(model: Model) -> Array:
    """Return the inputs that reach the chain for the commanded probe run, with and without a clock."""
    runs = [probe_run(timed=timed, inputs=model_inputs(model)) for timed in (True, False)]
    reached = [model.commanded(run) for run in runs]
    return np.concatenate([history_numbers(history) for history in reached])


def history_numbers(history: History) -> Array:
    """Return all arrays of a history, concatenated."""
    parts = [*(history.actuation[name] for name in sorted(history.actuation)), history.tip_force_n]
    parts += [history.moment_n_m, history.temperature_c, history.base_angles_rad]
    parts += [x for x in (history.time_s, history.payload_kg, history.valve_open) if x is not None]
    return np.concatenate([np.ravel(part) for part in parts])


def efforts(model: Model) -> Array:
    """Return the law of every joint on a grid of states, and the effort with law terms along the probe motion."""
    p, u = (grid.ravel() for grid in np.meshgrid(PRESSURES, ANGLES, indexing="ij"))
    chain = model.chain
    answers = [chain.laws[joint.law].evaluate(p, u[:, None]) for joint in chain.joints]
    parts = [np.ravel(x) for e in answers for x in (e.tau, e.dtau_dp, e.dtau_du)]
    return np.concatenate([*parts, drive(model.chain, probe_motion()).effort])


def rigid(model: Model) -> Array:
    """Return the numbers of the chain except its laws and law terms."""
    return np.append(chain_numbers(model.chain), model.chain.payload_kg)


def probe_readings() -> dict[str, Any]:
    """Return the readings of a given motion, over time and as results of a task: arrays, lists, numbers."""
    angle = np.linspace(0.0, 1.0, 7)
    readings: dict[str, Any] = {"time_s": 2.0 * angle, "angle_rad": angle}
    readings |= {"tip_x_m": 0.05 * angle, "tip_z_m": -0.08 + 0.02 * angle}
    readings |= {f"joint_{k}_angle_rad": angle / 3 for k in range(1, MODULES + 1)}
    readings |= {"marker_1_x_m": 0.01 * angle, "elongation_strain": 0.1 * angle}
    readings |= {"actuation": 15e3 * angle}
    readings |= {"bend_angle_rad": 0.9, "tip_angle_rad": 0.9, "joint_angles_rad": [[0.3]] * MODULES}
    return readings


def reading_numbers(readings: Readings) -> Array:
    """Return all readings, concatenated by name."""
    return np.concatenate([np.ravel(np.asarray(readings[name], float)) for name in sorted(readings)])


def readings_seen(model: Model) -> Array:
    """Return the sensor values of the model for a given motion."""
    return reading_numbers(model.reported(probe_readings()))


def run_readings(model: Model, path: Array, history: History) -> Readings:
    """Return the sensor values of a path (t, n, a): the clock, every angle and the position of the tip."""
    joints = path[:, :, 0]
    geometry = ChainGeometry.from_chain(model.chain)
    tip = trajectory(geometry, path, base_rotations(geometry.base_rotation, history.base_angles_rad))[:, -1]
    readings: dict[str, Any] = {} if history.time_s is None else {"time_s": history.time_s}
    pressed = sum(history.actuation[actuator.input] for actuator in model.chain.actuators)
    readings |= {"actuation": pressed, "angle_rad": joints.sum(axis=1)}
    readings |= {f"joint_{k + 1}_angle_rad": joints[:, k] for k in range(joints.shape[1])}
    readings |= {f"tip_{axis}_m": tip[:, k] for k, axis in enumerate("xyz")}
    return model.reported(readings)


SIGHTS = {"input": inputs_seen, "law": efforts, "chain": rigid, "output": readings_seen}


def follower(subject: Subject) -> PhysicsBackend:
    """Return an installed engine without inertia that supports memory; raise `CheckSkipped` without one."""
    engine = _follower(subject)
    if engine is None:
        raise CheckSkipped("no quasi-static engine that follows histories is installed")
    return engine


@once
def _follower(subject: Subject) -> PhysicsBackend | None:
    for component in discover().by_interface("physics"):
        with contextlib.suppress(ContractError):  # a failing engine is an error of another plugin
            if component.missing() is None:
                engine: PhysicsBackend = component.build(component.config_model()(kind=component.kind))
                if isinstance(engine, HistoryBackend) and not engine.capabilities.dynamic:
                    return engine
    return None


def hinge(subject: Subject, values: Mapping[str, float]) -> ChainModel:
    """Return one weightless joint with the effect's law terms: the first of two, as some effects need a neighbour."""
    return first_joint(applied(subject, values, sample_model(subject, 2, gravity=(0, 0, 0))).chain)
