"""Checks of an `Effect`: it vanishes and acts as declared, and does not change the given model.

Law terms are checked in `effect_terms`, identification by a diagnosis in `effect_found`.
"""

from __future__ import annotations

from functools import partial
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from pliant.interfaces.effect import Effect, Model, Origin, Readings
from pliant.interfaces.task import Task, TaskConfig
from pliant.pipeline.engine_checks import require_histories
from pliant.pipeline.simulate import run_task
from pliant.records.history import History
from pliant.records.rollout import Inputs, Rollout, TaskResult
from pliant.testing import Finding, Subject, agree, declared, require, require_refused
from pliant.testing.effect_bench import (
    ANGLES,
    PRESSURES,
    SIGHTS,
    absent,
    applied,
    follower,
    history_numbers,
    model_inputs,
    parameters,
    probe_readings,
    probe_run,
    reading_numbers,
    run_readings,
    sample_model,
    strong,
)
from pliant.testing.joint_laws import require_exact_slopes, require_potential
from pliant.testing.samples import PRESSURE_PA
from pliant.testing.stand_ins import StandIn, StandInConfig
from pliant.units import UnitError, parse_quantity

# Places of effects of chains.
PLACES = tuple(SIGHTS)


class ProbeTask(Task):
    """Task that raises and releases the pressure and reports angles as in a laboratory test."""

    def run(self, simulation: Any) -> TaskResult:
        levels, settled = PRESSURES[[1, 4, 2]], []
        for pressure in levels:
            names = (actuator.input for actuator in simulation.chain.actuators)
            simulation.apply(Inputs(dict.fromkeys(names, float(pressure))))
            settled.append(simulation.settle())
        angles, markers = (np.stack([getattr(e, n) for e in settled]) for n in ("joint_angles", "markers_m"))
        final = settled[-1]
        metrics = {
            "angle_rad": float(final.joint_angles.sum()),
            "joint_angles_rad": final.joint_angles[:, 0].tolist(),
            "tip_x_m": float(final.tip_m[0]),
            "tip_z_m": float(final.tip_m[2]),
        }
        return TaskResult(final, metrics, Rollout(np.arange(3.0), levels[:, None], angles, markers))


@declared
def declares_place_and_parameters(subject: Subject) -> None:
    """`place` is one of input, law, chain, output; a parameter's unit is known."""
    place = type(subject.build()).place
    require(place in PLACES, f"place is '{place}', not one of {', '.join(PLACES)}")
    for p in parameters(subject):
        try:
            parse_quantity(
                "1" if p.unit == "1" else f"1 {p.unit}", "dimensionless" if p.unit == "1" else p.unit
            )
        except UnitError as error:
            raise Finding(f"parameter '{p.name}': the unit '{p.unit}' is not known ({error})") from None


@declared
def has_a_strength(subject: Subject) -> None:
    """at least one parameter is a `strength`, at whose neutral value the effect vanishes and which calibration fits;
    none if `fitted` is False."""
    roles = {p.name: p.role for p in parameters(subject)}
    if not type(subject.build()).fitted:
        require(not roles, f"fitted is False, and yet {', '.join(roles)} may be fitted: drop one of the two")
        return
    how = "calibration would have nothing to fit; declare fields by `parameter(…)`"
    require(roles, f"the effect has no parameters: {how}")
    shapes = f"{', '.join(roles)} are all shapes; which one makes the effect vanish?"
    require("strength" in roles.values(), shapes)


@declared
def says_where_a_simpler_form_is_enough(subject: Subject) -> None:
    """a shape whose neutral value is a bound states by `simpler` which form is enough there."""
    for p in parameters(subject):
        if p.role == "shape" and p.neutral in p.bounds:
            how = f'write simpler={{{p.neutral:g}: "…"}} into its `parameter(…)`, such as "one volume is enough"'
            told = p.neutral in dict(p.simpler)
            require(
                told, f"shape '{p.name}' is neutral at its bound {p.neutral:g}, and nothing says so: {how}"
            )


@declared
def says_which_recordings_it_suits(subject: Subject) -> None:
    """`unsuited` gives no reason for a run that has every input, load and condition, and texts otherwise; `origin` is
    physics or bench."""
    effect, chain = subject.build(), sample_model(subject).chain
    names = model_inputs(sample_model(subject))
    bare = History.from_arrays(dict.fromkeys(names, 0.0))
    for histories in ([probe_run(inputs=names)], [bare]):
        reason = effect.unsuited(chain, histories)
        require(isinstance(reason, str), f"unsuited returned {reason!r}, no text")
    inclined = chain.with_(gravity_m_s2=np.array([3.0, 0.0, -9.34]))
    reasons = [effect.unsuited(one, [probe_run(inputs=names)]) for one in (chain, inclined)]
    require(
        not all(reasons),
        f"it says of a run that has everything, on a level bench and on an inclined one: '{reasons[0]}'; no diagnosis "
        "would ever try it",
    )
    origins = get_args(Origin)
    require(
        effect.notes.origin in origins, f"origin is '{effect.notes.origin}', not one of {', '.join(origins)}"
    )


