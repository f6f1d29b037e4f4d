"""Checks of an `Effect`: it vanishes where it says so, acts where it says so, and leaves the model alone.

Law terms in `effect_terms`; that a diagnosis finds it in `effect_found`.
"""

from __future__ import annotations

from functools import partial
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from pliant.interfaces.effect import Effect, Model, Place, Readings
from pliant.interfaces.task import Task, TaskConfig
from pliant.pipeline.simulate import run_task
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Equilibrium, Inputs, Rollout, TaskResult
from pliant.testing.effect_bench import (
    ANGLES,
    PRESSURES,
    SIGHTS,
    absent,
    applied,
    follower,
    history_numbers,
    inputs_of,
    parameters,
    probe_readings,
    probe_run,
    reading_numbers,
    run_readings,
    sample_model,
    strong,
)
from pliant.testing.effect_found import suite as found_again
from pliant.testing.effect_terms import suite as terms
from pliant.testing.joint_laws import require_exact_slopes, require_potential
from pliant.testing.samples import PRESSURE_PA
from pliant.testing.stand_ins import StandIn, StandInConfig
from pliant.testing.suite import Subject, Suite, require, require_close, require_refused
from pliant.units import UnitError, parse_quantity

suite = Suite("effect")
suite.checks.extend((*terms.checks, *found_again.checks))
PLACES = get_args(Place)


class ProbeTask(Task):
    """Raises and releases the pressure and reports angles as a bench would."""

    def run(self, simulation: Any) -> TaskResult:
        settled = []
        for pressure in PRESSURES[[1, 4, 2]]:
            names = (actuator.input for actuator in simulation.chain.actuators)
            simulation.apply(Inputs(dict.fromkeys(names, float(pressure))))
            settled.append(simulation.settle())
        return _reported(settled)


def _reported(settled: list[Equilibrium]) -> TaskResult:
    angles = np.stack([e.joint_angles for e in settled])
    markers = np.stack([e.markers_m for e in settled])
    final = settled[-1]
    metrics = {
        "angle_rad": float(final.joint_angles.sum()),
        "joint_angles_rad": final.joint_angles[:, 0].tolist(),
        "tip_x_m": float(final.tip_m[0]),
        "tip_z_m": float(final.tip_m[2]),
    }
    times = np.arange(len(settled), dtype=float)
    return TaskResult(final, metrics, Rollout(times, PRESSURES[[1, 4, 2]][:, None], angles, markers))


@suite.check("`place` is one of input, law, chain, output; a parameter's unit is known.", declares=True)
def declares_place_and_parameters(subject: Subject) -> None:
    place = type(subject.build()).place
    require(place in PLACES, f"place is '{place}', not one of {', '.join(PLACES)}")
    for p in parameters(subject):
        try:
            parse_quantity(
                f"1 {p.unit}" if p.unit != "1" else "1", p.unit if p.unit != "1" else "dimensionless"
            )
        except UnitError as error:
            require(False, f"parameter '{p.name}': the unit '{p.unit}' is not known ({error})")


@suite.check(
    "at least one parameter is a `strength`: it makes the effect vanish, and calibration fits it.",
    declares=True,
)
def has_a_strength(subject: Subject) -> None:
    roles = {p.name: p.role for p in parameters(subject)}
    require(
        roles,
        "the effect has no parameters: calibration would have nothing to fit; declare fields by `parameter(…)`",
    )
    require(
        "strength" in roles.values(), f"{', '.join(roles)} are all shapes; which one makes the effect vanish?"
    )


@suite.check(
    "the config takes every value of a parameter within its bounds, and none outside.", declares=True
)
def config_keeps_the_bounds(subject: Subject) -> None:
    for p in parameters(subject):
        for value in (*p.plausible, p.neutral, *p.bounds):
            subject.configured({p.name: value})
        width = p.bounds[1] - p.bounds[0]
        for outside in ({p.name: p.bounds[0] - 0.01 * width}, {p.name: p.bounds[1] + 0.01 * width}):
            require_refused(
                partial(subject.configured, outside),
                f"{subject.model.__name__} accepts {outside}, outside the bounds {p.bounds}",
                error=ValidationError,
            )


