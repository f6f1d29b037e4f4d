"""The tables of a diagnosis: hypotheses, what these runs could not show, what looks alike, the noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis, circumstance
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.verdict import named
from pliant.formatting import number, unit_of, whole_percent
from pliant.interfaces.effect import EffectNotes
from pliant.report.document import Column, Table, as_json, optional_table, page_table
from pliant.report.evidence_view import Diagnosed
from pliant.report.fitted import (
    estimate_text,
    parameter_word,
    parameters_json,
    probability_text,
    strength_text,
)
from pliant.units import si_unit

Notes = Mapping[str, EffectNotes]
MOST_TWINS = 4
OUTPUTS = 3


def hypotheses_json(found: Diagnosis) -> list[dict[str, Any]]:
    """Every hypothesis, the most probable first."""
    columns, keys = hypothesis_columns(found), ("mean_square", "heldout_square", "unseen_square")
    made = []
    for kinds in found.judgement.probability:
        row = found.table.rows.get(kinds)
        fitted = {key: getattr(row, key) for key in (*keys, "n_parameters", "at_limit")} if row else {}
        forms = list(found.fits[kinds].candidate.forms) if kinds in found.fits else []
        made.append({**as_json(columns, kinds), **fitted, "forms": forms})
    return made


def hypotheses_table(found: Diagnosis, shown_kinds: Sequence[Kinds]) -> Table:
    """The hypotheses of the bar chart, with parameters and the error of each output."""
    rest = len(found.judgement.probability) - len(shown_kinds)
    note = (
        "Errors are rms on runs left out of the fit. ±: one standard deviation, coloured noise counted. Implausible: "
        "outside the range that would not surprise an expert; take such a number for a correction, not a property."
    )
    more = f" {rest} more hypotheses are in the JSON." if rest else ""
    return page_table("Hypotheses", hypothesis_columns(found), shown_kinds, note + more, 2)


def hypothesis_columns(found: Diagnosis) -> tuple[Column[Kinds], ...]:
    """What is said of any hypothesis, an effect outside the list included."""
    left = {kinds: found.left_out_errors(kinds) for kinds in found.fits}

    def heldout(kinds: Kinds) -> dict[str, Any]:
        return {name: {"rmse": rmse, "unit": si_unit(name)} for name, rmse in left.get(kinds, {}).items()}

    def ratio(kinds: Kinds, brief: bool = False) -> str:
        if kinds == UNKNOWN:
            return "any form" if brief else number(np.nan)
        value = found.left_out_ratio(kinds)
        return number(value, 3) if not brief else f"{value:.2f}" if np.isfinite(value) else "–"

    def error_column(name: str) -> Column[Kinds]:
        unit = unit_of(name)
        text = lambda kinds: "–" if kinds == UNKNOWN else unit.text(left[kinds][name], 3)  # noqa: E731
        return Column(list, "", unit.label, text=text)

    return (
        Column(list, "kinds", "hypothesis", "hypothesis", named),
        Column(
            lambda kinds: parameters_json(found.estimates.get(kinds)),
            "parameters",
            "parameters",
            text=lambda kinds: "; ".join(parameter_texts(found, kinds)) or "–",
        ),
        Column(
            lambda kinds: found.judgement.probability.get(kinds, 0.0),
            "probability",
            "probability",
            "probability",
            show=probability_text,
        ),
        Column(
            found.left_out_ratio,
            "rmse_over_floor",
            "in noise floors",
            "left-out error / floor",
            ratio,
            lambda kinds: ratio(kinds, True),
        ),
        Column(heldout, "heldout"),
        *map(error_column, found.readings.outputs[:OUTPUTS]),
    )


def parameter_texts(found: Diagnosis, kinds: Kinds) -> list[str]:
    """Each parameter of a hypothesis: ``share 0.213 ± 0.004``; implausible values say so."""
    if kinds not in found.estimates:
        return []
    return [
        f"{f'{e.kind} ' if len(kinds) > 1 else ''}{parameter_word(e.parameter.name, e.parameter.unit)} "
        f"{estimate_text(e)}"
        for e in found.estimates[kinds].estimates
    ]


def not_excited_table(found: Diagnosis) -> Table | None:
    """Effects that cannot be judged from these runs, and the run that would show each."""
    rows = [[kind, run or "none that this bench can do"] for kind, run in found.not_excited.items()]
    note = "Even as strong as an expert would still believe, they change these readings by less than 0.3 noise floors."
    return optional_table("Not shown by these runs", ["effect", "the run that would show it"], rows, note, 2)


def look_alikes_table(found: Diagnosis, notes: Notes) -> Table | None:
    """For each effect those that can stand in for it, and what tells the leading ones apart."""

    def told_apart(a: str, b: str) -> str:
        """What the plugin of either says of the pair; empty if neither names the other."""
        for note, other in ((notes.get(a), b), (notes.get(b), a)):
            if note is not None and note.look_alike == other:
                return f"{b}: {note.told_apart}" if note.told_apart else ""
        return ""

    twins: dict[str, list[tuple[str, float]]] = {}
    for pair in found.indistinguishable:
        twins.setdefault(pair.a, []).append((pair.b, pair.unexplained_share))
    rows = []
    for a in sorted(twins, key=lambda kind: twins[kind][0][1]):
        imitators = [f"{b} ({whole_percent(share)})" for b, share in twins[a][:MOST_TWINS]]
        more = len(twins[a]) - len(imitators)
        cell = ", ".join(imitators) + (f" and {more} more" if more else "")
        rows.append([a, cell, next((text for b, _ in twins[a] if (text := told_apart(a, b))), "")])
    note = (
        "In brackets: the share of the effect's change, at a strength of 2 noise floors, that the other cannot "
        "imitate; the noise hides it."
    )
    head = ["effect", "can be imitated by", "what tells them apart"]
    return optional_table("Look-alikes under these runs", head, rows, note, 3)


def classes_table(found: Diagnosis) -> Table | None:
    """Effects that these runs leave together, and the run that parts them."""
    rows = []
    for one in found.classes:
        parts = "; ".join(", ".join(part) for part in one.parts) if one.run else ""
        run = f"{one.run} ({one.minutes:g} min): {one.words}" if one.run else "–"
        rows.append([", ".join(one.kinds), run, parts])
    note = (
        "From the inputs, the noise and the model alone, at a strength of 2 noise floors: the readings have no part in "
        "it. A run is sought where an effect of the class is among the explanations that are left."
    )
    head = ["cannot be told apart", "run that would split them", "into"]
    return optional_table("Classes under these runs", head, rows, note, 3)


def detectable_table(found: Diagnosis) -> Table | None:
    """How strong each effect would have to be to be found."""
    rows = []
    for one in found.detectable:
        if one.kind in found.not_excited:
            continue
        asked = found.excitations[one.kind].strength.declared
        none, low, high = (strength_text(v, one.unit) for v in (asked.neutral, *asked.plausible))
        reach = max(abs(end - asked.neutral) for end in asked.plausible)
        flag = " (beyond plausible)" if abs(one.value - asked.neutral) > reach else ""
        word, value = parameter_word(one.parameter, one.unit), strength_text(one.value, one.unit)
        rows.append([one.kind, word, none, f"{value}{flag}", f"{low} to {high}"])
    head = ["effect", "parameter", "no effect at", "found from about", "plausible range"]
    note = "Weaker effects may be there and would not have been noticed: this is what “nothing missing” leaves open."
    return optional_table("Smallest strengths that these runs would show", head, rows, note, 2)


def noise_table(found: Diagnosis) -> Table:
    """Floors by output, as the residuals of the best hypothesis show them."""
    rows = []
    for name, floor in found.noise.floors.items():
        words = unit_of(name)
        between = "no repeats" if floor.between is None else words.text(floor.between, 3)
        sigma = "not stated" if floor.sigma is None else words.text(floor.sigma, 3)
        value, within = words.text(floor.value, 3), words.text(floor.within, 3)
        rows.append([words.label, value, floor.source, within, between, sigma])
    head = ["output", "noise floor", "taken from", "within a run", "between repeats", "stated sigma"]
    return Table("Noise floors", head, rows, "", 3)


def dependence_table(diagnosed: Diagnosed) -> Table | None:
    """What the error that is left depends on."""
    found = diagnosed.found
    told = [[circumstance(found, n), whole_percent(v)] for n, v in found.depends_on.items() if v >= 0.02]
    left = "model as it is" if found.explained == NOTHING else f"model with {named(found.explained)}"
    note = "Share of its variance that the circumstance alone predicts, without physics, on runs left out."
    return optional_table(
        f"What the error of the {left} depends on", ["circumstance", "tells"], told[:6], note, 1
    )
