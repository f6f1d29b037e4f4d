"""A diagnosis of counts in sentences, and as the JSON object of `pliant diagnose`."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.counts_evidence import CountEvidence, Explanation
from pliant.diagnosis.counts_verdict import CountJudgement
from pliant.diagnosis.table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.words import HEADLINES, named
from pliant.evidence.counts_words import OUTPUT, counts_json
from pliant.formatting import number, whole_percent
from pliant.registry.discovery import Registry

MOST_NAMED = 4
NEARER = "trials nearer to the threshold: other pressures or loads, until some succeed and some do not"


def counts_headline(judged: CountJudgement) -> str:
    """The verdict in one sentence."""
    contenders = [named(kinds) for kinds in judged.credible[:MOST_NAMED]]
    if more := len(judged.credible) - len(contenders):
        contenders.append(f"{more} more")
    return HEADLINES[judged.verdict].format(
        kinds=" and ".join(judged.selected), contenders=" or ".join(contenders)
    )


def counts_why(found: CountEvidence, judged: CountJudgement) -> list[str]:
    """Reasons, the level of the best explanation, what is alike, what to count next."""
    lines = list(judged.reasons)
    best = best_listed(found)
    if best is not None and judged.verdict in ("missing_effect", "ambiguous", "unknown_effect"):
        left = found.comparisons[best].disagreeing
        rest = f"{len(left)} conditions are still wrong" if left else "no condition is wrong beyond chance"
        lines.append(f"Best of what is listed: {told(found.rows[best])}; with it {rest}.")
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


def told(row: Explanation) -> str:
    """The best level of each number: ``task.friction 0.9``."""
    values = row.grid[row.best]
    return ", ".join(
        f"{knob.name} {number(value, 3)}{'' if knob.unit == '1' else ' ' + knob.unit}"
        for knob, value in zip(row.knobs, values, strict=True)
    )


def counts_diagnosis_json(found: CountEvidence, judged: CountJudgement, registry: Registry) -> dict[str, Any]:
    """The contract's keys; the comparison of the model as it is stands under `comparison`."""
    return {
        "verdict": judged.verdict,
        "reasons": list(judged.reasons),
        "hypotheses": [_hypothesis(found, kinds) for kinds in found.probability],
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
                "unit": found.rows[kinds].knobs[0].unit,
            }
            for kinds, level in judged.smallest.items()
        ],
        "n_samples": found.comparison.n_samples,
        "n_effective": found.comparison.n_effective,
        "comparison": counts_json(found.comparison),
        "remarks": list(found.comparison.remarks),
    }


def _hypothesis(found: CountEvidence, kinds: Kinds) -> dict[str, Any]:
    base = {
        "kinds": list(kinds),
        "probability": found.probability[kinds],
        "log_evidence": found.log_evidence[kinds],
    }
    if kinds == UNKNOWN:
        return {**base, "parameters": {}, "heldout": {}, "rmse_over_floor": None}
    row, comparison = found.rows[kinds], found.comparisons[kinds]
    return {
        **base,
        "parameters": {knob.name: _parameter(row, k) for k, knob in enumerate(row.knobs)},
        "heldout": {OUTPUT: {"rmse": _unseen_rmse(found, row), "unit": "1"}},
        "heldout_log_likelihood": float(row.unseen.sum()),
        "rmse_over_floor": comparison.ratio_to_floor,
        "log_likelihood": comparison.log_likelihood,
        "levels": [list(levels) for levels in row.grid],
        "log_likelihood_of_levels": row.log_likelihood.sum(axis=1).tolist(),
        "simulated": [list(map(list, counts)) for counts in row.simulated],
        "still_wrong": [one.condition.words for one in comparison.disagreeing],
    }


def _parameter(row: Explanation, k: int) -> dict[str, Any]:
    values = np.array([levels[k] for levels in row.grid])
    mean = float(row.weights @ values)
    return {
        "value": float(values[row.best]),
        "sd": float(np.sqrt(row.weights @ (values - mean) ** 2)),
        "unit": row.knobs[k].unit,
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
    knob = row.knobs[0]
    if knob.model is None:
        return NEARER
    return registry.get("effect", knob.kind).implementation_class().notes.excited_by or NEARER
