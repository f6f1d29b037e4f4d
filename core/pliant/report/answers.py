"""The first lines of a page: quality of the model, missing effect, certainty, next step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.next_run import NextRun
from pliant.diagnosis.steps import Improvement
from pliant.diagnosis.verdict import Judgement, named
from pliant.evidence.comparison import Comparison
from pliant.evidence.comparison_sentences import headline
from pliant.formatting import listed, number, output_unit, whole_percent
from pliant.report.diagnosis_page import parameter_texts
from pliant.report.document import answers
from pliant.report.fitted import probability_text

MOST_OUTPUTS = 2
NEAR = 1.2  # times the floor: below it nothing is missing
Answers = tuple[tuple[str, str], ...]


def comparison_answers(comparison: Comparison) -> Answers:
    """Return the answers for a model against a measurement."""
    ratio, place = comparison.rmse_over_floor, headline(comparison)
    errors = {name: error.rmse for name, error in comparison.outputs.items()}
    floors = {name: error.noise_floor for name, error in comparison.outputs.items()}
    good = errors_text(errors, floors)
    good += f", {_ratio(ratio)} the noise" if comparison.has_floor else ""
    low, high = comparison.rmse_over_floor_interval
    sure = f"95 % interval {_ratio(low, False)} to {_ratio(high)} the noise; " if np.isfinite(low) else ""
    sure += f"{comparison.n_samples} readings, effective sample size {number(comparison.n_effective, 3)}; "
    sure += (
        "the floor comes from repeats or a stated sigma" if comparison.judged else "the floor is not known"
    )
    if not comparison.judged:
        return answers(
            good,
            "Cannot be judged before the noise is known.",
            sure,
            "Repeat a run, or state the sensor's sigma; then compare again.",
        )
    if place is not None:
        missing = (
            f"{place.condition}: {whole_percent(place.share_of_error)} of the squared error in "
            f"{whole_percent(place.share_of_samples)} of the readings"
        )
    else:
        missing = (
            "No circumstance stands out." if ratio < NEAR else "The error is spread over all circumstances."
        )
    right = ratio < NEAR and place is None and not comparison.significant
    after = (
        "No unexplained error; measure what these runs do not cover."
        if right
        else "Identify the effect: pliant diagnose."
    )
    return answers(good, "Nothing that these runs show." if right else missing, sure, after)


def diagnosis_answers(diagnosis: Diagnosis, demand: str) -> Answers:
    """Return the answers for a diagnosis; `demand` is the action that its verdict requires if no run is proposed."""
    judgement, verdict = diagnosis.judgement, diagnosis.verdict
    best = next((kinds for kinds in judgement.probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    before, after = diagnosis.left_out_ratio(NOTHING), diagnosis.left_out_ratio(best)
    floors = {name: floor.value for name, floor in diagnosis.noise.floors.items()}
    good = errors_text(diagnosis.left_out_errors(NOTHING), floors)
    good += f", {_ratio(before)} the noise on runs left out" if np.isfinite(before) else ""
    if (
        best != NOTHING
        and np.isfinite(after)
        and verdict in ("missing_effect", "ambiguous", "unknown_effect")
    ):
        good += f"; {_ratio(after)} with {named(best)}"
    missing = {
        "missing_effect": _with_parameters(diagnosis),
        "ambiguous": contenders_sentence(judgement),
        "nothing_missing": "Nothing that these runs show",
        "law_off": f"No effect; the law is off{judgement.law}",
        "unknown_effect": "An effect that is not in the list",
        "not_repeatable": "Not examined: runs with the same inputs differ",
        "insufficient_data": "Not determined by these runs",
    }[verdict]
    return answers(good, missing, _sure(diagnosis), proposed(diagnosis.next_run) or demand)


def contenders_sentence(judgement: Judgement) -> str:
    """Return what is missing by an ambiguous verdict, on measurements and on counts."""
    return f"One of these{', whichever it is' if judgement.selected_class else ''}: {judgement.contenders}"


def _with_parameters(diagnosis: Diagnosis) -> str:
    texts = parameter_texts(diagnosis, diagnosis.selected)
    return named(diagnosis.selected) + (f" ({', '.join(texts)})" if texts else "")


def _sure(diagnosis: Diagnosis) -> str:
    if diagnosis.verdict in ("not_repeatable", "insufficient_data"):
        return f"No verdict on effects; {number(diagnosis.noise.n_effective, 3)} independent readings"
    shown: list[Kinds] = list(diagnosis.judgement.credible[:3])
    texts = [f"{named(kinds)} {probability_text(diagnosis.judgement.probability[kinds])}" for kinds in shown]
    more = len(diagnosis.judgement.credible) - len(shown)
    said = listed(texts) + (f" and {more} more" if more else "")
    return f"Probability: {said}; {len(diagnosis.table.rows)} explanations fitted"


def improvement_answers(improvement: Improvement) -> Answers:
    """Return the answers for an improvement."""
    first, last = improvement.steps[0].locked, improvement.steps[-1].locked
    added = [kind for step in improvement.steps for kind in step.added]
    good = errors_text(last.rmse, {name: floor.value for name, floor in improvement.floors.items()})
    judged = np.isfinite(last.over_floor)
    good += f", {_ratio(last.over_floor)} the noise" if judged else ", with an unknown share of noise"
    before = _ratio(first.over_floor) if judged else errors_text(first.rmse, {})
    good += f" (before: {before})" if added else ""
    missing = f"Added: {listed(added)}" if added else "Nothing was added"
    where = (
        f"{len(improvement.locked.runs)} runs that were held out at the start"
        if improvement.locked.runs
        else f"{improvement.scored_on}; no run was held out"
    )
    after = "Use the new study, and check it on a run that it has not seen." if added else improvement.reason
    sure = (
        f"± {number(improvement.steps[-1].locked_se, 2)} times the noise, on {where}"
        if judged
        else f"On {where}"
    )
    return answers(good, missing, sure, proposed(improvement.next_run) or after)


def proposed(run: NextRun | None) -> str:
    """Return a proposed run in words; empty without one."""
    return "" if run is None else f"Measure: {run.run} ({run.minutes:g} min)."


def errors_text(errors: Mapping[str, float], floors: Mapping[str, float]) -> str:
    """Return rms errors in the units of the outputs, highest over noise first: ``1.2° rms in bend angle``."""

    def above(name: str) -> float:
        floor = floors.get(name, np.nan)
        return -errors[name] / floor if floor > 0 else -errors[name]

    shown = sorted((name for name in errors if np.isfinite(errors[name])), key=above)
    texts = [f"{output_unit(name).text(errors[name], 3)} rms in {output_unit(name).label}" for name in shown]
    rest = len(texts) - MOST_OUTPUTS
    return ", ".join(texts[:MOST_OUTPUTS]) + (f" and {rest} more" if rest > 0 else "")


def _ratio(value: float, times: bool = True) -> str:
    text = f"{value:.2f}" if value < 10 else f"{value:.0f}"
    return f"{text} times" if times else text
