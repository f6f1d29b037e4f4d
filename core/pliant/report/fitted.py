"""What documents of fitted effects share: parameters with their uncertainty, errors, floors, remarks, runs to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pliant.diagnosis.evidence_table import NOTHING, Kinds
from pliant.diagnosis.next_run import NextRun
from pliant.diagnosis.readings import Score
from pliant.diagnosis.uncertainty import Estimate, Uncertainty
from pliant.diagnosis.verdict import Judgement
from pliant.formatting import Unit, display_unit, number, rounded_to_sd, whole_percent, with_sd
from pliant.measurements.floors import Floor
from pliant.records.remark import Remark
from pliant.registry.discovery import Registry
from pliant.report.document import Column, Table, Warned, as_json, brief_table, page_table
from pliant.units import si_unit

CLOSE = 2.0  # standard deviations
Written = tuple[Estimate, float]  # a parameter, and its value as a study has it


def _unit(written: Written) -> Unit:
    return display_unit(written[0].unit)


def _low(written: Written) -> str:
    return "…" if written[0].open_low else number(written[0].low * _unit(written).factor, 3)


def _high(written: Written) -> str:
    return "…" if written[0].open_high else number(written[0].high * _unit(written).factor, 3)


def _value(written: Written) -> str:
    one, factor = written[0], _unit(written).factor
    return rounded_to_sd(one.value * factor, one.sd * factor)


PARAMETER_COLUMNS: tuple[Column[Written], ...] = (
    Column("0.name", "", "parameter", "parameter"),
    Column("1", "value", "value", "value", _value),
    Column("0.sd", head="sd", brief="sd", text=lambda w: number(w[0].sd * _unit(w).factor, 2)),
    Column("0.low", head="90 % from", text=_low),
    Column("0.high", head="to", text=_high),
    Column("0.name", "", brief="90 % interval", text=lambda w: f"{_low(w)} to {_high(w)}"),
    Column("0.open_low"),
    Column("0.open_high"),
    Column("0.parameter.unit", head="unit", brief="unit", text=lambda w: _unit(w).symbol),
    Column("0.plausible"),
    Column("0.at_limit"),
    Column("0.includes_neutral"),
    Column("0.remarks", "", " ", show=", ".join),
)


def _written(found: Uncertainty, values: Mapping[str, float] | None) -> list[Written]:
    return [(one, one.value if values is None else values[one.name]) for one in found.estimates]


def parameters_json(found: Uncertainty | None, values: Mapping[str, float] | None = None) -> dict[str, Any]:
    """By ``kind.name``; `values` are those of a written study where they are rounded."""
    if found is None:
        return {}
    return {one[0].name: as_json(PARAMETER_COLUMNS, one) for one in _written(found, values)}


def parameters_brief(found: Uncertainty) -> Table:
    """Value, uncertainty and interval of each parameter, for the terminal."""
    return brief_table(PARAMETER_COLUMNS, _written(found, None))


def parameters_table(found: Uncertainty, title: str, note: str) -> Table:
    """The same for the page, with what is to be doubted."""
    return page_table(title, PARAMETER_COLUMNS, _written(found, None), note)


def doubtful(found: Uncertainty) -> list[str]:
    """What speaks against values, a sentence each."""
    return [f"{one.name}: {doubt}" for one in found.estimates for doubt in one.doubts]


def floors_json(floors: Mapping[str, Floor]) -> dict[str, Any]:
    """Noise floor of each output."""
    keys = ("value", "unit", "source", "se")
    return {name: {key: getattr(floor, key) for key in keys} for name, floor in floors.items()}


def errors_json(found: Score) -> dict[str, Any]:
    """RMS error of each output in its SI unit."""
    return {name: {"rmse": value, "unit": si_unit(name)} for name, value in found.rmse.items()}


def verdict_json(found: Judgement) -> dict[str, Any]:
    """The verdict, why, and what is left; of measurements and of counts."""
    said = [found.sentence] if found.verdict == "ambiguous" else []
    return {
        "verdict": found.verdict,
        "sentence": found.sentence,
        "reasons": list(found.reasons) or said,
        "selected": list(found.selected),
        "selected_class": list(found.selected_class),
        "beside_class": list(found.beside),
        "credible_set": [list(kinds) for kinds in found.credible],
    }


def next_run_json(found: NextRun | None, file: str | None = None) -> dict[str, Any] | None:
    """A proposed run; `file` is its protocol file."""
    if found is None:
        return None
    said = {key: value for key, value in vars(found).items() if key != "planned"}
    return {**said, "ranked": [asdict(one) for one in found.ranked], "file": file}


def caveat(text: str) -> Warned:
    """A remark as a warning with its rank."""
    return Warned(text, rank=Remark.of(text).rank)


def warned(registry: Registry, remarks: Sequence[str], asked: Sequence[str] = ()) -> tuple[Warned, ...]:
    """Remarks as warnings: shipped effects that the chain cannot have stand together, unless asked for by name."""
    shipped = {
        component.kind
        for component in registry.components
        if component.interface == "effect" and component.implementation.startswith("pliant_plugins.")
    } - set(asked)
    plain, impossible = [], {}
    for text in remarks:
        kind = Remark.of(text).left_out
        if kind in shipped:
            impossible[kind] = text
        else:
            plain.append(caveat(text))
    if impossible:
        sentence = f"effects that this chain cannot have (the report says why): {', '.join(impossible)}."
        plain.append(Warned(sentence, tuple(impossible.values()), folded=True))
    return tuple(plain)


def most_probable(probability: Mapping[Kinds, float], most: int) -> tuple[list[Kinds], str]:
    """Explanations for a table of the terminal, the most probable first, and in words which these are.

    Args:
        probability: of every explanation.
        most: rows; the model as it is stands below them in any case.
    """
    every = sorted(probability, key=lambda kinds: -probability[kinds])
    likely = every[:most]
    shown = [kinds for kinds in every if kinds in likely or kinds == NOTHING]
    rest = sum(probability[kinds] for kinds in every if kinds not in shown)
    if len(shown) == len(every):
        return shown, f"All {len(every)} explanations, the most probable first."
    also = "" if NOTHING in likely or NOTHING not in shown else ", and the model as it is"
    return shown, (
        f"The {len(likely)} most probable of {len(every)} explanations, by probability{also}; the others hold "
        f"{whole_percent(rest)} together."
    )


def parameter_word(parameter: str, unit: str) -> str:
    """A parameter's name without the unit that stands behind its value."""
    for suffix, of in (("_pa", "Pa"), ("_rad", "rad"), ("_s", "s"), ("_per_k", "K^-1")):
        if unit == of:
            parameter = parameter.removesuffix(suffix)
    return parameter.replace("_", " ")