@suite.check("with every strength neutral the effect vanishes, whatever its shape.")
def neutral_values_change_nothing(subject: Subject) -> None:
    plain, neutral = sample_model(subject), applied(subject, absent(subject))
    for place, sight in SIGHTS.items():
        require_close(
            sight(neutral),
            sight(plain),
            f"with every strength neutral the {place} differs",
            rtol=1e-12,
            atol=1e-15,
        )


@suite.check("within the plausible range each parameter can be seen.")
def plausible_values_change_something(subject: Subject) -> None:
    place = type(subject.build()).place
    sight = SIGHTS[place]
    for p in parameters(subject):
        seen = [sight(applied(subject, {**strong(subject), p.name: value})) for value in p.plausible]
        differs = seen[0].shape != seen[1].shape or not np.allclose(seen[0], seen[1], rtol=1e-9, atol=0)
        require(differs, f"parameter '{p.name}' has no effect on the {place}: it is never used there")


@suite.check(
    "an effect acts at its `place` only: an input effect leaves laws, chain and outputs alone, and so on."
)
def acts_only_at_its_place(subject: Subject) -> None:
    place = type(subject.build()).place
    plain, changed = sample_model(subject), applied(subject, strong(subject))
    for other in PLACES:
        if other == place:
            continue
        require_close(
            SIGHTS[other](changed),
            SIGHTS[other](plain),
            f"an effect of place '{place}' changed the {other}",
            rtol=1e-12,
            atol=1e-15,
        )


@suite.check("`apply` returns a new model and never changes the one it was given.")
def leaves_the_model_alone(subject: Subject) -> None:
    model = sample_model(subject)
    before = {name: sight(model) for name, sight in SIGHTS.items()}
    laws = tuple(model.chain.laws)
    effect: Effect = subject.build(subject.configured(strong(subject)))
    changed = effect.apply(model)
    require(isinstance(changed, Model), f"apply returned {changed!r}, no Model: a forgotten return?")
    for name, sight in SIGHTS.items():
        require(
            np.array_equal(sight(model), before[name]), f"the {name} of the given model was changed in place"
        )
    require(
        model.chain.laws == laws and not (model.inputs or model.outputs or model.chain.terms),
        "the given model was changed",
    )


@suite.check("effects compose: the maps, laws and law terms of effects applied before stay and come first.")
def keeps_earlier_effects(subject: Subject) -> None:
    def doubled(history: History) -> History:
        return history.with_(moment_n_m=2 * history.moment_n_m)

    def marked(readings: Readings) -> Readings:
        return {**readings, "earlier_count": 1.0}

    earlier = sample_model(subject).with_(inputs=(doubled,), outputs=(marked,))
    changed = applied(subject, strong(subject), earlier)
    require(
        changed.inputs[:1] == (doubled,) and changed.outputs[:1] == (marked,),
        "maps of effects applied before are lost or come later: use model.with_input and model.with_output",
    )
    once = applied(subject, strong(subject))
    twice = applied(subject, strong(subject), once)
    require(
        twice.chain.terms[: len(once.chain.terms)] == once.chain.terms,
        "law terms of effects applied before are lost or come later: use model.with_term",
    )
    sight = SIGHTS[type(subject.build()).place]
    plain = sight(sample_model(subject))
    scale = max(float(np.abs(sight(once) - plain).max()), 1e-300)
    require(
        float(np.abs(sight(twice) - sight(once)).max()) > 1e-6 * scale,
        "applied to a model that already has it, the effect does nothing: it replaces instead of wrapping",
    )


@suite.check(
    "an input map returns a `History` of the same run, as long and finite, and leaves its own alone."
)
def input_maps_keep_the_run(subject: Subject) -> None:
    for timed in (True, False):
        for change in applied(subject, strong(subject)).inputs:
            history = probe_run(timed=timed, inputs=inputs_of(sample_model(subject)))
            before = history_numbers(history)
            changed = change(history)
            require(isinstance(changed, History), f"an input map returned {changed!r}, no History")
            require(
                np.array_equal(history_numbers(history), before), "an input map changed its history in place"
            )
            same = (changed.run, changed.specimen, set(changed.actuation)) == (
                history.run,
                history.specimen,
                set(history.actuation),
            )
            require(same, "an input map changed the run's name, its specimen or which inputs there are")
            numbers = history_numbers(changed)
            require(
                numbers.shape == before.shape and np.all(np.isfinite(numbers)),
                "an input map changed the number of samples or made values that are not finite"
                + ("" if timed else " where the history has no times"),
            )
            require(np.array_equal(history_numbers(change(history)), numbers), "an input map keeps memory")


