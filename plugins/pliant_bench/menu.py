"""Runs of the default menu that the limits of a bench allow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pliant.errors import UserError
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.experiments.experiment_catalogue import timed_catalogue
from pliant.experiments.planned_run import BenchScale, PlannedRun
from pliant.experiments.system_catalogue import system_catalogue
from pliant.records.history import BASE
from pliant_bench.bench import BenchProtocol
from pliant_bench.limits import check_protocol
from pliant_bench.plans import LOADS, protocol_from_planned
from pliant_bench.protocol_space import ProtocolSpace

# Conditions of which a person sets every level.
SET_BY_HAND = ("payload_kg", "temperature_c", *BASE)


def menu_protocols(
    model: MeasuredModel, space: ProtocolSpace, setting: Mapping[str, float]
) -> tuple[BenchProtocol, ...]:
    """Return the runs of the menu that the bench can do in this setting: mounted specimen, its sensors, its limits."""
    channels = [axis.channel for axis in space.axes]
    usual = model.measurement.runs[-1].history.signals()
    found = []
    for run in _menu(model, space):
        if run.adds or run.new_specimen:
            continue
        protocol = protocol_from_planned(run, [one.name for one in channels], space.period_s)
        if protocol is None or protocol.duration_s > space.longest_s:
            continue
        signals = run.history.signals()
        if any(np.any(signals[n] != usual[n][0]) for n in SET_BY_HAND if n in signals and n in usual):
            continue
        if any(protocol.conditions.get(name, 0.0) for name in LOADS):
            continue
        allowed = replace(protocol, conditions=dict(setting))
        try:
            check_protocol(allowed, channels)
        except UserError:  # beyond a limit, or it does not begin and end at rest
            continue
        found.append(allowed)
    return tuple(found)


def _menu(model: MeasuredModel, space: ProtocolSpace) -> tuple[PlannedRun, ...]:
    """Return the menu at the scale of the limits; for a model of the user's own at that of the recorded runs."""
    if not isinstance(model, Predictor):
        return system_catalogue(model)
    axes = {axis.channel.name: axis for axis in space.axes}
    measured = BenchScale.from_measurement(model.chain, model.measurement)
    top = {name: axes[name].high if name in axes else value for name, value in measured.top.items()}
    load = measured.load.copy()
    for k, name in enumerate(("moment_n_m", "tip_force_x_n", "tip_force_y_n", "tip_force_z_n")):
        load[k] = min(axes[name].high, -axes[name].low) if name in axes else 0.0
    return timed_catalogue(replace(measured, top=top, load=load))
