"""DrivenModel: a user's own model of a system, driven by the measured runs.

Effects change the signals or the parts of the system. The system simulates the runs, and the maps of the readings act
on its outputs. Derivatives are differences whose steps follow from their own errors: a difference over a step s has the
error a / s + b s, by the noise of the simulation and by curvature, and the step is taken at which differences over
neighbouring steps agree best (Press et al., Numerical Recipes, 3rd ed., 5.7).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from threading import Lock
from typing import Any, Self

import numpy as np

from pliant.errors import UserError
from pliant.evidence.measured_model import (
    MeasuredModel,
    Prediction,
    RunReadings,
    differences,
    failed_samples,
)
from pliant.interfaces.effect import AT, Effect, EffectConfig
from pliant.interfaces.model import Channel, Drive, SystemModel, SystemParts
from pliant.measurements.system_reading import largest_magnitudes
from pliant.pipeline.workbench import RunContext
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

# Effects of a kind with more places are tried at all of them alike only.
MOST_PLACES = 40
# Steps of a difference, as multiples of the step that the fit asks for.
FACTORS = (1.0, 10.0, 100.0)


class DrivenModel(MeasuredModel):
    """A system with effects, driven by the histories of a measurement."""

    def __init__(
        self,
        context: RunContext,
        system: SystemModel,
        measurement: Measurement,
        effects: Sequence[EffectConfig] = (),
    ) -> None:
        registry = context.registry.for_model(system.config.kind, system.adapted)
        self.context = replace(context, registry=registry)
        self.system, self.measurement, self.effects = system, measurement, tuple(effects)
        self._magnitudes = largest_magnitudes(measurement)
        self._factors: dict[tuple[str, str], float] = {}
        self._lock = Lock()
        self._firsts = tuple(map(_first_readings, measurement.runs))
        self._base = self._changed(self._parts(), self.effects)
        self._set_outputs()
        if not self.outputs:
            raise UserError(
                f"{measurement.source}: the model has none of the measured outputs "
                f"({', '.join(measurement.outputs) or 'no output column'}); it has "
                f"{', '.join(channel.name for channel in system.outputs)}."
            )

    def _parts(self) -> SystemParts:
        names = tuple(tuple(channel.name for channel in some) for some in (self.inputs, self.system.outputs))
        return SystemParts(scales=self._magnitudes, names=(names[0], names[1]))

    def _set_outputs(self) -> None:
        has = {channel.name for channel in self.system.outputs}
        measured = self.measurement.outputs
        self.outputs = tuple(name for name in measured if name in has)
        self.missing = tuple(name for name in measured if name not in has)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for copies and workers, without the lock."""
        return {**vars(self), "_lock": None}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state, _lock=Lock())

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Return the inputs of the system."""
        return self.system.inputs

    @property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        """Return inputs, outputs, and the attachment points of the system."""
        return {**super().attachments, **self.system.attachments}

    @property
    def threads(self) -> bool:
        """Return whether the system works in several threads."""
        return self.system.threads

    @property
    def modules(self) -> tuple[str, ...]:
        """Return the module of the system."""
        return (type(self.system).__module__,)

    @property
    def remarks(self) -> list[str]:
        """Return sentences on outputs that the model lacks, and the system's own on these runs."""
        return [*super().remarks, *self.system.remarks(self._drives(self._base, None))]

    def default_kinds(self, kinds: Sequence[str]) -> list[str]:
        """Return the kinds that the system proposes."""
        return self.system.default_kinds(kinds)

    def places_of_kind(self, kind: str) -> list[str]:
        """Return ``kind@name`` for each place where the effect can act, if there are several."""
        place = self.context.registry.get("effect", kind).implementation_class().place
        names = self.attachments.get(place, ())
        return (
            [f"{kind}{AT}{name}" for name in names]
            if AT not in kind and 1 < len(names) <= MOST_PLACES
            else []
        )

    def unsuited(self, effect: Effect) -> str:
        """Return the error of an effect that cannot act on this system; "" without one."""
        try:
            effect.apply(self._base)  # type: ignore[arg-type]
        except UserError as error:
            return str(error)
        return ""

    def for_runs(self, measurement: Measurement) -> Self:
        """Return the same system, driven by other runs; scales stay those of the first ones."""
        other = copy.copy(self)
        other.measurement = measurement
        other._firsts = tuple(map(_first_readings, measurement.runs))
        other._set_outputs()
        return other

    def for_planned_runs(self, measurement: Measurement) -> Self:
        """Return the same system in runs that begin as the measured ones do, at the median of their first readings."""
        other = self.for_runs(measurement)
        names = self.measurement.outputs
        firsts = [_first_readings(run) for run in self.measurement.runs]
        known = {name: [one[name] for one in firsts if name in one] for name in names}
        usual = {name: float(np.median(values)) for name, values in known.items() if values}
        other._firsts = tuple(usual for _ in measurement.runs)
        return other

    def evaluate(
        self, effects: Sequence[EffectConfig] = (), histories: Sequence[History] | None = None
    ) -> Prediction:
        """Return the prediction, for `histories` instead of the measured ones if they are given."""
        self.heed()
        parts = self._changed(self._base, effects)
        drives = self._drives(parts, histories)
        runs = self._read(parts, drives, self.system.simulate(parts, drives))
        return Prediction(runs, failed_samples(runs))

    def vary(
        self, effects: Sequence[EffectConfig], towards: Sequence[Sequence[EffectConfig]]
    ) -> tuple[Prediction, tuple[tuple[RunReadings, ...], ...]]:
        """Return the prediction, and its first-order changes under small changes of the effects' parameters."""
        base = self.evaluate(effects)
        return base, tuple(self._difference(base, effects, other) for other in towards)

    def _difference(
        self, base: Prediction, effects: Sequence[EffectConfig], towards: Sequence[EffectConfig]
    ) -> tuple[RunReadings, ...]:
        """Return the change of the readings, from a difference over a step with a small error."""
        key, steps = _steps(effects, towards)
        with self._lock:
            known = self._factors.get(key)
        if known is not None:
            moved = steps.get(known, steps[1.0])
            factor = known if known in steps else 1.0
            return _scaled(differences(base.runs, self.evaluate(moved).runs), 1.0 / factor)
        found = {
            factor: _scaled(differences(base.runs, self.evaluate(moved).runs), 1.0 / factor)
            for factor, moved in steps.items()
        }
        best = _best_factor(found)
        with self._lock:
            self._factors[key] = best
        return found[best]

    def _changed(self, parts: SystemParts, effects: Sequence[EffectConfig]) -> SystemParts:
        for config in effects:
            parts = self.context.build("effect", config).apply(parts)
        return parts

    def _drives(self, parts: SystemParts, histories: Sequence[History] | None) -> list[Drive]:
        driven = [run.history for run in self.measurement.runs] if histories is None else histories
        return [Drive(parts.commanded(h), f) for h, f in zip(driven, self._firsts, strict=True)]

    def _read(
        self, parts: SystemParts, drives: Sequence[Drive], readings: Sequence[RunReadings]
    ) -> tuple[RunReadings, ...]:
        """Return the measured outputs of each run, after the effects' maps of readings."""
        runs = []
        for drive, run in zip(drives, readings, strict=True):
            time_s = drive.history.time_s
            reported = parts.reported({**run, "time_s": time_s}) if parts.outputs else run
            runs.append({name: np.asarray(reported[name], float) for name in self.outputs})
        return tuple(runs)