@suite.check("an output map keeps every reading, by name and shape, and leaves its own alone.")
def output_maps_keep_the_readings(subject: Subject) -> None:
    for change in applied(subject, strong(subject)).outputs:
        readings = probe_readings()
        changed = change(readings)
        require(hasattr(changed, "keys"), f"an output map returned {changed!r}, no readings by name")
        lost = sorted(set(readings) - set(changed))
        require(not lost, f"an output map lost {', '.join(lost)}")
        require(
            np.array_equal(reading_numbers(readings), reading_numbers(probe_readings())),
            "an output map changed the readings in place",
        )
        for name, value in readings.items():
            shape = np.shape(changed[name])
            require(shape == np.shape(value), f"an output map gave '{name}' the shape {shape}")


@suite.check(
    "wrapped laws stay laws: slopes are derivatives, τ = −∂Π/∂u, joint, axes, domain and record are kept."
)
def wrapped_laws_stay_laws(subject: Subject) -> None:
    plain, changed = sample_model(subject).chain, applied(subject, strong(subject)).chain
    require(changed.n_joints == plain.n_joints, "the chain has another number of joints")
    pairs = {(a.law, b.law): None for a, b in zip(changed.joints, plain.joints, strict=True)}
    p, u = np.full(5, 0.7 * PRESSURE_PA), ANGLES[:, None]
    whose = " of the wrapped law"
    for law, inner in ((changed.laws[a], plain.laws[b]) for a, b in pairs):
        require_exact_slopes(law, p, u, 1e-4, whose)
        require_potential(law, p, u, 1e-4, whose)
        require(
            (law.joint, law.axes, law.actuation_name) == (inner.joint, inner.axes, inner.actuation_name),
            "joint, axes or actuation_name of the wrapped law differ from the inner law's",
        )
        require(law.domain.actuation.shape == (2,), "the wrapped law has no domain")
        law.record()


@suite.check("a run in an engine that follows histories shows the effect, finite and converged.")
def a_run_shows_it(subject: Subject) -> None:
    engine = follower(subject)
    seen = []
    for model in (applied(subject, strong(subject)), sample_model(subject)):
        reached = model.commanded(probe_run(inputs=inputs_of(model)))
        followed = engine.follow(model.chain, [reached])[0][0]
        lost = int(np.sum(np.logical_not(followed.converged)))
        require(lost == 0, f"{lost} samples of a run find no equilibrium")
        seen.append(reading_numbers(run_readings(model, followed.joint_angles, reached)))
    require(np.all(np.isfinite(seen[0])), "with the effect the readings of a run are not finite")
    require(
        not np.allclose(seen[0], seen[1], rtol=1e-9, atol=1e-12),
        "the readings of a run with all kinds of phases are the same with and without the effect",
    )


@suite.check("the simulate stage can run the model under a task, and again with the same result.")
def model_runs_under_a_task(subject: Subject) -> None:
    effect: Effect = subject.build(subject.configured(strong(subject)))
    chain = sample_model(subject).chain
    timeless = not any(term.needs_time for term in effect.apply(sample_model(subject)).chain.terms)
    engine = StandIn(StandInConfig()) if timeless else follower(subject)
    probe = ProbeTask(TaskConfig(kind="probe"))
    result = run_task(engine, probe, [effect], chain)
    require(isinstance(result, TaskResult), f"the model's result is {type(result).__name__}, no TaskResult")
    numbers = _result_numbers(result)
    require(np.all(np.isfinite(numbers)), "with the effect the task's result is not finite")
    again = _result_numbers(run_task(engine, probe, [effect], chain))
    require(
        np.array_equal(numbers, again),
        "a second run with the same effect differs: maps keep memory from one simulation to the next",
    )


def _result_numbers(result: TaskResult) -> Array:
    parts: list[Any] = [result.final.joint_angles, result.final.markers_m]
    parts += [result.metrics[name] for name in sorted(result.metrics)]
    return np.concatenate([np.ravel(np.asarray(part, float)) for part in parts])
