"""A learned curve for the error that no listed effect explains: smooth, bounded, and zero outside its data.

    f(x) = w(x) Σ_k v_k φ_k(x)

over one or two covariates x of a joint: values v_k at even knots, cubic between (Keys, IEEE Trans. Acoust.
29, 1981), with a window w that falls to 0 beyond the range that the data have (`pliant.mechanics.learned_curve`). It is
added to every input (Pa, N), to every joint's effort (`moment`, N·m) or to every angle that is read (rad), or is the
share by which the elastic or the actuation part of the law is larger. It is a model discrepancy in the sense of Kennedy
& O'Hagan (J. R. Stat. Soc. B 63, 2001): it describes the error without naming a cause. `pliant improve --learned` fits
it; its numbers are plain data, and removing the entry removes the effect.

Covariates, SI: `angle` and its `rate` r as r/(|r| + scale); `actuation`; `temperature` in °C; `time` in the run;
`travel`, the cycles up to `scale` and back that were done; `actuation_rate` as `rate`; `actuation_direction`
and `angle_direction`, from −1 to 1 within twice `scale` of motion (a stop); `actuation_change` and `angle_change`, x
less x behind a first-order lag of the time `scale`; `largest_angle` so far. `travel` and `largest_angle` continue from
run to run of one specimen. An `input` has no covariates of angles, a `reading` none of temperature and travel.
"""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from pliant.interfaces.base import FrozenModel
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, Readings
from pliant.mechanics.learned_curve import (
    KEPT,
    N_STATES,
    CovariateName,
    CurveAxis,
    Signals,
    basis,
    learned_value,
    numbers,
    series,
)
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.term import LawTerm
from pliant_plugins.effects.angles import with_recorded_angles

ActsOn = Literal["input", "moment", "elastic", "actuation", "reading"]
Values = tuple[float, ...] | tuple[tuple[float, ...], ...]
# Covariates of each place: an input has none of the chain, a reading none of the temperature.
KNOWN: dict[str, tuple[str, ...]] = {
    "input": (
        "actuation",
        "temperature",
        "time",
        "actuation_rate",
        "actuation_direction",
        "actuation_change",
    ),
    "reading": ("angle", "rate", "actuation", "time", "angle_direction", "angle_change"),
}
MOST_KNOTS = 64


