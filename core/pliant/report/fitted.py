"""Common parts of documents of fitted effects: parameters with uncertainty, errors, floors, remarks, next runs."""

from __future__ import annotations

import re
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
from pliant.records.remark import Rank, Remark
from pliant.registry.discovery import Registry
from pliant.report.document import Column, Table, Warned, as_json, brief_table, page_table
from pliant.units import si_unit

CLOSE = 2.0  # standard deviations
Written = tuple[Estimate, float]  # a parameter, and its value as a study writes it


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


def _written(uncertainty: Uncertainty, values: Mapping[str, float] | None) -> list[Written]:
    return [(one, one.value if values is None else values[one.name]) for one in uncertainty.estimates]


def parameters_json(
    uncertainty: Uncertainty | None, values: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Return the parameters by ``kind.name``; `values` are the rounded ones of a written study."""
    if uncertainty is None:
        return {}
    return {one[0].name: as_json(PARAMETER_COLUMNS, one) for one in _written(uncertainty, values)}


def parameters_brief(uncertainty: Uncertainty) -> Table:
    """Return value, uncertainty and interval of each parameter, for the terminal."""
    return brief_table(PARAMETER_COLUMNS, _written(uncertainty, None))


def parameters_table(uncertainty: Uncertainty, title: str, note: str) -> Table:
    """Return the same for the page, with doubts about the values."""
    return page_table(title, PARAMETER_COLUMNS, _written(uncertainty, None), note)


def doubtful(uncertainty: Uncertainty) -> list[str]:
    """Return the doubts about values, a sentence each."""
    return [f"{one.name}: {doubt}" for one in uncertainty.estimates for doubt in one.doubts]


def floors_json(floors: Mapping[str, Floor]) -> dict[str, Any]:
    """Return the noise floor of each output."""
    keys = ("value", "unit", "source", "se")
    return {name: {key: getattr(floor, key) for key in keys} for name, floor in floors.items()}


def errors_json(score: Score) -> dict[str, Any]:
    """Return the RMS error of each output in its SI unit."""
    return {name: {"rmse": value, "unit": si_unit(name)} for name, value in score.rmse.items()}


def verdict_json(judgement: Judgement) -> dict[str, Any]:
    """Return the verdict, its reasons, and the remaining explanations, for measurements and for counts."""
    said = [judgement.sentence] if judgement.verdict == "ambiguous" else []
    return {
        "verdict": judgement.verdict,
        "sentence": judgement.sentence,
        "reasons": list(judgement.reasons) or said,
        "selected": list(judgement.selected),
        "selected_class": list(judgement.selected_class),
        "beside_class": list(judgement.beside),
        "credible_set": [list(kinds) for kinds in judgement.credible],
    }


def next_run_json(next_run: NextRun | None, file: str | None = None) -> dict[str, Any] | None:
    """Return a proposed run; `file` is its protocol file."""
    if next_run is None:
        return None
    said = {key: value for key, value in vars(next_run).items() if key != "planned"}
    return {**said, "ranked": [asdict(one) for one in next_run.ranked], "file": file}


def caveat(text: str) -> Warned:
    """Return a remark as a warning with its rank."""
    return Warned(text, rank=Remark.from_text(text).rank)


def warned(registry: Registry, remarks: Sequence[str], asked: Sequence[str] = ()) -> tuple[Warned, ...]:
    """Return remarks as warnings; shipped effects that the chain cannot have are merged, unless requested by name."""
    shipped = _shipped_effects(registry) - set(asked)
    plain, impossible = [], {}
    for text in remarks:
        kind = Remark.from_text(text).left_out
        if kind in shipped:
            impossible[kind] = text
        elif kind and kind not in asked:
            plain.append(_package_warning(text))
        else:
            plain.append(caveat(text))
    if impossible:
        sentence = f"effects that this model cannot have (the report says why): {', '.join(impossible)}."
        plain.append(Warned(sentence, tuple(impossible.values()), folded=True))
    return tuple(plain)


def package_warnings(registry: Registry, remarks: Sequence[str]) -> tuple[Warned, ...]:
    """Return as warnings the remarks on effects of other packages that were not tried."""
    shipped = _shipped_effects(registry)
    named = [(Remark.from_text(text).left_out, text) for text in remarks]
    return tuple(_package_warning(text) for kind, text in named if kind and kind not in shipped)


def _shipped_effects(registry: Registry) -> set[str]:
    return {component.kind for component in registry.by_interface("effect") if component.shipped}


def _package_warning(text: str) -> Warned:
    """Return a warning above the rank of details: a package that fails or does not suit the chain is unexpected."""
    return Warned(text, rank=Rank.DATA)


def most_probable(probability: Mapping[Kinds, float], most: int) -> tuple[list[Kinds], str]:
    """Return explanations for a table of the terminal, the most probable first, and a sentence on the selection.

    Args:
        probability: of every explanation.
        most: number of rows; the present model is added to them in any case.
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
    """Return a parameter's name without the unit, which follows its value."""
    words = re.sub(r"([a-z]+)\^-1", r"1/\1", unit.lower()).replace("*", "_").replace("^", "")
    per = words.replace("1/", "per_").replace("/", "_per_")  # rad/s → rad_per_s; some names leave "per" out
    for suffix in (per, per.replace("_per_", "_")) if unit else ():
        parameter = parameter.removesuffix(f"_{suffix}")
    return parameter.replace("_", " ")


def strength_text(value: float, unit: str) -> str:
    """Return a strength in its display unit."""
    return display_unit(unit).text(value, 2)


def value_text(value: float, sd: float, si: str) -> str:
    """Return value ± standard deviation with the unit, rounded by the standard deviation."""
    return with_sd(value, sd, display_unit(si))


def estimate_text(one: Estimate) -> str:
    """Return ``0.213 ± 0.004``, and whether it is implausible or at its bound, or that a simpler form is enough."""
    flags = [*([] if one.plausible else ["implausible"]), *(["at its bound"] if one.at_limit else [])]
    flags = [one.simpler] if one.simpler else flags
    flagged = f" ({', '.join(flags)})" if flags else ""
    return value_text(one.value, one.sd, one.parameter.unit) + flagged


def implausible_text(one: Estimate) -> str:
    """Return a sentence on a value outside its plausible range, and its meaning."""
    plausible, unit = one.parameter.plausible, one.parameter.unit
    low, high = (display_unit(unit).text(value, 3) for value in plausible)
    beyond = max(plausible[0] - one.value, one.value - plausible[1])
    means = (
        ", but not by more than its own uncertainty"
        if beyond < CLOSE * one.sd
        else ": the number stands in for something that the model lacks"
    )
    value = value_text(one.value, one.sd, unit)
    return f"The fitted {one.name}, {value}, is outside its plausible range, {low} to {high}{means}."


def probability_text(share: float) -> str:
    """Return a probability as text that never reads as certainty."""
    return "over 99 %" if share > 0.99 else whole_percent(share)
