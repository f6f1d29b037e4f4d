"""A diagnosis of counts as a document: the explanations that they allow, for terminal, page and JSON."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.verdict import named
from pliant.formatting import number, whole_percent
from pliant.records.design import Array
from pliant.registry.discovery import Registry
from pliant.report.comparison import ROWS
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    as_json,
    brief_table,
    drawn,
    page_table,
    section,
)
from pliant.report.fitted import caveat, most_probable, probability_text, verdict_json
from pliant_counts.answers import diagnosis_answers
from pliant_counts.comparison import CountComparison
from pliant_counts.comparison_page import OUTPUT, counts_json, shares_picture
from pliant_counts.evidence import CountEvidence, Explanation
from pliant_counts.records import Counts
from pliant_counts.verdict import CountJudgement

HYPOTHESES_BRIEF = 12  # rows of the terminal's table
NAMED = 4
NEARER = "trials nearer to the threshold: other pressures or loads, until some succeed and some do not"


class WeighedCounts(NamedTuple):
    """A hypothesis and its statistics; without scanned values for one outside the list."""

    kinds: Kinds
    probability: float
    log_evidence: float
    row: Explanation | None
    comparison: CountComparison | None
    unseen_rmse: float | None

    @property
    def parameters(self) -> dict[str, Any]:
        """The best level of each number, and its standard deviation over the levels."""
        if self.row is None:
            return {}
        values = np.array(self.row.grid, float).reshape(len(self.row.grid), len(self.row.parameters))
        sd = np.sqrt(self.row.weights @ (values - self.row.weights @ values) ** 2)
        return {
            one.name: {"value": float(v), "sd": float(s), "unit": one.unit, "plausible": True}
            for one, v, s in zip(self.row.parameters, values[self.row.best], sd, strict=True)
        }

    @property
    def unseen(self) -> float | None:
        """Log-likelihood of the conditions, each with the level chosen by the others."""
        return None if self.row is None else float(self.row.unseen.sum())

    @property
    def still_wrong(self) -> list[str] | None:
        """Conditions beyond chance at the best level."""
        if self.comparison is None:
            return None
        return [one.condition.words for one in self.comparison.disagreeing]

    @property
    def level_log_likelihoods(self) -> Array | None:
        """(levels,) log-likelihood of all conditions at each level."""
        return None if self.row is None else self.row.log_likelihood.sum(axis=1)

    @property
    def best_level(self) -> str:
        """The best level in words, without the name if a single number is changed."""
        if self.row is None or not self.kinds:
            return ""
        return level_text(self.row).rpartition(f"{self.kinds[0]} ")[2]


# Columns of every hypothesis; then those of scanned ones.
HYPOTHESIS_COLUMNS: tuple[Column[WeighedCounts], ...] = (
    Column("kinds", head="hypothesis", brief="hypothesis", show=named),
    Column(
        "probability",
        head="probability",
        brief="probability",
        show=whole_percent,
        brief_show=probability_text,
    ),
    Column("log_evidence", head="log-evidence", brief="evidence", show=4, brief_show=3),
    Column("parameters"),
    Column("row", "", "best level", show=lambda row: level_text(row), none=""),
    Column("best_level", "", brief="best at"),
)
SCANNED_COLUMNS: tuple[Column[WeighedCounts], ...] = (
    Column(lambda h: {OUTPUT: {"rmse": h.unseen_rmse, "unit": "1"}}, "heldout"),
    Column("comparison.ratio_to_floor", "rmse_over_floor"),
    Column("comparison.log_likelihood", head="log-likelihood there", show=4, none=""),
    Column("unseen", "heldout_log_likelihood", "left out", show=4, none=""),
    Column(
        "still_wrong", head="still wrong", brief="still wrong", show=lambda wrong: str(len(wrong)), none=""
    ),
    Column("row.grid", "levels"),
    Column("level_log_likelihoods", "log_likelihood_of_levels"),
    Column("row.simulated"),
)
EVERY_COLUMN = (*HYPOTHESIS_COLUMNS, *SCANNED_COLUMNS)


def counts_diagnosis_document(
    title: str, counts: Counts, evidence: CountEvidence, judged: CountJudgement, registry: Registry
) -> Document:
    """Return the document of `pliant diagnose` on a file of counts."""
    reasons = counts_why(evidence, judged)
    shown, which = most_probable(evidence.probability, HYPOTHESES_BRIEF)
    rows = [one for one in weighed_hypotheses(evidence) if one.kinds in shown]
    return Document(
        kind="Pliant: which explanation do these counts allow?",
        title=title,
        sentence=judged.sentence,
        data=counts_diagnosis_json(evidence, judged, registry),
        brief=(brief_table(EVERY_COLUMN, rows, which),),
        answers=diagnosis_answers(
            evidence, judged, {kinds: level_text(row) for kinds, row in evidence.rows.items()}
        ),
        points=tuple(reasons),
        warnings=tuple(map(caveat, evidence.comparison.remarks)),
        closing=(judged.sentence, *reasons),
        draw=lambda: _drawn(evidence),
        footer=f"Counts: {counts.source or 'given in memory'}",
    )


def counts_diagnosis_json(
    evidence: CountEvidence, judged: CountJudgement, registry: Registry
) -> dict[str, Any]:
    """Return the contract's keys; the comparison of the present model is under `comparison`."""
    plain, next_count = evidence.comparison, judged.next_count
    proposed = next_count and {
        "run": f"more trials of {next_count.condition}",
        "why": "the explanations that are left expect different shares of success there",
        "separates": [[list(kinds) for kinds in next_count.expected]],
        "minutes": None,
    }
    smallest = [(evidence.rows[kinds].parameters[0], level) for kinds, level in judged.smallest.items()]
    unexcited = [evidence.rows[kinds].parameters[0] for kinds in judged.not_excited]
    excitation = {
        one.name: registry.get("effect", one.kind).implementation_class().notes.excitation
        if one.model
        else ""
        for one in unexcited
    }
    return {
        **verdict_json(judged),
        "hypotheses": [
            {
                **as_json(HYPOTHESIS_COLUMNS, one),
                **(as_json(SCANNED_COLUMNS, one) if one.row else {"heldout": {}, "rmse_over_floor": None}),
            }
            for one in weighed_hypotheses(evidence)
        ],
        "not_excited": [
            {"kind": name, "run_that_would_excite_it": run or NEARER} for name, run in excitation.items()
        ],
        "indistinguishable": [
            {"a": named(a), "b": named(b), "unexplained_share": share} for a, b, share in judged.alike
        ],
        "covariates": [],
        "next_experiment": proposed,
        "smallest_detectable": [
            {"kind": one.name.rpartition(".")[0], "parameter": one.name, "value": level, "unit": one.unit}
            for one, level in smallest
        ],
        "n_samples": plain.n_samples,
        "n_effective": plain.n_effective,
        "comparison": counts_json(plain),
        "remarks": list(plain.remarks),
    }