class CovariateConfig(FrozenModel):
    """One covariate of the curve, and its range in the training data."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    name: CovariateName
    """which one"""
    low: float
    """lowest value in the data, SI (temperatures in degrees Celsius)"""
    high: float
    """highest value in the data"""
    scale: float = Field(default=1.0, gt=0.0)
    """its time constant, width or rate, SI; see the list of covariates"""


class LearnedConfig(EffectConfig):
    """The curve: where it acts, over what, and its values at even knots."""

    kind: Literal["learned"] = "learned"
    acts_on: ActsOn = "moment"
    """where the curve is added, or which part of the law it makes larger by a share"""
    covariates: tuple[CovariateConfig, ...] = Field(default=(), max_length=2)
    """what it depends on: one or two; none is no curve"""
    value: Values = ()
    """at even knots from `low` to `high`; of two covariates a row for each knot of the first"""
    sd: Values | None = None
    """standard deviations of the values, for the band that is drawn"""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if not self.covariates and not self.value and not self.sd:
            return self  # no curve
        shape = np.shape(self.value) if _is_even(self.value) else ()
        if len(shape) != len(self.covariates) or not all(2 <= n <= MOST_KNOTS for n in shape):
            raise ValueError(
                "'value' needs 2 to 64 numbers for one covariate, and as many rows of as many numbers for two"
            )
        if self.sd is not None and (not _is_even(self.sd) or np.shape(self.sd) != shape):
            raise ValueError("'sd' needs as many numbers as 'value'")
        names = [one.name for one in self.covariates]
        for one in self.covariates:
            if not one.low < one.high:
                raise ValueError(f"covariate '{one.name}': 'low' must be below 'high'")
            known = KNOWN.get(self.acts_on)
            if known and one.name not in known:
                raise ValueError(
                    f"acts_on '{self.acts_on}' has no covariate '{one.name}'; it has {', '.join(known)}"
                )
        if len(set(names)) < len(names) and any(a == b for a, b in pairwise(self.covariates)):
            raise ValueError(f"covariate '{names[0]}' is stated twice")
        lasting = [axis.name in KEPT for axis in self.axes() if axis.has_memory]
        if len(set(lasting)) > 1:
            raise ValueError(
                f"{' and '.join(names)} cannot be combined: one continues from run to run of a specimen, the other "
                "starts again with each run"
            )
        return self

    def axes(self) -> tuple[CurveAxis, ...]:
        """Return the covariates with their knots."""
        shape = np.shape(self.value) if self.covariates else ()
        return tuple(
            CurveAxis(c.name, c.low, c.high, n, c.scale) for c, n in zip(self.covariates, shape, strict=True)
        )


def _is_even(values: Values) -> bool:
    """Check whether all rows have the same length."""
    return len({len(row) if isinstance(row, tuple) else -1 for row in values}) == 1


class Learned(Effect):
    """A curve that was learned from runs."""

    place = "law"  # of a curve that acts on a law: others act where `acts_on` says
    fitted = False
    notes = EffectNotes(
        signature="none of its own: it describes the error that no listed effect explains, over the "
        "covariates that explain most of it.",
        inspection="look for what changes with the covariate that it depends on, and at the place where it "
        "acts.",
        distinguishing_test="a listed effect that predicts as well is the better answer: it holds outside "
        "the data too.",
        excitation="widen the range of the covariate, and repeat a run in its middle.",
        where="every family; curves of the law or with memory in engines that follow histories.",
    )
    config: LearnedConfig

    def apply(self, model: Model) -> Model:
        """Return the model with the curve at the place that `acts_on` names."""
        c, axes = self.config, self.config.axes()
        if not axes:
            return model
        values = np.asarray(c.value, float)
        if c.acts_on == "input":
            names = tuple(actuator.input for actuator in model.chain.actuators)
            return model.with_input(partial(_pushed, names, axes, values.ravel()))
        if c.acts_on == "reading":
            return model.with_output(partial(_read, axes, values.ravel()))
        memory = [axis for axis in axes if axis.has_memory]
        term = LawTerm(
            c.acts_on,
            learned_value,
            numbers(axes, values, c.acts_on != "moment"),
            n_states=N_STATES * len(memory),
            keeps=any(axis.name in KEPT for axis in memory),
            needs_time=bool(memory) or any(axis.name == "rate" for axis in axes),
        )
        return model.with_term(term)


def _pushed(names: tuple[str, ...], axes: tuple[CurveAxis, ...], values: Array, history: History) -> History:
    """Return the history with the curve added to these inputs."""
    present = [name for name in dict.fromkeys(names) if name in history.actuation]
    return history.with_actuation(
        **{name: history.actuation[name] + _input_weights(history, name, axes) @ values for name in present}
    )


@lru_cache(maxsize=256)
def _input_weights(history: History, name: str, axes: tuple[CurveAxis, ...]) -> Array:
    """Return (t, K) weights of the values on one input; cached by history, which a fit does not change."""
    level = history.actuation[name]
    run = Signals(np.zeros(len(history)), level, history.temperature_c, history.time_s)
    return basis(axes, [series(axis, run) for axis in axes])


def _read(axes: tuple[CurveAxis, ...], values: Array, readings: Readings) -> Readings:
    """Return the readings with the curve added to every recorded angle; others lack its covariates."""
    time_s, pushed = readings.get("time_s"), readings.get("actuation")
    needs = {axis.name for axis in axes}
    timed = isinstance(time_s, np.ndarray) and time_s.ndim == 1
    if ("actuation" in needs and pushed is None) or (needs & {"time", "rate", "angle_change"} and not timed):
        return readings

    def changed(angle: Any) -> Any:
        none = np.zeros(len(angle))
        level = none if pushed is None else np.broadcast_to(np.asarray(pushed, float), angle.shape)
        run = Signals(angle, level, none, time_s if timed and len(time_s) == len(angle) else None)  # type: ignore[arg-type]
        return angle + basis(axes, [series(axis, run) for axis in axes]) @ values

    return with_recorded_angles(readings, changed)