def _first_readings(run: MeasuredRun) -> dict[str, float]:
    """Return the readings of a run's first sample, by output."""
    return {name: float(v[0]) for name, v in run.outputs.items() if len(v) and np.isfinite(v[0])}


def _steps(
    effects: Sequence[EffectConfig], towards: Sequence[EffectConfig]
) -> tuple[tuple[str, str], dict[float, tuple[EffectConfig, ...]]]:
    """Return which parameter changes, and the effects at multiples of its change that its bounds allow."""
    for k, (before, after) in enumerate(zip(effects, towards, strict=True)):
        for one in (*type(before).fit_parameters(), *type(before).form_parameters()):
            value, moved = getattr(before, one.name), getattr(after, one.name)
            if value == moved:
                continue
            steps = {1.0: tuple(towards)}
            for factor in FACTORS[1:]:
                there = value + factor * (moved - value)
                if one.bounds[0] <= there <= one.bounds[1]:
                    changed = before.model_copy(update={one.name: there})
                    steps[factor] = (*effects[:k], changed, *effects[k + 1 :])
            return (before.kind, one.name), steps
    return ("", ""), {1.0: tuple(towards)}


def _scaled(runs: Sequence[RunReadings], factor: float) -> tuple[RunReadings, ...]:
    return tuple({name: factor * values for name, values in run.items()} for run in runs)


def _best_factor(found: Mapping[float, Sequence[RunReadings]]) -> float:
    """Return the step whose difference agrees best with that of the next step."""
    factors = sorted(found)
    if len(factors) < 2:
        return factors[0]
    apart = [_distance(found[a], found[b]) for a, b in pairwise(factors)]
    return factors[int(np.argmin(apart))]


def _distance(one: Sequence[RunReadings], other: Sequence[RunReadings]) -> float:
    """Return the sum over outputs of squared differences, relative to the size of the first; infinite with NaN."""
    total = 0.0
    for name in one[0] if one else ():
        a, b = (np.concatenate([run[name] for run in some]) for some in (one, other))
        both = np.isfinite(a) & np.isfinite(b)
        size = float(np.sum(a[both] ** 2))
        total += float(np.sum((a[both] - b[both]) ** 2)) / size if size > 0.0 else 0.0
    return total
