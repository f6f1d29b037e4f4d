"""Good effects, an actuation gain at the law and as a law term, and effects that reach where they should not."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from broken import Variants
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, Place, Readings, parameter
from pliant.mechanics.law_around import LawAround
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.law import Effort
from pliant.records.term import LawTerm, TermFunction
from pliant.registry.component import Component
from pliant.units import Ratio

PARAMETER: dict[str, Any] = {"neutral": 1.0, "bounds": (0.1, 10.0), "plausible": (0.8, 1.2)}


class GainConfig(EffectConfig):
    """A factor on the pressure that reaches the law."""

    kind: Literal["small"] = "small"
    gain: Ratio = parameter(**PARAMETER)


@dataclass(frozen=True, eq=False)
class GainedLaw(LawAround):
    """τ(g p, u)."""

    gain: float

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        inner = self.law.evaluate(self.gain * actuation, deformation)
        return replace(inner, dtau_dp=self.gain * inner.dtau_dp)


class Gain(Effect):
    """Wraps every law."""

    place: ClassVar[Place] = "law"
    exciting: ClassVar[tuple[str, ...]] = ("slow_cycles", "passive_load_steps")
    config: GainConfig
    law: ClassVar[type[GainedLaw]] = GainedLaw

    def apply(self, model: Model) -> Model:
        laws = tuple(self.law(law, self.config.gain) for law in model.chain.laws)
        return model.with_(chain=model.chain.with_(laws=laws))


variants = Variants(
    Component("effect", "small", "broken.effect:GainConfig", "broken.effect:Gain", "a gain", {"gain": 1.1})
)


@variants.by("declares_place_and_parameters", "place is 'nowhere'")
class Nowhere(Gain):
    """Acts at no place that there is."""

    place = "nowhere"  # type: ignore[assignment]


@variants.by_config("declares_place_and_parameters", r"the unit 'furlong..2' is not known")
class UnknownUnit(GainConfig):
    """A parameter in a unit that nobody reads."""

    gain: float = parameter(unit="furlong^^2", **PARAMETER)


@variants.by_config("has_a_strength", "which one makes the effect vanish")
class OnlyShape(GainConfig):
    """Calls its gain a shape."""

    gain: Ratio = parameter(**PARAMETER, role="shape")


@variants.by_config("has_a_strength", "the effect has no parameters")
class NothingToFit(GainConfig):
    """A plain field."""

    gain: Ratio = 1.0


@variants.by_config("config_keeps_the_bounds", "Input should be less than or equal to 5")
class NarrowConfig(GainConfig):
    """A second limit that the parameter does not know."""

    gain: Annotated[Ratio, Field(le=5.0)] = parameter(**PARAMETER)


@variants.by_config("config_keeps_the_bounds", "outside the bounds")
class WideConfig(GainConfig):
    """Takes any number."""

    @field_validator("gain", mode="wrap")
    @classmethod
    def _any(cls, value: float, handler: Any) -> float:
        return value


@variants.by_config("neutral_values_change_nothing", "every strength neutral the law differs")
class NeverNeutral(GainConfig):
    """Neutral is said to be 0.9."""

    gain: Ratio = parameter(**{**PARAMETER, "neutral": 0.9})


@variants.by("plausible_values_change_something", "parameter 'gain' has no effect")
@variants.by("a_run_shows_it", "the same with and without the effect")
class Unused(Gain):
    """Forgets its parameter."""

    def apply(self, model: Model) -> Model:
        return model


@variants.by("acts_only_at_its_place", "place 'law' changed the chain")
class Lightens(Gain):
    """Also takes the payload off."""

    def apply(self, model: Model) -> Model:
        changed = super().apply(model)
        return changed.with_(chain=changed.chain.with_(payload_kg=0.0))


@variants.by("leaves_the_model_alone", "changed in place")
class InPlace(Gain):
    """Turns gravity round in the caller's chain."""

    def apply(self, model: Model) -> Model:
        model.chain.gravity_m_s2[:] *= -1
        return super().apply(model)


@variants.by("keeps_earlier_effects", "maps of effects applied before are lost")
class StartsAnew(Gain):
    """Makes a new model from the chain alone."""

    def apply(self, model: Model) -> Model:
        return Model(super().apply(model).chain)


class UnslopedLaw(GainedLaw):
    """Values with the gain, slopes without."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        return replace(good, dtau_dp=self.law.evaluate(actuation, deformation).dtau_dp)


@variants.by("wrapped_laws_stay_laws", "dtau_dp of the wrapped law is not the slope")
class ForgetsTheSlope(Gain):
    """Its law's ∂τ/∂p lacks the gain."""

    law = UnslopedLaw


class Misspelt(Gain):
    """Reads a parameter that its config does not have; no single check is about this."""

    def apply(self, model: Model) -> Model:
        return model.with_(chain=model.chain.with_(payload_kg=self.config.gian))  # type: ignore[attr-defined]


# -- maps ------------------------------------------------------------------------------------------


@variants.by("input_maps_keep_the_run", "an input map returned None, no History")
@variants.by("model_runs_under_a_task", "AttributeError|NoneType")
class ReturnsNothing(Gain):
    """Its input map forgets to return."""

    place = "input"

    def apply(self, model: Model) -> Model:
        def forget(history: History) -> Any:
            np.multiply(1.1, history.moment_n_m)

        return model.with_input(forget)


