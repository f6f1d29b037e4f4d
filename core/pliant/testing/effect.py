"""Checks of an `Effect`: it vanishes where it says so, acts where it says so, and leaves the model alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from pliant.interfaces.effect import Effect, EffectParameter, Model, Place
from pliant.interfaces.task import Task, TaskConfig
from pliant.pipeline.simulate import run_task
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, Rollout, TaskResult
from pliant.testing.physics_bench import chain_numbers
from pliant.testing.samples import PRESSURE_PA, sample_chain
from pliant.testing.stand_ins import StandIn, StandInConfig
from pliant.testing.suite import Subject, Suite, require, require_close
from pliant.units import UnitError, parse_quantity

suite = Suite("effect")
PLACES = get_args(Place)
PRESSURES = np.array([0.0, 2e3, 5e3, 9e3, 15e3])
ANGLES = np.array([-0.2, 0.05, 0.2, 0.36, 0.5])


class ProbeTask(Task):
    """Raises and releases the pressure and reports angles as a bench would."""

    def run(self, simulation: Any) -> TaskResult:
        settled = []
        for pressure in PRESSURES[[1, 4, 2]]:
            simulation.apply(Inputs({"pressure_pa": float(pressure)}))
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


def _model() -> Model:
    return Model(sample_chain(modules=3, payload=0.003))


def _parameters(subject: Subject) -> tuple[EffectParameter, ...]:
    cls = type(subject.build())
    parameters: tuple[EffectParameter, ...] = cls.parameters
    return parameters


def _applied(subject: Subject, values: Mapping[str, float], model: Model | None = None) -> Model:
    effect: Effect = subject.build(subject.configured(values))
    return effect.apply(model or _model())


def _neutral(subject: Subject) -> dict[str, float]:
    return {p.name: p.neutral for p in _parameters(subject)}


def _extreme(subject: Subject) -> dict[str, float]:
    """Every parameter at the end of its plausible range that lies farther from neutral."""
    return {p.name: max(p.plausible, key=lambda v, p=p: abs(v - p.neutral)) for p in _parameters(subject)}  # type: ignore[misc]


def _inputs_seen(model: Model) -> Array:
    """What reaches the chain when the probe pressures are commanded one after another."""
    rows = []
    for pressure in PRESSURES:
        inputs = Inputs({"pressure_pa": float(pressure)}, np.array([0.01, 0.0, -0.02]), 1e-3)
        for change in model.inputs:
            inputs = change(inputs)
        rows.append([inputs.actuation["pressure_pa"], *inputs.tip_force_n, inputs.moment_n_m])
    return np.array(rows)


def _efforts(model: Model) -> Array:
    p, u = (grid.ravel() for grid in np.meshgrid(PRESSURES, ANGLES, indexing="ij"))
    efforts = [law.evaluate(p, u[:, None]) for law in model.chain.laws]
    return np.concatenate([np.ravel(x) for e in efforts for x in (e.tau, e.dtau_dp, e.dtau_du)])


def _rigid(model: Model) -> Array:
    """Everything of the chain but its laws."""
    return np.append(chain_numbers(model.chain), model.chain.payload_kg)


def _reading(model: Model) -> Array:
    """What the model reports of a given motion."""
    chain = sample_chain(modules=3)
    n = chain.n_joints
    settled = [
        Equilibrium(np.full((n, 1), a), np.full((n + 2, 3), 0.01 * a), 0.0, True, True, 1, 0.0)
        for a in ANGLES[1:4]
    ]
    result = _reported(settled)
    for output in model.outputs:
        result = output(result)
    return _result_numbers(result)


def _result_numbers(result: TaskResult) -> Array:
    parts: list[Any] = [result.final.joint_angles, result.final.markers_m]
    parts += [result.metrics[name] for name in sorted(result.metrics)]
    if result.rollout is not None:
        parts += [result.rollout.joint_angles, result.rollout.markers_m]
    return np.concatenate([np.ravel(np.asarray(part, float)) for part in parts])


SIGHTS = {"input": _inputs_seen, "law": _efforts, "chain": _rigid, "output": _reading}


@suite.check(
    "`place` is one of input, law, chain, output; every parameter has a name, a unit and ordered ranges."
)
def declares_place_and_parameters(subject: Subject) -> None:
    place = type(subject.build()).place
    require(place in PLACES, f"place is '{place}', not one of {', '.join(PLACES)}")
    require(
        len(_parameters(subject)) > 0, "the effect has no parameters: calibration would have nothing to fit"
    )
    for p in _parameters(subject):
        low, high = p.bounds
        require(low < high, f"parameter '{p.name}': bounds {p.bounds} are not ordered")
        require(low <= p.neutral <= high, f"parameter '{p.name}': neutral {p.neutral} is outside the bounds")
        require(
            low <= p.plausible[0] < p.plausible[1] <= high,
            f"parameter '{p.name}': plausible {p.plausible} is not an ordered range within the bounds "
            f"{p.bounds}",
        )
        try:
            parse_quantity(f"1 {p.unit}" if p.unit not in ("", "1") else "1", p.unit or "dimensionless")
        except UnitError as error:
            require(False, f"parameter '{p.name}': the unit '{p.unit}' is not known ({error})")


@suite.check("each parameter is a field of the config under the same name, with the parameter's hard bounds.")
def parameters_are_config_fields(subject: Subject) -> None:
    config = subject.config
    for p in _parameters(subject):
        require(
            p.name in subject.model.model_fields,
            f"parameter '{p.name}' is no field of {subject.model.__name__} "
            f"({', '.join(subject.model.model_fields)})",
        )
        for value in (*p.plausible, p.neutral):
            subject.configured({p.name: value})
        width = p.bounds[1] - p.bounds[0]
        for value in (p.bounds[0] - 0.01 * width, p.bounds[1] + 0.01 * width):
            try:
                subject.configured({p.name: value})
            except ValidationError:
                continue
            require(
                False, f"{type(config).__name__} accepts {p.name} = {value:g}, outside the bounds {p.bounds}"
            )


@suite.check("at the neutral values the effect vanishes: model and result are those without it.")
def neutral_values_change_nothing(subject: Subject) -> None:
    plain, neutral = _model(), _applied(subject, _neutral(subject))
    for place, sight in SIGHTS.items():
        require_close(
            sight(neutral),
            sight(plain),
            f"with every parameter neutral the {place} differs",
            rtol=1e-12,
            atol=1e-15,
        )


@suite.check("within the plausible range the effect can be seen.")
def plausible_values_change_something(subject: Subject) -> None:
    place = type(subject.build()).place
    sight = SIGHTS[place]
    for p in _parameters(subject):
        seen = []
        for value in p.plausible:
            values = {**_extreme(subject), p.name: value}
            seen.append(sight(_applied(subject, values)))
        differs = seen[0].shape != seen[1].shape or not np.allclose(seen[0], seen[1], rtol=1e-9, atol=0)
        require(differs, f"parameter '{p.name}' has no effect on the {place}: it is never used there")


@suite.check(
    "an effect acts at its `place` only: an input effect leaves laws, chain and outputs alone, and so on."
)
def acts_only_at_its_place(subject: Subject) -> None:
    place = type(subject.build()).place
    plain, changed = _model(), _applied(subject, _extreme(subject))
    for other in PLACES:
        if other == place:
            continue
        same = SIGHTS[other](changed)
        require_close(
            same,
            SIGHTS[other](plain),
            f"an effect of place '{place}' changed the {other}",
            rtol=1e-12,
            atol=1e-15,
        )


@suite.check("`apply` returns a new model and never changes the one it was given.")
def leaves_the_model_alone(subject: Subject) -> None:
    model = _model()
    before = {name: sight(model) for name, sight in SIGHTS.items()}
    laws = tuple(model.chain.laws)
    effect: Effect = subject.build(subject.configured(_extreme(subject)))
    changed = effect.apply(model)
    require(isinstance(changed, Model), f"apply returned {changed!r}, no Model: a forgotten return?")
    for name, sight in SIGHTS.items():
        require(
            np.array_equal(sight(model), before[name]), f"the {name} of the given model was changed in place"
        )
    require(
        model.chain.laws == laws and not model.inputs and not model.outputs, "the given model was changed"
    )


@suite.check("effects compose: the maps and laws of effects applied before stay.")
def keeps_earlier_effects(subject: Subject) -> None:
    def doubled(inputs: Inputs) -> Inputs:
        return replace(inputs, moment_n_m=2 * inputs.moment_n_m)

    def marked(result: TaskResult) -> TaskResult:
        return replace(result, metrics={**result.metrics, "earlier_count": 1.0})

    earlier = _model().with_(inputs=(doubled,), outputs=(marked,))
    changed = _applied(subject, _extreme(subject), earlier)
    require(
        changed.inputs[:1] == (doubled,) and changed.outputs[:1] == (marked,),
        "maps of effects applied before are lost or come later: use (*model.inputs, mine)",
    )
    twice = _applied(subject, _extreme(subject), _applied(subject, _extreme(subject)))
    once = _applied(subject, _extreme(subject))
    sight = SIGHTS[type(subject.build()).place]
    plain = sight(_model())
    scale = max(float(np.abs(sight(once) - plain).max()), 1e-300)
    require(
        float(np.abs(sight(twice) - sight(once)).max()) > 1e-6 * scale,
        "applied to a model that already has it, the effect does nothing: it replaces instead of wrapping",
    )


@suite.check(
    "wrapped laws stay laws: slopes are derivatives, τ = −∂Π/∂u, joint, axes, domain and record are kept."
)
def wrapped_laws_stay_laws(subject: Subject) -> None:
    plain = _model().chain.laws
    p, u = np.full(5, 0.7 * PRESSURE_PA), ANGLES[:, None]
    h, k = 1.0, 1e-5
    for law, inner in zip(_applied(subject, _extreme(subject)).chain.laws, plain, strict=True):
        effort = law.evaluate(p, u)
        in_p = (law.evaluate(p + h, u).tau - law.evaluate(p - h, u).tau) / (2 * h)
        in_u = (law.evaluate(p, u + k).tau - law.evaluate(p, u - k).tau) / (2 * k)
        energy = -(law.potential(p, u + 1e-4) - law.potential(p, u - 1e-4)) / 2e-4
        require_close(effort.dtau_dp, in_p, "dtau_dp of the wrapped law is not the slope of tau", rtol=1e-4)
        require_close(
            effort.dtau_du[:, :, 0], in_u, "dtau_du of the wrapped law is not the slope of tau", rtol=1e-4
        )
        require_close(
            effort.tau[:, 0], energy, "τ of the wrapped law is not −∂Π/∂u: scale the potential too", rtol=1e-4
        )
        require(
            (law.joint, law.axes, law.actuation_name) == (inner.joint, inner.axes, inner.actuation_name),
            "joint, axes or actuation_name of the wrapped law differ from the inner law's",
        )
        require(law.domain.actuation.shape == (2,), "the wrapped law has no domain")
        law.record()


@suite.check("the simulate stage can run the model: input maps give `Inputs`, output maps give `TaskResult`.")
def model_runs_under_a_task(subject: Subject) -> None:
    effect: Effect = subject.build(subject.configured(_extreme(subject)))
    engine, chain = StandIn(StandInConfig()), _model().chain
    probe = ProbeTask(TaskConfig(kind="probe"))
    result = run_task(engine, probe, [effect], chain)
    require(isinstance(result, TaskResult), f"the model's result is {type(result).__name__}, no TaskResult")
    numbers = _result_numbers(result)
    require(np.all(np.isfinite(numbers)), "with the effect the task's result is not finite")
    plain = _result_numbers(run_task(engine, probe, [], chain))
    require(
        numbers.shape == plain.shape and not np.allclose(numbers, plain, rtol=1e-9, atol=1e-12),
        "the task's result is the same with and without the effect at plausible values",
    )
    again = _result_numbers(run_task(engine, probe, [effect], chain))
    require(
        np.array_equal(numbers, again),
        "a second run with the same effect differs: maps keep memory from one simulation to the next",
    )
