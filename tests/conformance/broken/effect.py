"""Correct effects, an actuation gain at the law and as a law term, and effects that change what they should not."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator
from tests.conformance.broken import Variants

from pliant.interfaces.effect import Effect, EffectConfig, Model, Place, parameter
from pliant.mechanics.law_wrapper import LawWrapper
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.law import Effort
from pliant.records.term import LawTerm
from pliant.registry.component import Component
from pliant.units import Ratio

PARAMETER: dict[str, Any] = {"neutral": 1.0, "bounds": (0.1, 10.0), "plausible": (0.8, 1.2)}


class GainConfig(EffectConfig):
    """A factor on the pressure that reaches the law."""

    kind: Literal["small"] = "small"
    gain: Ratio = parameter(**PARAMETER)


@dataclass(frozen=True, eq=False)
class GainedLaw(LawWrapper):
    """τ(g p, u)."""

    gain: float

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        inner = self.law.evaluate(self.gain * actuation, deformation)
        return replace(inner, dtau_dp=self.gain * inner.dtau_dp)


class Gain(Effect):
    """An effect that wraps every law."""

    place: ClassVar[Place] = "law"
    recommended_experiments: ClassVar[tuple[str, ...]] = ("slow_cycles", "passive_load_steps")
    config: GainConfig
    law: ClassVar[type[GainedLaw]] = GainedLaw

    def apply(self, model: Model) -> Model:
        laws = tuple(self.law(law, self.config.gain) for law in model.chain.laws)
        return model.with_(chain=model.chain.with_(laws=laws))


class TermGain(Gain):
    """The same gain as a law term; changing parts of it breaks the term."""

    term: ClassVar[LawTerm]

    def apply(self, model: Model) -> Model:
        return model.with_term(replace(self.term, parameters=(self.config.gain - 1.0,)))


class Misspelt(Gain):
    """An effect that reads a parameter missing from its config; no single check covers this."""

    def apply(self, model: Model) -> Model:
        return model.with_(chain=model.chain.with_(payload_kg=self.config.gian))  # type: ignore[attr-defined]


class Misstated(Gain):
    """An effect that repeats its config with a misspelt key; no single check covers this."""

    def apply(self, model: Model) -> Model:
        return Gain(GainConfig(gian=self.config.gain)).apply(model)  # type: ignore[call-arg]


variants = Variants(
    Component("effect", "small", f"{__name__}:GainConfig", f"{__name__}:Gain", "a gain", {"gain": 1.1})
)
broken, broken_law = variants.row_adder(Gain), variants.row_adder(Gain, "law")

# -- declarations


@variants.by_config("declares_place_and_parameters")
class UnknownUnit(GainConfig):
    """A config with a parameter in an unknown unit."""

    gain: float = parameter(unit="furlong^^2", **PARAMETER)


@variants.by_config("has_a_strength")
class OnlyShape(GainConfig):
    """An effect that declares its gain as a shape."""

    gain: Ratio = parameter(**PARAMETER, role="shape")


@variants.by_config("has_a_strength")
class NothingToFit(GainConfig):
    """An effect with a plain field and nothing to fit."""

    gain: Ratio = 1.0


@variants.by_config("says_where_a_simpler_form_is_enough")
class SilentAtItsBound(GainConfig):
    """An effect with a shape that starts at its bound, so that a fit ending there would raise an alarm."""

    rise: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.1, 0.5), role="shape")


@variants.by_config("config_keeps_the_bounds")
class NarrowConfig(GainConfig):
    """A config with a second limit that the parameter does not have."""

    gain: Annotated[Ratio, Field(le=5.0)] = parameter(**PARAMETER)


@variants.by_config("config_keeps_the_bounds")
class WideConfig(GainConfig):
    """A config that accepts any number."""

    @field_validator("gain", mode="wrap")
    @classmethod
    def _any(cls, value: float, handler: Any) -> float:
        return value


@variants.by_config("neutral_values_change_nothing")
class NeverNeutral(GainConfig):
    """An effect that declares 0.9 as its neutral value."""

    gain: Ratio = parameter(**{**PARAMETER, "neutral": 0.9})


broken("declares_place_and_parameters", place="nowhere")

# -- models and maps


def mapped(check: str, function: Callable[[float, Any], Any], place: str = "input") -> None:
    """Add a row: the effect is a map of inputs or readings, a function of the gain and of the mapped value."""

    def apply(up: Any, self: Any, model: Model) -> Model:
        mapping = {"input": model.with_input, "output": model.with_output}[place]
        return mapping(lambda given: function(self.config.gain, given))

    broken(check, place=place, apply=apply)


def _without_payload(up: Any, self: Any, model: Model) -> Model:
    changed: Model = up(model)
    return changed.with_(chain=changed.chain.with_(payload_kg=0.0))


def _upside_down(up: Any, self: Any, model: Model) -> Model:
    model.chain.gravity_m_s2[:] *= -1  # the caller's
    return up(model)  # type: ignore[no-any-return]


def _unsloped(up: Any, self: Any, p: Array, u: Array) -> Effort:
    return replace(up(p, u), dtau_dp=self.law.evaluate(p, u).dtau_dp)


def _in_the_warm_only(gain: float, history: History) -> History:
    share = 1.0 + (gain - 1.0) * (history.temperature_c > REFERENCE_TEMPERATURE_C + 5.0)
    return history.with_actuation(**{name: share * p for name, p in history.actuation.items()})


for check in ("plausible_values_change_something", "a_run_shows_it"):
    broken(check, apply=lambda up, self, model: model)
broken("says_which_recordings_it_suits", unsuited=lambda up, self, chain, histories: "no run is good enough")
broken("says_which_recordings_it_suits", unsuited=lambda up, self, chain, histories: None)
broken("acts_only_at_its_place", apply=_without_payload)
broken("leaves_the_model_alone", apply=_upside_down)
broken("keeps_earlier_effects", apply=lambda up, self, model: Model(up(model).chain))
broken_law("wrapped_laws_stay_laws", evaluate=_unsloped)
for check in ("input_maps_keep_the_run", "model_runs_under_a_task"):
    mapped(check, lambda gain, history: None)
mapped(
    "input_maps_keep_the_run",
    lambda gain, history: history.with_(moment_n_m=history.moment_n_m + np.gradient(history.time_s)),
)
mapped(
    "output_maps_keep_the_readings",
    lambda gain, readings: {"angle_rad": gain * readings["angle_rad"]},
    "output",
)

# -- effects that a diagnosis would not find: no run is named, a run shows nothing, a mimic of another effect

CHECK = "is_found_when_injected"
broken(CHECK, recommended_experiments=())
broken(CHECK, recommended_experiments=("slow_cycle",))
mapped(CHECK, _in_the_warm_only)
broken(CHECK, notes=replace(Gain.notes, confounder="actuation_gain"))

# -- law terms


def broken_term(
    check: str, n_states: int = 0, needs_time: bool = True, is_inertia: bool = False
) -> Callable[[Any], Any]:
    """Return a decorator for a function of a law term that breaks one check."""

    def register(function: Any) -> Any:
        term = replace(LawTerm("moment", function, (), n_states, False, needs_time), is_inertia=is_inertia)
        variants.row_adder(TermGain)(check, term=term)
        return function

    return register


@broken_term("terms_write_new_and_leave_old", n_states=1)
def _changes_old(u, rate, dt, p, t, old, new, c):
    new[0] = old[0]
    old[0] += 1.0
    return -1e-3 * c[0] * new[0]


@broken_term("terms_write_new_and_leave_old", n_states=1)
def _leaves_new(u, rate, dt, p, t, old, new, c):
    if u > 0.3:
        new[0] = u
    return -1e-3 * c[0] * u


@broken_term("terms_that_use_time_say_so", needs_time=False)
def _damps(u, rate, dt, p, t, old, new, c):
    return -0.01 * c[0] * rate


CALLS = np.zeros(1)


@broken_term("terms_remember_in_states_only")
def _counts_calls(u, rate, dt, p, t, old, new, c):
    CALLS[0] += 1.0
    return 1e-3 * c[0] * float(np.sin(CALLS[0]))


@broken_term("terms_are_the_same_compiled")
def _by_text(u, rate, dt, p, t, old, new, c):
    return -0.01 * float(str(c[0])) * u


@broken_term("terms_are_the_same_compiled", needs_time=False)
def _overflows(u, rate, dt, p, t, old, new, c):
    picoradians = int(1e12 * u)  # only Python integers are unbounded
    return 1e-25 * c[0] * float(picoradians * picoradians)


@broken_term("terms_keep_the_joint_stable", needs_time=False)
def _pushes(u, rate, dt, p, t, old, new, c):
    return c[0] * u


@broken_term("terms_make_no_energy")
def _drives(u, rate, dt, p, t, old, new, c):
    return 0.01 * c[0] * rate


@broken_term("terms_do_not_count_samples", n_states=1)
def _forgets(u, rate, dt, p, t, old, new, c):
    new[0] = 0.9 * old[0] + 0.1 * u  # a tenth per sample, independent of its duration
    return 0.01 * c[0] * (new[0] - u)


@broken_term("terms_do_not_count_samples", n_states=2, is_inertia=True)
def _lags(u, rate, dt, p, t, old, new, c):
    new[0] = old[0] + 0.2 * (rate - old[0])
    new[1] = new[0] - old[0]  # an acceleration computed from sample to sample
    return -0.2 * c[0] * c[0] * new[1]
