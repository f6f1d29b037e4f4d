"""Formulas in the place of chains: the predictor interface that the fitter uses, with answers known by hand."""

from __future__ import annotations

import numpy as np

from pliant.diagnosis.candidates import EffectSet, FitParameter
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.readings import ReadingVector
from pliant.evidence.measured_model import Prediction
from pliant.interfaces.effect import EffectConfig, EffectParameter
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement


class Formula(EffectConfig):
    """A config of two numbers."""

    kind: str = "formula"
    a: float = 0.0
    b: float = 0.0


class FormulaPredictor:
    """y(t) of each run by `function(clock, a, b)`; slopes by differences, as the engine's are to first order."""

    costly_slopes = False

    def __init__(self, function, clocks):
        self.function, self.clocks = function, clocks

    def _readings(self, configs):
        config = configs[0]
        return tuple({"angle_rad": self.function(t, config.a, config.b)} for t in self.clocks)

    def evaluate(self, configs):
        return Prediction(self._readings(configs), 0)

    def refined(self, parts):
        return self

    def steps_between_samples(self, effects=(), least=1, close=None):
        return least

    def vary(self, configs, towards):
        base = self._readings(configs)
        changes = tuple(
            tuple({"angle_rad": b["angle_rad"] - a["angle_rad"]} for a, b in zip(base, there, strict=True))
            for there in map(self._readings, towards)
        )
        return Prediction(base, 0), changes


def parameter(name, neutral=0.0, bounds=(-100.0, 100.0), plausible=(-10.0, 10.0), **more):
    return EffectParameter(name, "1", neutral, bounds, plausible, **more)


def candidate(*parameters):
    return EffectSet(("formula",), tuple(FitParameter(0, "formula", p) for p in parameters), (Formula,))


def measured(readings, clocks, levels=None):
    """Return runs at one pressure each; runs of one pressure are repeats."""
    levels = range(len(clocks)) if levels is None else levels
    runs = tuple(
        MeasuredRun(
            History.from_arrays({"pressure_pa": np.full(len(t), 1e3 * level)}, t, run=f"r{k}"),
            {"angle_rad": y},
            {},
            np.ones(len(t)),
            np.zeros(0),
        )
        for k, (t, y, level) in enumerate(zip(clocks, readings, levels, strict=True))
    )
    return Measurement(runs, ("angle_rad",), "formula.csv")


def fitter(function, measurement, scale=1.0):
    clocks = [run.history.time_s for run in measurement.runs]
    readings = ReadingVector.from_measurement(measurement, ("angle_rad",), {"angle_rad": scale})
    return Fitter(FormulaPredictor(function, clocks), readings)
