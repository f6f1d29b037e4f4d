"""A study's own runs: its `protocols` as runs that may be chosen and written for the bench."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.config.protocols import Level, ProtocolConfig
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.experiments.experiment_catalogue import BUILDERS, TURNING, timed_catalogue
from pliant.experiments.planned_run import NEW, SET_UP, STEP_S, PlannedRun, RunMaker, RunShape, corners
from pliant.experiments.scale import BenchScale
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement
from pliant.units import UnitError, parse_quantity

UNITS = {"_pa": "Pa", "_n": "N", "_m": "m"}


def own_runs(study: Study, chain: ChainModel, measurement: Measurement) -> tuple[PlannedRun, ...]:
    """The runs of a study's `protocols`, at the scale of a measurement; none where it has no such block."""
    if not study.protocols:
        return ()
    return runs_of(study.protocols, BenchScale.of_measurement(chain, measurement))


def runs_of(protocols: Sequence[ProtocolConfig], scale: BenchScale) -> tuple[PlannedRun, ...]:
    """The runs of the block, or the default menu where it is empty.

    Raises:
        UserError: a run that this chain cannot do, a level of another unit, or a name that stands twice.
    """
    if not protocols:
        return timed_catalogue(scale)
    make, found = RunMaker(scale), []
    for number, config in enumerate(protocols):
        where = f"protocols[{number}]"
        run = _custom(config, scale, where) if config.run == "custom" else _of_menu(config, make, where)
        changes: dict[str, object] = {}
        if config.words:
            changes["words"] = config.words
        if config.minutes is not None:
            changes["minutes"] = config.minutes
        if config.name:
            changes |= {"name": config.name, "history": run.history.with_(run=config.name)}
        found.append(replace(run, **changes))  # type: ignore[arg-type]
    names = [run.name for run in found]
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"'protocols' has run '{name}' twice; give one of them another 'name'.")
    return tuple(found)


def _of_menu(config: ProtocolConfig, make: RunMaker, where: str) -> PlannedRun:
    levels = tuple(_share(level, make.scale, where) for level in config.levels)
    amplitudes = tuple(_share(level, make.scale, where) for level in config.amplitudes)
    shape = RunShape(
        config.period_s,
        amplitudes,
        config.cycles,
        levels,
        config.hold_s,
        config.load_n_m,
        config.temperature_c,
    )
    run = BUILDERS[config.run](make, shape)
    if run is None:
        raise UserError(f"{where}: run '{config.run}' makes no sense for this chain; leave it out.")
    return run


def _share(level: Level, scale: BenchScale, where: str) -> float:
    """The level as a share of the largest that was driven."""
    if not isinstance(level, str):
        return float(level)
    name = max(scale.top, key=lambda one: scale.top[one])
    return _value(level, name, where) / (scale.top[name] or 1.0)


def _value(level: Level, name: str, where: str) -> float:
    if not isinstance(level, str):
        return float(level)
    unit = next(unit for suffix, unit in UNITS.items() if name.endswith(suffix))
    try:
        return parse_quantity(level, unit)
    except UnitError as error:
        raise UserError(f"{where}: {error}; the chain is driven by {name}.") from None


def _custom(config: ProtocolConfig, scale: BenchScale, where: str) -> PlannedRun:
    for name in config.inputs:
        if name not in scale.top:
            raise UserError(
                f"{where}: '{name}' is not an input of this chain{closest(name, list(scale.top))} "
                f"It is driven by {', '.join(scale.top)}."
            )

    def sampled(values: Sequence[float]) -> Array:
        return corners(list(zip(config.times_s, values, strict=True)), STEP_S).share

    clock = corners([(time, 0.0) for time in config.times_s], STEP_S).time_s
    inputs = {
        name: sampled([_value(level, name, where) for level in config.inputs[name]])
        if name in config.inputs
        else np.zeros(len(clock))
        for name in scale.top
    }
    turned = config.pitch_rad != 0.0 or config.roll_rad != 0.0
    history = History.of(
        inputs,
        clock,
        run=config.name or "custom",
        specimen=NEW if config.new_specimen else scale.specimen,
        moment_n_m=sampled(config.moments_n_m) if config.moments_n_m else 0.0,
        temperature_c=scale.temperature_c if config.temperature_c is None else config.temperature_c,
        base_angles_rad=(config.roll_rad, config.pitch_rad, 0.0) if turned else scale.base_angles_rad,
        payload_kg=scale.payload_kg,
    )
    words = config.words or f"the run '{config.name}' of the study's protocols"
    minutes = (TURNING if turned else SET_UP) + float(clock[-1]) / 60.0
    return PlannedRun(config.name or "custom", words, history, round(minutes, 1))
