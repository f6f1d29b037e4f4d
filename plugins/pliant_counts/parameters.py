"""Parameters that may explain counts: strengths of effects, and keys of the task over their plausible ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from pydantic import ValidationError

from pliant.config.measurements import PlausibleRange
from pliant.config.problems import sentences
from pliant.errors import UserError
from pliant.interfaces.effect import EffectConfig
from pliant.registry.discovery import Registry
from pliant.units import UnitError, parse_quantity
from pliant_counts.counted_study import CountedStudy
from pliant_counts.records import CountCondition
from pliant_counts.task_keys import TaskKey, changed_task, need_key, value_at
from pliant_counts.trials import Setting
from pliant_tables.units import ENDINGS

STEPS = 4  # levels over a plausible range


@dataclass(frozen=True)
class VariedParameter:
    """One number that may be wrong.

    Attributes:
        kind: the effect's kind, or the dotted key of the task.
        name: ``stiffness.factor``, ``task.friction``, ``task.friction where cylinder``.
        unit: SI unit.
        levels: values to try, without the present one.
        neutral: the present value; None where it differs between conditions or is not stated.
        model: config of the effect, None for a key of the task.
        field: of the effect's config.
        where: conditions to which it is limited: (dotted key, value) pairs.
    """

    kind: str
    name: str
    unit: str
    levels: tuple[float, ...]
    neutral: float | None = None
    model: type[EffectConfig] | None = None
    field: str = ""
    where: tuple[tuple[str, Any], ...] = ()

    def moved(self, setting: Setting, condition: CountCondition, level: float) -> Setting:
        """Return the setting of a condition with this number at a level."""
        if any(condition.changes.get(key) != value for key, value in self.where):
            return setting
        if self.model is None:
            return replace(setting, task=changed_task(setting.task, {self.kind: level}))
        effect = self.model.model_validate({"kind": self.kind, self.field: level})
        return replace(setting, effects=(*setting.effects, effect))


def effect_parameters(
    registry: Registry, kinds: Sequence[str] | None, steps: int = STEPS
) -> list[VariedParameter]:
    """Return each strength of the kinds; by default of all effects with one parameter that act before the sensor.

    Mistakes of a record are left out: a count has no payload label and no clock. Effects of rate and memory have
    several parameters and are tried only if they are named: their other parameters stay at typical values.
    """
    varied = []
    for kind in kinds if kinds is not None else registry.kinds("effect"):
        component = registry.get("effect", kind)
        effect = component.implementation_class()
        model = cast(type[EffectConfig], component.config_model())
        parameters = model.fit_parameters()
        strengths = [p for p in parameters if p.role == "strength"]
        of_a_record = effect.place == "output" or effect.notes.origin == "bench"
        if kinds is None and (of_a_record or len(parameters) != 1):
            continue
        for p in strengths:
            levels = scan_levels(p.plausible[0], p.plausible[1], p.neutral, steps)
            varied.append(VariedParameter(kind, f"{kind}.{p.name}", p.unit, levels, p.neutral, model, p.name))
    return varied


def task_parameters(
    counted: CountedStudy, ranges: Sequence[PlausibleRange], steps: int = STEPS
) -> list[VariedParameter]:
    """Return a parameter for each plausible range of the study.

    Raises:
        UserError: a range of a key that the task does not have, with ends of the wrong quantity, or outside what the
            task allows; a `where` that no condition of the file has.
    """
    return [_task_parameter(counted, one, steps) for one in ranges]


def scan_levels(low: float, high: float, neutral: float | None, steps: int) -> tuple[float, ...]:
    """Return `steps` levels from low to high, half on each side of the present value if it is inside."""
    if neutral is None:
        return tuple(np.linspace(low, high, steps).tolist())
    if not low < neutral < high:
        found = np.linspace(low, high, steps + 1)
        return tuple(float(v) for v in found if v != neutral)[-steps:]
    below, above = steps // 2, steps - steps // 2
    down = neutral + (low - neutral) * np.arange(below, 0, -1) / below
    up = neutral + (high - neutral) * np.arange(1, above + 1) / above
    return tuple(float(v) for v in (*down, *up))


def _task_parameter(counted: CountedStudy, one: PlausibleRange, steps: int) -> VariedParameter:
    place = "'measurements.plausible' names"
    key = need_key(type(counted.task), one.key, ENDINGS, place)
    low, high = (_si(value, key, one) for value in (one.low, one.high))
    where = {
        need_key(type(counted.task), name, ENDINGS, f"{place} in 'where'").dotted: value
        for name, value in one.where.items()
    }
    meant = [c for c in counted.counts.conditions if all(c.changes.get(k) == v for k, v in where.items())]
    if not meant:
        raise UserError(
            f"'measurements.plausible' has {one.key} only where {_said(one.where)}, and no condition of "
            f"{counted.counts.source} is that."
        )
    present = {value_at(counted.condition_task(c), key) for c in meant}
    neutral = float(present.pop()) if len(present) == 1 and None not in present else None
    for level in (low, high):
        try:
            changed_task(counted.condition_task(meant[0]), {key.dotted: level})
        except ValidationError as error:
            text = sentences(error, type(counted.task), lambda at: "", ("task",))
            raise UserError(f"'measurements.plausible' of {one.key}: {text}") from None
    name = f"{key.dotted} where {_said(one.where)}" if where else key.dotted
    levels = scan_levels(low, high, neutral, steps)
    return VariedParameter(key.dotted, name, key.si or "1", levels, neutral, where=tuple(where.items()))


def _si(value: float | str, key: TaskKey, one: PlausibleRange) -> float:
    if not isinstance(value, str):
        return float(value)
    try:
        return parse_quantity(value, key.si or "dimensionless")
    except UnitError as error:
        raise UserError(f"'measurements.plausible' of {one.key}: {error}.") from None


def _said(where: Mapping[str, Any]) -> str:
    return " and ".join(f"{key.removeprefix('task.')} is {value}" for key, value in where.items())
