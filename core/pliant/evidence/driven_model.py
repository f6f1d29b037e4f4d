"""DrivenModel: a user's own model of a system, driven by the measured runs.

Effects change the signals or the parts of the system. The system simulates the runs, and the maps of the readings act
on its outputs. Derivatives are differences whose steps follow from their own errors: a difference over a step s has the
error a / s + b s, by the noise of the simulation and by curvature, and the step is taken at which differences over
neighbouring steps agree best (Press et al., Numerical Recipes, 3rd ed., 5.7). A system may have its own derivatives in
what is inside it (`SystemModel.vary`).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from threading import Lock
from typing import Any, Self

import numpy as np

from pliant.errors import NotReachedError, UserError
from pliant.evidence.measured_model import (
    MeasuredModel,
    Prediction,
    RunReadings,
    differences,
    failed_samples,
)
from pliant.evidence.simulations import Simulations
from pliant.interfaces.effect import AT, Effect, EffectConfig
from pliant.interfaces.model import Channel, Drive, SystemModel, SystemParts
from pliant.measurements.floors import noise_floors
from pliant.measurements.system_reading import largest_magnitudes
from pliant.pipeline.workbench import RunContext
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

# Effects of a kind with more places are tried at all of them alike only.
MOST_PLACES = 40
# Steps of a difference, as multiples of the step that the fit asks for.
FACTORS = (1.0, 10.0, 100.0)
# Places of effects outside the system.
SIGNALS = ("input", "output")
# Effects whose places are numbers of a model.
OWN_NUMBERS = ("parameter", "state")
# Samples at least in which steps of differences are chosen.
FEWEST_STEPPED = 3
# Samples in which a system may refuse an effect.
CHECKED = 20
# Change of an output with half the time step, over the noise, from which it is said.
COARSE = 0.5
# Share of the longest run in which steps of differences are chosen.
STEPPED = 0.4


class DrivenModel(MeasuredModel):
    """A system with effects, driven by the histories of a measurement."""

    def __init__(
        self,
        context: RunContext,
        system: SystemModel,
        measurement: Measurement,
        effects: Sequence[EffectConfig] = (),
    ) -> None:
        registry = context.registry.for_model(system.config.kind, system.adapted, system.words)
        self.context = replace(context, registry=registry)
        self.system, self.measurement, self.effects = system, measurement, tuple(effects)
        self._magnitudes = largest_magnitudes(measurement)
        self._factors: dict[tuple[str, str], float] = {}
        self._lock = Lock()
        self._recent = Simulations()
        self._firsts = tuple(map(_first_readings, measurement.runs))
        self._base = self._changed(self._parts(), self.effects)
        self.law_error = system.number_error
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
        """Return the state for copies and workers, without the lock and what was simulated."""
        return {**vars(self), "_lock": None, "_recent": None}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state, _lock=Lock(), _recent=Simulations())

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Return the inputs of the system."""
        return self.system.inputs

    @property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        """Return inputs, outputs, and the attachment points of the system."""
        return {**super().attachments, **self.system.attachments}

    @property
    def no_state(self) -> str:
        """Return the sentence on a model without a finite reading."""
        return "the model has no finite reading in any measured run; it diverges there, or returns NaN"

    @property
    def threads(self) -> bool:
        """Return whether the system works in several threads."""
        return self.system.threads

    @property
    def costly_slopes(self) -> bool:
        """Return that slopes are differences of simulations, unless the system has its own."""
        return True

    @property
    def modules(self) -> tuple[str, ...]:
        """Return the module of the system."""
        return (type(self.system).__module__,)

    @property
    def remarks(self) -> list[str]:
        """Return sentences on outputs that the model lacks, and the system's own on these runs."""
        drives = self._drives(self._base, None)
        return [*super().remarks, *self.system.remarks(drives), *self._coarse_steps(drives)]

    def _coarse_steps(self, drives: Sequence[Drive]) -> list[str]:
        """Return a remark if the model's own time step changes an output of the fastest run beyond the noise."""
        if not drives:
            return []
        fastest = max(drives, key=self._pace)
        floors = noise_floors(self.measurement)
        errors = self.system.step_error([fastest])
        shares = {
            name: errors[name] / floors[name].value
            for name in self.outputs
            if name in errors and floors[name].value > 0.0
        }
        worst = max(shares, key=lambda name: shares[name], default="")
        if not worst or shares[worst] < COARSE:
            return []
        return [
            f"In run '{fastest.history.run}', half the model's time step changes {worst} by {shares[worst]:.1f} times "
            "its noise: choose a smaller step in the model's file, or an effect may stand for the integration's error."
        ]

    def _pace(self, drive: Drive) -> float:
        """Return the way that the inputs of a run go per second, in their largest magnitudes."""
        time_s = drive.history.time_s
        seconds = 1.0 if time_s is None else max(float(time_s[-1] - time_s[0]), 1e-9)
        ways = {name: float(np.abs(np.diff(v)).sum()) for name, v in drive.history.actuation.items()}
        return sum(way / (self._magnitudes.get(name) or 1.0) for name, way in ways.items()) / seconds

    @property
    def unchanged(self) -> SystemParts:
        """Return the system without the study's effects."""
        return self._parts()

    @property
    def commanded(self) -> list[Drive]:
        """Return the measured runs as commanded, before any effect."""
        return self._drives(self._parts(), None)

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

    def predict(self, effects: Sequence[EffectConfig] = ()) -> tuple[RunReadings, ...]:
        """Return the predicted outputs of each run; raise `UserError` if none is finite."""
        try:
            return super().predict(effects)
        except NotReachedError as error:
            raise UserError(
                f"model '{self.system.config.kind}': {error}. Simulate one run with the model alone and look at its "
                "first readings."
            ) from None

    def evaluate(
        self, effects: Sequence[EffectConfig] = (), histories: Sequence[History] | None = None
    ) -> Prediction:
        """Return the prediction, for `histories` instead of the measured ones if they are given."""
        self.heed()
        parts = self._changed(self._base, effects)
        drives = self._drives(parts, histories)
        runs = self._read(parts, drives, self._recent.simulated(self.system, parts, drives))
        return Prediction(runs, failed_samples(runs))

    def check(self, effects: Sequence[EffectConfig]) -> None:
        """Raise `UserError` for effects that this system refuses at the beginning of the shortest run."""
        shortest = min(self.measurement.runs, key=len)
        begin = shortest.at(np.arange(min(CHECKED, len(shortest))))
        self.for_runs(replace(self.measurement, runs=(begin,))).evaluate(effects)

    def vary(
        self, effects: Sequence[EffectConfig], towards: Sequence[Sequence[EffectConfig]]
    ) -> tuple[Prediction, tuple[tuple[RunReadings, ...], ...]]:
        """Return the prediction, and its first-order changes under small changes of the effects' parameters."""
        own = [k for k, other in enumerate(towards) if self._is_of_system(effects, other)]
        known = self._derivatives(effects, [towards[k] for k in own]) if own else None
        if known is None:
            base = self.evaluate(effects)
            return base, tuple(self._difference(base, effects, other) for other in towards)
        base, found = known
        changes = dict(zip(own, found, strict=True))
        return base, tuple(
            changes[k] if k in changes else self._difference(base, effects, other)
            for k, other in enumerate(towards)
        )

    def number_sensitivities(self, share: float) -> tuple[tuple[RunReadings, ...], ...]:
        """Return the changes of the readings by a share of each of the system's own numbers."""
        if not self.law_error:
            return ()
        parts, base = self._base, self.evaluate().runs
        drives = self._drives(parts, None)
        every = [parts.with_change(change) for change in self.system.number_changes(share)]
        return tuple(
            differences(base, self._read(one, drives, self.system.simulate(one, drives))) for one in every
        )

    def _is_of_system(self, effects: Sequence[EffectConfig], other: Sequence[EffectConfig]) -> bool:
        """Return whether what changes is inside the system: no map of its inputs or readings."""
        kinds = [after.kind for before, after in zip(effects, other, strict=True) if before != after]
        get = self.context.registry.get
        return bool(kinds) and all(
            get("effect", kind).implementation_class().place not in SIGNALS for kind in kinds
        )

    def _derivatives(
        self, effects: Sequence[EffectConfig], towards: Sequence[Sequence[EffectConfig]]
    ) -> tuple[Prediction, tuple[tuple[RunReadings, ...], ...]] | None:
        """Return the prediction and its changes by the system's own derivatives; None where it has none.

        The maps of the readings act on the changed readings, whose steps are small.
        """
        self.heed()
        parts = self._changed(self._base, effects)
        drives = self._drives(parts, None)
        found = self.system.vary(parts, [self._changed(self._base, other) for other in towards], drives)
        if found is None:
            return None
        at, changes = found
        base = self._read(parts, drives, at)
        moved = [
            self._read(parts, drives, [_moved(a, by) for a, by in zip(at, change, strict=True)])
            for change in changes
        ]
        return Prediction(base, failed_samples(base)), tuple(differences(base, one) for one in moved)

    def _difference(
        self, base: Prediction, effects: Sequence[EffectConfig], towards: Sequence[EffectConfig]
    ) -> tuple[RunReadings, ...]:
        """Return the change of the readings, from a difference over a step with a small error."""
        (kind, name), steps = _steps(effects, towards)
        # places of one kind share a step; of a model's own numbers each has another size
        key = (kind if kind.partition(AT)[0] in OWN_NUMBERS else kind.partition(AT)[0], name)
        with self._lock:
            known = self._factors.get(key)
        if known is not None:
            moved = steps.get(known, steps[1.0])
            factor = known if known in steps else 1.0
            return _scaled(differences(base.runs, self.evaluate(moved).runs), 1.0 / factor)
        best = self._short_run()._best_step(effects, steps)
        with self._lock:
            self._factors[key] = best
        return _scaled(differences(base.runs, self.evaluate(steps[best]).runs), 1.0 / best)

    def _short_run(self) -> Self:
        """Return the same system, driven by the beginning of the longest run alone."""
        longest = max(self.measurement.runs, key=len)
        begin = longest.at(np.arange(max(int(STEPPED * len(longest)), min(FEWEST_STEPPED, len(longest)))))
        return self.for_runs(replace(self.measurement, runs=(begin,)))

    def _best_step(
        self, effects: Sequence[EffectConfig], steps: Mapping[float, Sequence[EffectConfig]]
    ) -> float:
        """Return the multiple of the change whose difference has the smallest error."""
        base = self.evaluate(effects).runs
        return _best_factor(
            {
                factor: _scaled(differences(base, self.evaluate(moved).runs), 1.0 / factor)
                for factor, moved in steps.items()
            }
        )

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


def _moved(readings: RunReadings, change: RunReadings) -> RunReadings:
    return {name: values + change[name] for name, values in readings.items()}


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