@declared
def config_keeps_the_bounds(subject: Subject) -> None:
    """the config takes every value of a parameter within its bounds, and none outside."""
    for p in parameters(subject):
        for value in (*p.plausible, p.neutral, *p.bounds):
            subject.configured({p.name: value})
        step = 0.01 * (p.bounds[1] - p.bounds[0])
        for outside in ({p.name: p.bounds[0] - step}, {p.name: p.bounds[1] + step}):
            accepted = f"{subject.model.__name__} accepts {outside}, outside the bounds {p.bounds}"
            require_refused(partial(subject.configured, outside), accepted, error=ValidationError)


def neutral_values_change_nothing(subject: Subject) -> None:
    """with every strength neutral the effect vanishes, whatever its shape; without strengths, with every default."""
    plain = sample_model(subject)
    if type(subject.build()).fitted:
        neutral = applied(subject, absent(subject))
    else:
        neutral = subject.build(subject.plain_config).apply(plain)
    for place, sight in SIGHTS.items():
        finding = f"with every strength neutral the {place} differs"
        agree(sight(neutral), sight(plain), finding, rtol=1e-12, atol=1e-15)


def plausible_values_change_something(subject: Subject) -> None:
    """within the plausible range each parameter has a visible effect."""
    place = type(subject.build()).place
    for p in parameters(subject):
        one, two = (SIGHTS[place](applied(subject, {**strong(subject), p.name: x})) for x in p.plausible)
        differs = one.shape != two.shape or not np.allclose(one, two, rtol=1e-9, atol=0)
        require(differs, f"parameter '{p.name}' has no effect on the {place}: it is never used there")


def acts_only_at_its_place(subject: Subject) -> None:
    """an effect acts at its `place` only: an input effect does not change laws, chain and outputs, and so on."""
    place = type(subject.build()).place
    plain, changed = sample_model(subject), applied(subject, strong(subject))
    for other in set(PLACES) - {place}:
        finding = f"an effect of place '{place}' changed the {other}"
        agree(SIGHTS[other](changed), SIGHTS[other](plain), finding, rtol=1e-12, atol=1e-15)


def leaves_the_model_alone(subject: Subject) -> None:
    """`apply` returns a new model and never changes the one it was given."""
    model = sample_model(subject)
    before, laws = {name: sight(model) for name, sight in SIGHTS.items()}, tuple(model.chain.laws)
    changed = applied(subject, strong(subject), model)
    require(isinstance(changed, Model), f"apply returned {changed!r}, no Model: a forgotten return?")
    for name, sight in SIGHTS.items():
        same = np.array_equal(sight(model), before[name])
        require(same, f"the {name} of the given model was changed in place")
    bare = not (model.inputs or model.outputs or model.chain.terms)
    require(model.chain.laws == laws and bare, "the given model was changed")


def keeps_earlier_effects(subject: Subject) -> None:
    """effects compose: the maps, laws and law terms of effects applied before are kept and come first."""

    def doubled(history: History) -> History:
        return history.with_(moment_n_m=2 * history.moment_n_m)

    def marked(readings: Readings) -> Readings:
        return {**readings, "earlier_count": 1.0}

    lost = "of effects applied before are lost or come later: use"
    earlier = sample_model(subject).with_(inputs=(doubled,), outputs=(marked,))
    changed = applied(subject, strong(subject), earlier)
    first = changed.inputs[:1] == (doubled,) and changed.outputs[:1] == (marked,)
    require(first, f"maps {lost} model.with_input and model.with_output")
    once = applied(subject, strong(subject))
    twice = applied(subject, strong(subject), once)
    same = twice.chain.terms[: len(once.chain.terms)] == once.chain.terms
    require(same, f"law terms {lost} model.with_term")
    sight = SIGHTS[type(subject.build()).place]
    none, one, two = (sight(model) for model in (sample_model(subject), once, twice))
    again = float(np.abs(two - one).max()) > 1e-6 * max(float(np.abs(one - none).max()), 1e-300)
    cause = "it replaces instead of wrapping"
    require(again, f"applied to a model that already has it, the effect does nothing: {cause}")


