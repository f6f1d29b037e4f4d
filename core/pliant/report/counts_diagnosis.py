"""A diagnosis of counts as a document: which number explains them, for terminal, page and JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.counts_diagnosis import CountEvidence, CountJudgement, Explanation
from pliant.diagnosis.verdict import NOTHING, UNKNOWN, Kinds, named, sentence_of
from pliant.formatting import number, whole_percent
from pliant.records.counts import Counts
from pliant.registry.discovery import Registry
from pliant.report.counts import OUTPUT, counts_json
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Section,
    Warned,
    as_json,
    brief_table,
    page_table,
)
from pliant.report.fitted import probability_text

ROWS = 60  # of the picture
ROWS_BRIEF = 12  # of the terminal's table
MOST_NAMED = 4
NEARER = "trials nearer to the threshold: other pressures or loads, until some succeed and some do not"


def counts_diagnosis_document(
    title: str, counts: Counts, found: CountEvidence, judged: CountJudgement, registry: Registry
) -> Document:
    """The document of `pliant diagnose` on a file of counts."""
    headline, reasons = counts_headline(judged), counts_why(found, judged)
    columns = hypothesis_columns(found)
    return Document(
        kind="Pliant: which explanation do these counts allow?",
        title=title,
        sentence=headline,
        data=counts_diagnosis_json(found, judged, registry),
        brief=(brief_table(columns, list(found.probability)[:ROWS_BRIEF]),),
        points=tuple(reasons),
        warnings=tuple(Warned(remark) for remark in found.comparison.remarks),
        closing=(headline, *reasons),
        draw=lambda: _drawn(found, columns),
        footer=f"Counts: {counts.source or 'given in memory'}",
    )


def counts_diagnosis_json(found: CountEvidence, judged: CountJudgement, registry: Registry) -> dict[str, Any]:
    """The contract's keys; the comparison of the model as it is stands under `comparison`."""
    return {
        "verdict": judged.verdict,
        "sentence": counts_headline(judged),
        "reasons": list(judged.reasons)
        or ([counts_headline(judged)] if judged.verdict == "ambiguous" else []),
        "hypotheses": hypotheses_json(found),
        "selected": list(judged.selected),
        "credible_set": [list(kinds) for kinds in judged.credible],
        "not_excited": [
            {"kind": kinds[0], "run_that_would_excite_it": _exciting(found.rows[kinds], registry)}
            for kinds in judged.not_excited
        ],
        "indistinguishable": [
            {"a": named(a), "b": named(b), "unexplained_share": share} for a, b, share in judged.alike
        ],
        "covariates": [],
        "next_experiment": None
        if judged.next_count is None
        else {
            "run": f"more trials of {judged.next_count.condition}",
            "why": "the explanations that are left expect different shares of success there",
            "separates": [[list(kinds) for kinds in judged.next_count.expected]],
            "minutes": None,
        },
        "smallest_detectable": [
            {
                "kind": kinds[0].rpartition(".")[0],
                "parameter": kinds[0],
                "value": level,
                "unit": found.rows[kinds].parameters[0].unit,
            }
            for kinds, level in judged.smallest.items()
        ],
        "n_samples": found.comparison.n_samples,
        "n_effective": found.comparison.n_effective,
        "comparison": counts_json(found.comparison),
        "remarks": list(found.comparison.remarks),
    }


def counts_headline(judged: CountJudgement) -> str:
    """The verdict in one sentence."""
    return sentence_of(judged.verdict, judged.selected, judged.credible)


def counts_why(found: CountEvidence, judged: CountJudgement) -> list[str]:
    """Reasons, the level of the best explanation, what is alike, what to count next."""
    lines = list(judged.reasons)
    best = best_listed(found)
    if best is not None and judged.verdict in ("missing_effect", "ambiguous", "unknown_effect"):
        left = found.comparisons[best].disagreeing
        rest = f"{len(left)} conditions are still wrong" if left else "no condition is wrong beyond chance"
        lines.append(f"Best of what is listed: {level_text(found.rows[best])}; with it {rest}.")
    for a, b, share in judged.alike[:MOST_NAMED]:
        lines.append(f"{named(a)} and {named(b)} move these conditions alike ({whole_percent(share)} apart).")
    if judged.next_count is not None:
        expected = ", ".join(
            f"{named(kinds)} {whole_percent(share)}" for kinds, share in judged.next_count.expected.items()
        )
        lines.append(f"Next: more trials of {judged.next_count.condition}; expected successes: {expected}.")
    return lines


def best_listed(found: CountEvidence) -> Kinds | None:
    """The most probable explanation that moves something; None where none was tried."""
    return next((kinds for kinds in found.probability if kinds not in (NOTHING, UNKNOWN)), None)


def level_text(row: Explanation) -> str:
    """The best level of each number: ``task.friction 0.9``."""
    values = row.grid[row.best]
    return ", ".join(
        f"{parameter.name} {number(value, 3)}{'' if parameter.unit == '1' else ' ' + parameter.unit}"
        for parameter, value in zip(row.parameters, values, strict=True)
    )


def hypotheses_json(found: CountEvidence) -> list[dict[str, Any]]:
    """Every hypothesis, the most probable first."""
    common, scanned = hypothesis_columns(found), scan_columns(found)
    return [
        {"rmse_over_floor": None, **as_json((*common, *(() if kinds == UNKNOWN else scanned)), kinds)}
        for kinds in found.probability
    ]