def counts_why(evidence: CountEvidence, judged: CountJudgement) -> list[str]:
    """Return reasons, the level of the best explanation, indistinguishable explanations, and what to count next."""
    lines = list(judged.reasons)
    best = best_listed(evidence)
    if best is not None and judged.verdict in ("missing_effect", "ambiguous", "unknown_effect"):
        left = evidence.comparisons[best].disagreeing
        rest = f"{len(left)} conditions are still wrong" if left else "no condition is wrong beyond chance"
        lines.append(f"Best of what is listed: {level_text(evidence.rows[best])}; with it {rest}.")
    for a, b, share in judged.alike[:NAMED]:
        lines.append(f"{named(a)} and {named(b)} move these conditions alike ({whole_percent(share)} apart).")
    if judged.next_count is not None:
        shares = judged.next_count.expected.items()
        expected = ", ".join(f"{named(kinds)} {whole_percent(share)}" for kinds, share in shares)
        lines.append(f"Next: more trials of {judged.next_count.condition}; expected successes: {expected}.")
    return lines


def best_listed(evidence: CountEvidence) -> Kinds | None:
    """Return the most probable explanation that changes something; None without one."""
    return next((kinds for kinds in evidence.probability if kinds not in (NOTHING, UNKNOWN)), None)


def level_text(row: Explanation) -> str:
    """Return the best level of each number: ``task.friction 0.9``."""
    values = zip(row.parameters, row.grid[row.best], strict=True)
    return ", ".join(
        f"{one.name} {number(v, 3)} {one.unit if one.unit != '1' else ''}".strip() for one, v in values
    )


def weighed_hypotheses(evidence: CountEvidence) -> list[WeighedCounts]:
    """Return every hypothesis, the most probable first."""
    return [
        WeighedCounts(
            kinds,
            probability,
            evidence.log_evidence[kinds],
            row := evidence.rows.get(kinds),
            evidence.comparisons.get(kinds),
            None if row is None else _unseen_rmse(evidence, row),
        )
        for kinds, probability in evidence.probability.items()
    ]


def _unseen_rmse(evidence: CountEvidence, row: Explanation) -> float:
    """Return the RMSE of the shares of success of conditions that were not used to choose the level."""
    likelihood = row.log_likelihood.sum(axis=1, keepdims=True) - row.log_likelihood
    weights = np.exp(likelihood - likelihood.max(axis=0))
    s, m = np.moveaxis(np.array(row.simulated, float), 2, 0)
    expected = (weights * s / m).sum(axis=0) / weights.sum(axis=0)
    measured = np.array([one.measured[0] / one.measured[1] for one in evidence.comparison.conditions])
    return float(np.sqrt(np.mean((measured - expected) ** 2)))


def _drawn(evidence: CountEvidence) -> Drawn:
    best = best_listed(evidence)
    models = {"model": evidence.comparison.conditions[:ROWS]}
    if best is not None:
        models[f"with {level_text(evidence.rows[best])}"] = evidence.comparisons[best].conditions[:ROWS]
    caption = (
        "Share of successes by condition, each with the interval that counting alone gives it. Filled models differ "
        "from the measurement by more than chance, all conditions being looked at."
    )
    note = (
        "Log-evidence: log of the mean likelihood over the levels tried. Left out: log-likelihood of each condition "
        "when the others choose the level. Still wrong: conditions beyond chance at the best level."
    )
    title = "Every hypothesis"
    table = page_table(title, EVERY_COLUMN, weighed_hypotheses(evidence), note)
    return drawn(shares_picture("changes", caption, models), section(title, table))