@variants.by("input_maps_keep_the_run", "it raised .*Error in ")
class NeedsAClock(Gain):
    """Its input map divides by time steps that are not there."""

    place = "input"

    def apply(self, model: Model) -> Model:
        def rated(history: History) -> History:
            return history.with_(moment_n_m=history.moment_n_m + np.gradient(history.time_s))

        return model.with_input(rated)


@variants.by("output_maps_keep_the_readings", "lost .*tip_x_m")
class LosesReadings(Gain):
    """Its output map returns the angles only."""

    place = "output"

    def apply(self, model: Model) -> Model:
        gain = self.config.gain

        def angles(readings: Readings) -> Readings:
            return {"angle_rad": gain * readings["angle_rad"]}

        return model.with_output(angles)


# -- law terms -------------------------------------------------------------------------------------


class TermGain(Gain):
    """The same gain as a law term; parts of it break the term."""

    term: ClassVar[LawTerm]

    def apply(self, model: Model) -> Model:
        return model.with_term(replace(self.term, parameters=(self.config.gain - 1.0,)))


def broken_term(
    check: str, says: str, n_states: int = 0, needs_time: bool = True, is_inertia: bool = False
) -> Callable[[TermFunction], TermFunction]:
    """Decorator: a function of a law term that breaks one check."""

    def register(function: TermFunction) -> TermFunction:
        term = replace(LawTerm("moment", function, (), n_states, False, needs_time), is_inertia=is_inertia)
        members = {"term": term, "__doc__": function.__doc__, "__module__": __name__}
        name = f"With{function.__name__}"
        globals()[name] = variants.by(check, says)(type(name, (TermGain,), members))
        return function

    return register


@broken_term("terms_write_new_and_leave_old", "changed `old` in place", n_states=1)
def _changes_old(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """Counts in the past."""
    new[0] = old[0]
    old[0] += 1.0
    return -1e-3 * c[0] * new[0]


@broken_term("terms_write_new_and_leave_old", "`new` arrives unset", n_states=1)
def _leaves_new(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """Writes its memory only where it changes."""
    if u > 0.3:
        new[0] = u
    return -1e-3 * c[0] * u


@broken_term("terms_that_use_time_say_so", "needs_time is False", needs_time=False)
def _damps(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """A dashpot that says it needs no time."""
    return -0.01 * c[0] * rate


CALLS = np.zeros(1)


@broken_term("terms_remember_in_states_only", "a global or a mutable default")
def _counts_calls(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """Keeps its memory in a global."""
    CALLS[0] += 1.0
    return 1e-3 * c[0] * float(np.sin(CALLS[0]))


@broken_term(
    "terms_are_the_same_compiled", r"effect.py, line \d+: the law term '_by_name' cannot be compiled"
)
def _by_name(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """Uses what the compiler does not know."""
    share = {"share": c[0]}
    return -0.01 * float(str(share["share"])) * u


@broken_term("terms_are_the_same_compiled", "in plain Python differ in run", needs_time=False)
def _overflows(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """Reckons with integers that only Python lets grow."""
    picoradians = int(1e12 * u)
    return 1e-25 * c[0] * float(picoradians * picoradians)


@broken_term("terms_keep_the_joint_stable", "the joint snaps", needs_time=False)
def _pushes(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """A spring that pushes away, stiffer than the joint."""
    return c[0] * u


@broken_term("terms_make_no_energy", "a sign")
def _drives(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """A dashpot with the wrong sign."""
    return 0.01 * c[0] * rate


@broken_term("terms_do_not_count_samples", "advance with dt_s", n_states=1)
def _forgets(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """Its memory fades by a tenth per sample, however long that is."""
    new[0] = 0.9 * old[0] + 0.1 * u
    return 0.01 * c[0] * (new[0] - u)


@broken_term("terms_do_not_count_samples", "a swing of .* differs", n_states=2, is_inertia=True)
def _lags(u: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    """A mass whose acceleration is the change of a rate from sample to sample."""
    new[0] = old[0] + 0.2 * (rate - old[0])
    new[1] = new[0] - old[0]
    return -0.2 * c[0] * c[0] * new[1]


# -- effects that a diagnosis would not find: no run is named, a run shows nothing, a neighbour in disguise

CHECK = "is_found_when_injected"


@variants.by(CHECK, r"declare exciting = \(.*slow_cycles")
class NamesNoRun(Gain):
    """Nobody knows how to show it."""

    exciting = ()


@variants.by(CHECK, "'slow_cycle', which is no run of the menu; did you mean 'slow_cycles'")
class NamesAnotherRun(Gain):
    """A run that is not in the menu."""

    exciting = ("slow_cycle",)


@variants.by(CHECK, "Nothing is missing.*These runs do not show it")
class ActsInTheWarmOnly(Gain):
    """A gain above the reference temperature, and no warm run among its own."""

    place = "input"

    def apply(self, model: Model) -> Model:
        gain = self.config.gain

        def warmed(history: History) -> History:
            share = 1.0 + (gain - 1.0) * (history.temperature_c > REFERENCE_TEMPERATURE_C + 5.0)
            return history.with_actuation(**{name: share * p for name, p in history.actuation.items()})

        return model.with_input(warmed)


@variants.by(CHECK, "cannot tell it from actuation_gain, its look-alike")
class Disguised(Gain):
    """A factor on the pressure by another name, which says that its runs tell it from `actuation_gain`."""

    notes: ClassVar[EffectNotes] = replace(Gain.notes, look_alike="actuation_gain")