def hypothesis_columns(found: CountEvidence) -> tuple[Column[Kinds], ...]:
    """What is said of any hypothesis, one outside the list included."""
    rows = found.rows

    def scanned(text: Any) -> Any:
        return lambda kinds: text(kinds) if kinds in rows else ""

    return (
        Column(list, "kinds", "hypothesis", "hypothesis", named),
        Column(
            lambda kinds: found.probability[kinds],
            "probability",
            "probability",
            "probability",
            lambda kinds: whole_percent(found.probability[kinds]),
            lambda kinds: probability_text(found.probability[kinds]),
        ),
        Column(
            lambda kinds: found.log_evidence[kinds],
            "log_evidence",
            "log-evidence",
            "evidence",
            lambda kinds: number(found.log_evidence[kinds], 4),
            lambda kinds: number(found.log_evidence[kinds], 3),
        ),
        Column(
            lambda kinds: _parameters(rows[kinds]) if kinds in rows else {},
            "parameters",
            "best level",
            "best at",
            scanned(lambda kinds: level_text(rows[kinds])),
            scanned(lambda kinds: level_text(rows[kinds]).rpartition(kinds[0] + " ")[2] if kinds else ""),
        ),
        Column(
            lambda kinds: (
                {OUTPUT: {"rmse": _unseen_rmse(found, rows[kinds]), "unit": "1"}} if kinds in rows else {}
            ),
            "heldout",
            "log-likelihood there",
            text=scanned(lambda kinds: number(found.comparisons[kinds].log_likelihood, 4)),
        ),
        Column(
            lambda kinds: kinds,
            head="left out",
            text=scanned(lambda kinds: number(float(rows[kinds].unseen.sum()), 4)),
        ),
        Column(
            lambda kinds: kinds,
            head="still wrong",
            brief="still wrong",
            text=scanned(lambda kinds: str(len(found.comparisons[kinds].disagreeing))),
        ),
    )


def scan_columns(found: CountEvidence) -> tuple[Column[Kinds], ...]:
    """What the JSON says of a hypothesis that was scanned."""
    rows, comparisons = found.rows, found.comparisons
    return (
        Column(lambda kinds: float(rows[kinds].unseen.sum()), "heldout_log_likelihood"),
        Column(lambda kinds: comparisons[kinds].ratio_to_floor, "rmse_over_floor"),
        Column(lambda kinds: comparisons[kinds].log_likelihood, "log_likelihood"),
        Column(lambda kinds: [list(levels) for levels in rows[kinds].grid], "levels"),
        Column(lambda kinds: rows[kinds].log_likelihood.sum(axis=1), "log_likelihood_of_levels"),
        Column(lambda kinds: rows[kinds].simulated, "simulated"),
        Column(lambda kinds: [one.condition.words for one in comparisons[kinds].disagreeing], "still_wrong"),
    )


def _parameters(row: Explanation) -> dict[str, Any]:
    return {parameter.name: _parameter(row, k) for k, parameter in enumerate(row.parameters)}


def _parameter(row: Explanation, k: int) -> dict[str, Any]:
    values = np.array([levels[k] for levels in row.grid])
    mean = float(row.weights @ values)
    return {
        "value": float(values[row.best]),
        "sd": float(np.sqrt(row.weights @ (values - mean) ** 2)),
        "unit": row.parameters[k].unit,
        "plausible": True,
    }


def _unseen_rmse(found: CountEvidence, row: Explanation) -> float:
    """Of the shares of success of conditions that had no part in choosing the level."""
    likelihood = row.log_likelihood.sum(axis=1, keepdims=True) - row.log_likelihood
    weights = np.exp(likelihood - likelihood.max(axis=0))
    s, m = np.moveaxis(np.array(row.simulated, float), 2, 0)
    expected = (weights * s / m).sum(axis=0) / weights.sum(axis=0)
    measured = np.array([one.measured[0] / one.measured[1] for one in found.comparison.conditions])
    return float(np.sqrt(np.mean((measured - expected) ** 2)))


def _exciting(row: Explanation, registry: Registry) -> str:
    parameter = row.parameters[0]
    if parameter.model is None:
        return NEARER
    return registry.get("effect", parameter.kind).implementation_class().notes.excited_by or NEARER


def _drawn(found: CountEvidence, columns: tuple[Column[Kinds], ...]) -> Drawn:
    from pliant.report.figures.success_shares import Series, success_shares

    plain, best = found.comparison.conditions[:ROWS], best_listed(found)
    models = [Series("model", [one.simulated for one in plain], [one.disagrees for one in plain])]
    if best is not None:
        moved = found.comparisons[best].conditions[:ROWS]
        flags = [one.disagrees for one in moved]
        models.append(Series(f"with {level_text(found.rows[best])}", [one.simulated for one in moved], flags))
    png = success_shares(
        [one.condition.words for one in plain],
        Series("measured", [one.measured for one in plain], [True] * len(plain)),
        models,
    )
    caption = (
        "Share of successes by condition, each with the interval that counting alone gives it. Filled models differ "
        "from the measurement by more than chance, all conditions being looked at."
    )
    note = (
        "Log-evidence: log of the mean likelihood over the levels tried. Left out: log-likelihood of each condition "
        "when the others choose the level. Still wrong: conditions beyond chance at the best level."
    )
    table = page_table("Every hypothesis", columns, list(found.probability), note)
    return Drawn(Picture("changes", caption, png), (Section("Every hypothesis", (), (table,)),))
