"""Checks of an effect of a user's own model: it vanishes and acts as declared, at the places of its pattern alone.

Input and output maps are seen on a probe, all other effects in runs of the example of a model that they are for.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, get_args

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.effect import AT, EffectParameter, Model, Place
from pliant.interfaces.model import Drive, SystemModel, SystemParts
from pliant.records.design import Array
from pliant.records.history import History
from pliant.registry.discovery import CHAIN, Registry, discover
from pliant.testing import CheckSkipped, Finding, Subject, declared, effect, once, require, require_refused
from pliant.testing.model import sample_drives, sample_parts
from pliant.testing.samples import sample_chain

# Outputs of the probe, besides the model's: a vector and an angle.
VECTOR = ("probe_x_m", "probe_y_m", "probe_z_m")
SCALE = 2.0


@once
def _model(subject: Subject) -> tuple[SystemModel, Registry]:
    """Return a model that the effect is for, at its manifest's example, and its registry."""
    installed = discover()
    kinds = [kind for kind in subject.component.models if kind != CHAIN]
    known = [one for one in installed.by_interface("model") if one.kind in kinds]
    for one in known:
        if one.missing() is None:
            model: SystemModel = Subject(one).build()
            return model, installed.for_model(one.kind, model.adapted)
    raise CheckSkipped(f"no model of {', '.join(kinds)} is installed, in which the effect could act")


def _kind(subject: Subject) -> str:
    """Return the effect's kind, with the first place where it can act behind it if it needs a name."""
    place = type(subject.build()).place
    names = _model(subject)[0].attachments.get(place, ())
    return f"{subject.component.kind}{AT}{names[0]}" if names else subject.component.kind


def _parameters(subject: Subject) -> tuple[EffectParameter, ...]:
    """Return the parameters, adapted to the model."""
    model = _model(subject)[0]
    declared_ones = subject.model.fit_parameters()  # type: ignore[attr-defined]
    return tuple(model.adapted(_kind(subject), one) for one in declared_ones)


def _values(subject: Subject, choose: Callable[[EffectParameter], float]) -> dict[str, float]:
    return {one.name: choose(one) for one in _parameters(subject)}


def _neutral(one: EffectParameter) -> float:
    return one.neutral


def _strong(one: EffectParameter) -> float:
    """Return the end of the plausible range that is farther from neutral."""
    return max(one.plausible, key=lambda end: abs(end - one.neutral))


def _probe(subject: Subject) -> SystemParts:
    """Return parts of the model without effects, with the vector among its outputs."""
    parts = sample_parts(_model(subject)[0])
    largest = {
        name: max(float(np.abs(drive.history.actuation[name]).max()) for drive in _drives(subject)) or 1.0
        for name in parts.names[0]
    }
    outputs = (*parts.names[1], *VECTOR)
    return parts.with_(names=(parts.names[0], outputs), scales=largest | dict.fromkeys(outputs, SCALE))


def _applied(
    subject: Subject, values: dict[str, float], kind: str = "", to: SystemParts | None = None
) -> SystemParts:
    config = subject.configured({"kind": kind or _kind(subject)}).model_copy(update=values)
    parts = subject.build(config).apply(_probe(subject) if to is None else to)
    require(
        isinstance(parts, SystemParts), f"the effect returned {parts!r}, no SystemParts: a forgotten return?"
    )
    changed: SystemParts = parts
    return changed


def _drives(subject: Subject) -> tuple[Drive, ...]:
    return sample_drives(_model(subject)[0])


def _inputs_seen(subject: Subject, parts: SystemParts) -> Array:
    """Return the inputs that reach the system, one after another."""
    reached = [parts.commanded(drive.history).actuation for drive in _drives(subject)]
    return np.concatenate([values for run in reached for _, values in sorted(run.items())])


def _outputs_seen(subject: Subject, parts: SystemParts) -> Array:
    """Return the readings that the maps make of the probe's."""
    clock = np.linspace(0.0, 2.0, 81)
    names = parts.names[1]
    readings: dict[str, Any] = {
        name: SCALE * np.sin((k + 2.0) * clock + 0.3 * k) for k, name in enumerate(names)
    }
    before = {name: values.copy() for name, values in readings.items()}
    reported = parts.reported({**readings, "time_s": clock})
    lost = ", ".join(sorted(set(readings) - set(reported)))
    require(not lost, f"an output map lost {lost}")
    same = all(np.array_equal(readings[name], values) for name, values in before.items())
    require(same, "an output map changed the readings in place")
    return np.concatenate([np.asarray(reported[name], float) for name in names])


def _system_seen(subject: Subject, parts: SystemParts) -> Array:
    """Return the model's own readings with the changes of the parts, for the commanded inputs."""
    model, _ = _model(subject)
    runs = model.simulate(parts, _drives(subject))
    return np.concatenate([values for run in runs for _, values in sorted(run.items())])


SIGHTS = {"input": _inputs_seen, "output": _outputs_seen, "system": _system_seen}


def _sight(subject: Subject) -> str:
    place = type(subject.build()).place
    return place if place in SIGHTS else "system"