def input_maps_keep_the_run(subject: Subject) -> None:
    """an input map returns a `History` of the same run and length, finite, and does not change its argument."""
    for timed in (True, False):
        for change in applied(subject, strong(subject)).inputs:
            history = probe_run(timed=timed, inputs=model_inputs(sample_model(subject)))
            before = history_numbers(history)
            changed = change(history)
            require(isinstance(changed, History), f"an input map returned {changed!r}, no History")
            same = np.array_equal(history_numbers(history), before)
            require(same, "an input map changed its history in place")
            one, two = ((h.run, h.specimen, set(h.actuation)) for h in (history, changed))
            require(one == two, "an input map changed the run's name, its specimen or which inputs there are")
            numbers = history_numbers(changed)
            finding = "an input map changed the number of samples or made values that are not finite"
            where = "" if timed else " where the history has no times"
            require(numbers.shape == before.shape and np.all(np.isfinite(numbers)), finding + where)
            require(np.array_equal(history_numbers(change(history)), numbers), "an input map keeps memory")


def output_maps_keep_the_readings(subject: Subject) -> None:
    """an output map keeps every reading, by name and shape, and does not change its argument."""
    for change in applied(subject, strong(subject)).outputs:
        readings = probe_readings()
        changed = change(readings)
        require(hasattr(changed, "keys"), f"an output map returned {changed!r}, no readings by name")
        lost = ", ".join(sorted(set(readings) - set(changed)))
        require(not lost, f"an output map lost {lost}")
        same = np.array_equal(reading_numbers(readings), reading_numbers(probe_readings()))
        require(same, "an output map changed the readings in place")
        for name, value in readings.items():
            shape = np.shape(changed[name])
            require(shape == np.shape(value), f"an output map gave '{name}' the shape {shape}")


def wrapped_laws_stay_laws(subject: Subject) -> None:
    """wrapped laws stay laws: slopes are derivatives, τ = −∂Π/∂u, joint, axes, domain and record are kept."""
    plain, changed = sample_model(subject).chain, applied(subject, strong(subject)).chain
    require(changed.n_joints == plain.n_joints, "the chain has another number of joints")
    p, u, whose = np.full(5, 0.7 * PRESSURE_PA), ANGLES[:, None], " of the wrapped law"
    for a, b in dict.fromkeys((a.law, b.law) for a, b in zip(changed.joints, plain.joints, strict=True)):
        law, inner = changed.laws[a], plain.laws[b]
        require_exact_slopes(law, p, u, 1e-4, whose)
        require_potential(law, p, u, 1e-4, whose)
        for name in ("joint", "axes", "actuation_name"):
            same = getattr(law, name) == getattr(inner, name)
            require(same, f"{name} of the wrapped law differs from the inner law's")
        require(law.domain.actuation.shape == (2,), "the wrapped law has no domain")
        law.record()


def a_run_shows_it(subject: Subject) -> None:
    """a run in an engine that follows histories shows the effect, finite and converged."""
    engine, seen = follower(subject), []
    for model in (applied(subject, strong(subject)), sample_model(subject)):
        reached = model.commanded(probe_run(inputs=model_inputs(model)))
        followed = require_histories(engine).follow(model.chain, [reached])[0][0]
        lost = int(np.sum(np.logical_not(followed.converged)))
        require(lost == 0, f"{lost} samples of a run find no equilibrium")
        seen.append(reading_numbers(run_readings(model, followed.joint_angles, reached)))
    require(np.all(np.isfinite(seen[0])), "with the effect the readings of a run are not finite")
    same = np.allclose(seen[0], seen[1], rtol=1e-9, atol=1e-12)
    require(
        not same, "the readings of a run with all kinds of phases are the same with and without the effect"
    )


def model_runs_under_a_task(subject: Subject) -> None:
    """the simulate stage can run the model under a task, and again with the same result."""
    effect: Effect = subject.build(subject.configured(strong(subject)))
    timeless = not any(term.needs_time for term in applied(subject, strong(subject)).chain.terms)
    engine = StandIn(StandInConfig()) if timeless else follower(subject)
    numbers = []
    for _ in range(2):
        result = run_task(engine, ProbeTask(TaskConfig(kind="probe")), [effect], sample_model(subject).chain)
        require(
            isinstance(result, TaskResult), f"the model's result is {type(result).__name__}, no TaskResult"
        )
        parts = [result.final.joint_angles, result.final.markers_m, reading_numbers(result.metrics)]
        numbers.append(np.concatenate([np.ravel(part) for part in parts]))
    require(np.all(np.isfinite(numbers[0])), "with the effect the task's result is not finite")
    memory = "maps keep memory from one simulation to the next"
    require(np.array_equal(numbers[0], numbers[1]), f"a second run with the same effect differs: {memory}")
