"""Benches in memory: a model, protocols, and readings of it with effects and noise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.readings import ReadingVector
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore
from pliant.testing.histories import triangles
from pliant.testing.samples import sample_chain
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

REGISTRY = discover()
BENCH = RunContext(REGISTRY, ArtifactStore(Path("unused")))
ENGINE = Quasistatic(QuasistaticConfig())  # one for all tests: caches terms and law tables
P = 15e3
SIGMA = 2e-3
# One strength of each shipped effect, well inside its plausible range.
VALUES: dict[str, dict[str, float]] = {
    "stiffness": {"factor": 1.15},
    "actuation_gain": {"gain": 0.9},
    "pressure_offset": {"offset_pa": 600.0},
    "dead_zone": {"threshold_pa": 900.0},
    "supply_lag": {"time_s": 0.6},
    "viscous_damping": {"time_s": 0.4},
    "viscoelastic": {"share": 0.3, "time_s": 12.0},
    "friction_hysteresis": {"half_width_rad": 0.03, "break_away_rad": 0.01},
    "mullins": {"softening": 0.3, "scale_rad": 0.2},
    "permanent_set": {"share": 0.1},
    "self_contact": {"stiffening": 2.0, "contact_rad": 0.25},
    "thermal_softening": {"loss_per_k": 0.006},
    "gravity_scale": {"factor": 1.25},
    "sensor_bias": {"bias_rad": 0.03},
}
# Kinds that the tests of the diagnosis do not hide in one joint: they need more joints, sensors or runs.
MORE_VALUES: dict[str, dict[str, float]] = {
    "wall_thickness": {"ratio": 1.08},
    "bimodulus": {"asymmetry": 0.2},
    "leak": {"rate_1_s": 0.05},
    "inertia": {"scale": 1.0},
    "base_misalignment": {"pitch_rad": 0.04, "roll_rad": -0.03},
    "cross_axis": {"turn_rad": 0.15},
    "inter_module_compliance": {"share": 0.2},
    "end_restraint": {"base_share": 0.9, "cap_share": 0.8},
    "sensor_scale": {"excess": 0.06},
    "sensor_lag": {"time_s": 0.3},
    "backlash": {"play_rad": 0.03},
    "link_stretch": {"strain_per_mpa": 1.0},
}


def effect(kind: str, **values: Any) -> EffectConfig:
    """Return the config of an effect; its strength is that of `VALUES` or `MORE_VALUES` unless values are given."""
    model = REGISTRY.get("effect", kind).config_model()
    return model.model_validate({"kind": kind, **(values or {**VALUES, **MORE_VALUES}[kind])})  # type: ignore[return-value]


def joint(modules: int = 1, **chain: Any) -> ChainModel:
    """Return a heavy finger, which gravity bends as much as a load does."""
    return sample_chain(modules=modules, payload=0.03, **chain)


def make_history(
    name: str, time_s: Array | None, pressure: Array, specimen: str = "A", **conditions: Any
) -> History:
    """Return a history of the pressure."""
    return History.from_arrays({"pressure_pa": pressure}, time_s, run=name, specimen=specimen, **conditions)


def ramp(name: str, rate: float, step_s: float, levels: Sequence[float] = (P, 0.0), **more: Any) -> History:
    """Return straight ramps with pauses of four seconds at each level."""
    time_s, pressure = triangles(levels, rate, step_s, holds_s=4.0)
    return make_history(name, time_s, pressure, **more)


def pushes(name: str, pressure: float, moment: float = 6e-3, **more: Any) -> History:
    """Return load steps of both signs at a constant pressure."""
    load = moment * np.repeat([0.0, 1.0, 0.0, -1.0, 0.5, 0.0], 10)
    return make_history(name, 0.5 * np.arange(60), np.full(60, pressure), moment_n_m=load, **more)


def rich(repeats: int = 2) -> list[History]:
    """Return runs at several rates, loads, orientations, temperatures and virgin specimens, each `repeats` times."""
    found = []
    for k in range(repeats):
        body = "AB"[k % 2]
        said = {"specimen": body}
        found += [
            ramp(f"virgin{k}", 3e3, 0.5, (0.4 * P, 0.0, 0.7 * P, 0.0, P, 0.0, P, 0.0), **said),
            ramp(f"slow{k}", 500.0, 1.0, **said),
            ramp(f"fast{k}", 15e3, 0.1, (P, 0.0, P, 0.0), **said),
            pushes(f"vented{k}", 0.0, **said),
            pushes(f"pressed{k}", 0.6 * P, **said),
            ramp(f"level{k}", 3e3, 0.5, base_angles_rad=[0.0, np.pi / 2, 0.0], **said),
            ramp(f"warm{k}", 3e3, 0.5, temperature_c=REFERENCE_TEMPERATURE_C + 15.0, **said),
        ]
    return found


def poor(repeats: int = 2) -> list[History]:
    """Return one slow sweep without load."""
    return [ramp(f"slow{k}", 500.0, 1.0) for k in range(repeats)]


def colour(rng: np.random.Generator, n: int, sigma: float, phi: float) -> Array:
    """Return stationary first-order autoregressive noise."""
    white = rng.normal(0, sigma * np.sqrt(1 - phi**2), n)
    white[0] = rng.normal(0, sigma)
    coloured: Array = lfilter([1.0], [1.0, -phi], white)
    return coloured


def make_measurement(
    histories: Sequence[History], readings: Sequence[dict[str, Array]], **more: Any
) -> Measurement:
    """Return readings as a measurement."""
    runs = [
        MeasuredRun(h, r, {}, np.ones(len(h)), np.arange(len(h)) + 2)
        for h, r in zip(histories, readings, strict=True)
    ]
    return Measurement(tuple(runs), tuple(readings[0]), source="bench.csv", **more)


def blank(histories: Sequence[History], outputs: Sequence[str] = ("angle_rad",)) -> Measurement:
    """Return the runs with zeros for readings."""
    return make_measurement(histories, [{name: np.zeros(len(h)) for name in outputs} for h in histories])


def measured(
    chain: ChainModel,
    histories: Sequence[History],
    *effects: EffectConfig,
    seed: int = 0,
    sigma: float = SIGMA,
    phi: float = 0.6,
    offset: float = 0.0,
    outputs: Sequence[str] = ("angle_rad",),
) -> Measurement:
    """Return the readings of a bench with these effects, with coloured noise and offsets between runs."""
    model = make_predictor(chain, blank(histories, outputs))
    close = dict.fromkeys(outputs, 0.05 * sigma) if sigma > 0.0 else None
    truth = model.refined(model.steps_between_samples(effects, close=close)).evaluate(effects).runs
    rng = np.random.default_rng(seed)
    noisy = [
        {
            name: values + rng.normal(0, offset) + colour(rng, len(values), sigma, phi)
            for name, values in run.items()
        }
        for run in truth
    ]
    return make_measurement(histories, noisy)


def make_predictor(chain: ChainModel, measurement: Measurement, *effects: EffectConfig) -> Predictor:
    """Return the chain driven by the measurement's histories; its law is exact and stated to be exact to 0.05 %."""
    return Predictor(BENCH, ENGINE, chain, measurement, effects, law_error=0.0005)


def make_fitter(predictor: Predictor, sigma: float = SIGMA) -> Fitter:
    """Return a fitter whose readings are in units of sigma."""
    scales = dict.fromkeys(predictor.outputs, sigma)
    return Fitter(predictor, ReadingVector.from_measurement(predictor.measurement, tuple(scales), scales))