@declared
def declares_place_and_parameters(subject: Subject) -> None:
    """`place` is a kind of place; a parameter has a strength, and its unit is known."""
    place, known = type(subject.build()).place, get_args(Place)
    require(place in known, f"place is '{place}', not one of {', '.join(known)}")
    roles = [one.role for one in subject.model.fit_parameters()]  # type: ignore[attr-defined]
    require("strength" in roles, "no parameter is a strength: which one makes the effect vanish?")


@declared
def config_keeps_the_bounds(subject: Subject) -> None:
    """the config takes every value of a parameter within its bounds, and none outside."""
    effect.config_keeps_the_bounds(subject)


def neutral_values_change_nothing(subject: Subject) -> None:
    """with every strength neutral the effect vanishes."""
    neutral = {one.name: one.neutral for one in _parameters(subject) if one.role == "strength"}
    with_it = _applied(subject, _values(subject, _strong) | neutral)
    for name, sight in SIGHTS.items():
        plain = sight(subject, _probe(subject))
        apart = float(np.abs(sight(subject, with_it) - plain).max())
        limit = 1e-12 * float(np.abs(plain).max())
        require(apart <= limit, f"with every strength neutral the {name} differs by {apart:.3g}")


def plausible_values_change_something(subject: Subject) -> None:
    """within the plausible range each parameter has a visible effect at its place."""
    sight = SIGHTS[_sight(subject)]
    for one in _parameters(subject):
        ends = [
            sight(subject, _applied(subject, _values(subject, _strong) | {one.name: end}))
            for end in one.plausible
        ]
        differs = not np.allclose(ends[0], ends[1], rtol=1e-9, atol=0.0)
        require(
            differs,
            f"parameter '{one.name}' changes nothing at the {_sight(subject)}: it is never used there",
        )


def acts_only_at_its_place(subject: Subject) -> None:
    """an effect of inputs changes no map of readings and nothing inside the system, and so on."""
    changed, own = _applied(subject, _values(subject, _strong)), _sight(subject)
    for name, sight in SIGHTS.items():
        if name != own:
            same = np.array_equal(sight(subject, changed), sight(subject, _probe(subject)))
            require(same, f"an effect of place '{type(subject.build()).place}' changed the {name}")


def leaves_the_parts_alone(subject: Subject) -> None:
    """`act` returns new parts and does not change the ones that it was given."""
    parts = _probe(subject)
    _applied(subject, _values(subject, _strong), to=parts)
    require(not (parts.inputs or parts.outputs or parts.changes), "the given parts were changed in place")


def keeps_earlier_effects(subject: Subject) -> None:
    """effects compose: maps and changes of effects applied before are kept and come first."""

    def doubled(history: History) -> History:
        return history.with_actuation(**{name: 2 * v for name, v in history.actuation.items()})

    def marked(readings: Any) -> Any:
        return {**readings, "earlier_count": 1.0}

    once_applied = _applied(subject, _values(subject, _strong))
    earlier = _probe(subject).with_(inputs=(doubled,), outputs=(marked,), changes=once_applied.changes)
    changed = _applied(subject, _values(subject, _strong), to=earlier)
    kept = changed.inputs[:1] == (doubled,) and changed.outputs[:1] == (marked,)
    kept = kept and changed.changes[: len(earlier.changes)] == earlier.changes
    require(
        kept,
        "what earlier effects changed is lost or comes later: use with_input, with_output or with_change",
    )


def input_maps_keep_the_run(subject: Subject) -> None:
    """an input map returns a finite `History` of the same run and length, and does not change its argument."""
    parts = _applied(subject, _values(subject, _strong))
    for drive in _drives(subject):
        before = {name: v.copy() for name, v in drive.history.actuation.items()}
        reached = parts.commanded(drive.history)
        same = all(np.array_equal(drive.history.actuation[name], v) for name, v in before.items())
        require(same, "an input map changed its history in place")
        require(reached.run == drive.history.run, "an input map changed the run's name")
        for name, values in before.items():
            got = reached.actuation.get(name)
            finite = got is not None and got.shape == values.shape and bool(np.isfinite(got).all())
            require(finite, f"an input map lost '{name}', its samples, or made values that are not finite")


def refuses_a_place_that_the_model_lacks(subject: Subject) -> None:
    """a pattern that fits no place is a `UserError` that names it, at the latest when the model simulates."""
    kind = f"{subject.component.kind}{AT}no_such_place"

    def act() -> None:
        parts = _applied(subject, _values(subject, _strong), kind)
        _system_seen(subject, parts)

    require_refused(act, f"'{kind}' was accepted", "no_such_place", "place", UserError)


def refuses_a_chain(subject: Subject) -> None:
    """applied to a chain of modules, the effect is refused by a `UserError`."""
    built = subject.build(subject.configured({"kind": _kind(subject)}))
    model = Model(chain=sample_chain(modules=1))
    require_refused(partial(built.apply, model), "a chain was accepted", error=UserError)


def notes_are_plain(subject: Subject) -> None:
    """notes are sentences about any system: a confounder is an effect of such a model."""
    confounder = type(subject.build()).notes.confounder
    kinds = _model(subject)[1].kinds("effect")
    if confounder and confounder not in kinds:
        raise Finding(f"the look-alike '{confounder}' is no effect of this kind of model")
