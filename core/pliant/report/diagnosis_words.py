"""A diagnosis in words and numbers for people: parameters in display units, what changes, what to do."""

from __future__ import annotations

import math
from typing import Any

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.diagnosis_json import parameters
from pliant.diagnosis.table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.uncertainty import Estimate
from pliant.diagnosis.words import named
from pliant.formatting import display_unit, number, rounded_to_sd, whole_percent, with_sd

IMPLAUSIBLE = "implausible"
CLOSE = 2.0  # standard deviations


def parameter_texts(found: Diagnosis, kinds: Kinds) -> list[str]:
    """Each parameter of a hypothesis: ``share 0.213 ± 0.004``; implausible values say so."""
    if kinds in (NOTHING, UNKNOWN):
        return []
    entries = parameters(found, kinds)
    limits = set(found.table.rows[kinds].at_limit)
    texts = []
    for name, entry in entries.items():
        kind, _, parameter = name.partition(".")
        prefix = f"{kind} " if len(kinds) > 1 else ""
        texts.append(
            f"{prefix}{parameter_word(parameter, entry['unit'])} {value_text(entry)}{_flag(entry, name in limits)}"
        )
    return texts


def value_text(entry: dict[str, Any]) -> str:
    """Value ± standard deviation with the unit, the value to the decimal at which it is not sure."""
    return with_sd(entry["value"], entry["sd"], display_unit(entry["unit"]))


def estimate_cells(estimate: Estimate) -> list[str]:
    """Name, value, standard deviation, interval and unit of a fitted parameter, in its display unit."""
    unit = display_unit(estimate.unit)
    value, sd, low, high = (
        v * unit.factor for v in (estimate.value, estimate.sd, estimate.low, estimate.high)
    )
    ends = ("…" if estimate.open_low else number(low, 3), "…" if estimate.open_high else number(high, 3))
    return [estimate.name, rounded_to_sd(value, sd), number(sd, 2), " to ".join(ends), unit.symbol]


def probability_text(share: float) -> str:
    """A probability; what is nearly sure is not called sure."""
    return "over 99 %" if share > 0.99 else whole_percent(share)


def strength_text(value: float, unit: str) -> str:
    """A strength in its display unit."""
    return display_unit(unit).text(value, 2)


def implausible(found: Diagnosis, kinds: Kinds) -> list[str]:
    """Parameters of a hypothesis outside their plausible range, in words."""
    if kinds in (NOTHING, UNKNOWN):
        return []
    registry = {knob.name: knob.parameter for knob in found.fits[kinds].candidate.knobs}
    texts = []
    for name, entry in parameters(found, kinds).items():
        if not entry["plausible"]:
            low, high = (strength_text(v, entry["unit"]) for v in registry[name].plausible)
            texts.append(
                f"the fitted {name}, {value_text(entry)}, is outside its plausible range, {low} to {high}"
                f"{_how_far(entry, registry[name].plausible)}"
            )
    return texts


def _how_far(entry: dict[str, Any], plausible: tuple[float, float]) -> str:
    beyond = max(plausible[0] - entry["value"], entry["value"] - plausible[1])
    if beyond < CLOSE * entry["sd"]:
        return ", but not by more than its own uncertainty"
    return ": the number stands in for something that the model lacks"


def numbers_text(found: Diagnosis) -> str:
    """What the verdict rests on, in numbers: errors on runs left out before and after, probabilities; may be empty."""
    best = next((kinds for kinds in found.judgement.probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    before, after = (
        found.table.over_floor(found.table.rows[kinds].heldout_square) for kinds in (NOTHING, best)
    )
    if not math.isfinite(before) or found.verdict in ("not_repeatable", "insufficient_data"):
        return ""
    fall = f"the error on runs left out of the fit falls from {before:.2f} to {after:.2f} × the noise floor"
    if found.verdict == "unknown_effect":
        return f"Even with {named(best)}, the most probable in the list, {fall} only."
    if found.verdict == "missing_effect":
        return (
            f"With {named(best)} {fall} (probability {probability_text(found.judgement.probability[best])})."
        )
    if found.verdict == "nothing_missing":
        return f"The model as it is leaves an error of {before:.2f} × the noise floor."
    probable = [
        f"{named(k)} {probability_text(found.judgement.probability[k])}" for k in found.judgement.credible[:4]
    ]
    return f"The model as it is leaves {before:.2f} × the noise floor. Probabilities: {', '.join(probable)}."


def parameter_word(parameter: str, unit: str) -> str:
    """A parameter's name without the unit that stands behind its value."""
    for suffix, of in (("_pa", "Pa"), ("_rad", "rad"), ("_s", "s"), ("_per_k", "K^-1")):
        if unit == of:
            parameter = parameter.removesuffix(suffix)
    return parameter.replace("_", " ")


def _flag(entry: dict[str, Any], at_limit: bool) -> str:
    flags = [] if entry["plausible"] else [IMPLAUSIBLE]
    flags += ["at its bound"] if at_limit else []
    return f" ({', '.join(flags)})" if flags else ""