def strength_text(value: float, unit: str) -> str:
    """A strength in its display unit."""
    return display_unit(unit).text(value, 2)


def value_text(value: float, sd: float, si: str) -> str:
    """Value ± standard deviation with the unit, the value to the decimal at which it is not sure."""
    return with_sd(value, sd, display_unit(si))


def estimate_text(one: Estimate) -> str:
    """``0.213 ± 0.004``, and whether it is implausible or at its bound, or that a simpler form is enough."""
    flags = [*([] if one.plausible else ["implausible"]), *(["at its bound"] if one.at_limit else [])]
    flags = [one.simpler] if one.simpler else flags
    flagged = f" ({', '.join(flags)})" if flags else ""
    return value_text(one.value, one.sd, one.parameter.unit) + flagged


def implausible_text(one: Estimate) -> str:
    """That a value lies outside its plausible range, and what that means."""
    plausible, unit = one.parameter.plausible, one.parameter.unit
    low, high = (strength_text(value, unit) for value in plausible)
    beyond = max(plausible[0] - one.value, one.value - plausible[1])
    means = (
        ", but not by more than its own uncertainty"
        if beyond < CLOSE * one.sd
        else ": the number stands in for something that the model lacks"
    )
    value = value_text(one.value, one.sd, unit)
    return f"The fitted {one.name}, {value}, is outside its plausible range, {low} to {high}{means}."


def probability_text(share: float) -> str:
    """A probability; what is nearly sure is not called sure."""
    return "over 99 %" if share > 0.99 else whole_percent(share)
