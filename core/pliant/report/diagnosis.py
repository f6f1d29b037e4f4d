"""A diagnosis as a document: verdict, hypotheses, effect of the best one, open questions."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis, is_record_mistake, next_words, why
from pliant.diagnosis.evidence_table import LAW, NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.posterior import Posterior, laplace_posterior
from pliant.diagnosis.verdict import named
from pliant.formatting import listed, number, output_unit
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry
from pliant.report.answers import diagnosis_answers
from pliant.report.bookkeeping import mistakes_json, mistakes_warned, not_repeated
from pliant.report.diagnosis_page import (
    classes_table,
    dependence_chart,
    dependence_table,
    detectable_table,
    explained_chart,
    hypotheses_chart,
    hypotheses_json,
    hypotheses_table,
    hypothesis_columns,
    look_alikes_table,
    noise_table,
    not_excited_table,
    parameter_texts,
    repeats_chart,
)
from pliant.report.document import (
    Document,
    Drawn,
    Picture,
    Section,
    Warned,
    brief_table,
    capital,
    drawn,
    picture,
    section,
)
from pliant.report.evidence_view import Diagnosed
from pliant.report.fitted import (
    floors_json,
    implausible_text,
    most_probable,
    next_run_json,
    probability_text,
    verdict_json,
    warned,
)
from pliant.report.learned import law_error_json, law_section, learned_json, learned_section
from pliant.report.posterior import posterior_json, unseen_words

OUTPUTS_DRAWN = 2
MOST_PAIRS = 6
MOST_SHOWN = 6  # hypotheses on the terminal
WIDTH = 80  # characters of a line there
DEMANDS = {
    "missing_effect": "Add the effect to the study with pliant extend, and compare again.",
    "bench": "Correct the file, not the physics: put the number right where it was written down and compare again.",
    "class": "For predictions, extend the study with the first of them: the others would do the same in such runs. "
    "The run below, or an inspection of the bench, decides between them.",
    "class_with_law": "Record the run below, which distinguishes an error of the law from the effect; until then "
    "pliant improve uses the better prediction.",
    "ambiguous": "Record the run below, add it to the data and diagnose again; do not extend the study yet.",
    "nothing_missing": "Leave the model as it is for what these runs cover.",
    "law_off": "Correct the law: solve FEM states there, try another surrogate or material, or let pliant improve add "
    "the correction.",
    "unknown_effect": "Do not extend the study with an effect that does not reach the floor; measure what the error "
    "depends on.",
    "not_repeatable": "Look at the repeats below: a shift, a drift and a remounted specimen look different there.",
    "insufficient_data": "Record the run below, add it to the data and diagnose again.",
}
LITTLE_LEFT = (
    "Leave the model as it is unless so small an error matters to you; no effect can take more of it away."
)
# Verdicts that ask for the next run; without one, for more of everything.
NEEDS_RUNS = ("ambiguous", "insufficient_data")
NUMBERS = (
    "Measure or fit the masses, lengths and gains of the model: their errors hide effects that are smaller."
)
RECORD = "Record other rates, holds, loads, orientations, each twice, and diagnose again; do not extend the study yet."


def diagnosis_document(
    title: str,
    measurement: Measurement,
    diagnosis: Diagnosis,
    registry: Registry,
    *,
    asked: Sequence[str] = (),
    next_file: str | None = None,
) -> Document:
    """Return the document of `pliant diagnose`.

    Args:
        title: the study's name.
        measurement: the diagnosed one.
        diagnosis: its result.
        registry: with the descriptions of the effects.
        asked: effects requested by name; if impossible, the reason is given for each.
        next_file: the protocol file of the proposed run.
    """
    reasons = why(diagnosis, registry)
    demand = _demand(diagnosis, registry)
    points = [*reasons, demand]
    sentence = numbers_text(diagnosis) or points[0]
    proposed = next_words(diagnosis)
    return Document(
        kind=f"Pliant: which effect is missing · {title}",
        title=diagnosis.judgement.sentence,
        sentence=sentence,
        data=diagnosis_json(diagnosis, next_file),
        brief=_brief(diagnosis),
        answers=diagnosis_answers(diagnosis, demand),
        points=tuple(point for point in points if point != sentence),
        warnings=(
            *mistakes_warned(diagnosis.bookkeeping),
            *(Warned(text) for text in implausible(diagnosis)),
            *warned(registry, not_repeated(diagnosis.remarks, measurement, diagnosis.bookkeeping), asked),
        ),
        closing=(
            diagnosis.judgement.sentence,
            *reasons,
            *([proposed] if proposed else []),
            *([f"next run {next_file}"] if next_file else []),
        ),
        draw=lambda: _drawn(Diagnosed(diagnosis.measurement, diagnosis), registry),
        footer=f"Measurement: {measurement.source or 'given in memory'}. Errors are measured − model",
    )


def _demand(diagnosis: Diagnosis, registry: Registry) -> str:
    """Return the next action, by the verdict and the remaining gain."""
    small, verdict = diagnosis.judgement.small, diagnosis.verdict
    if verdict == "unknown_effect" and small:
        return LITTLE_LEFT
    if diagnosis.judgement.number_error:
        return NUMBERS
    if verdict == "nothing_missing" and not small:
        return RECORD
    if diagnosis.judgement.selected_class:
        return DEMANDS["class_with_law" if LAW in diagnosis.judgement.selected_class else "class"]
    if diagnosis.selected and all(is_record_mistake(registry, kind) for kind in diagnosis.selected):
        return DEMANDS["bench"]
    decided = diagnosis.next_run is not None or verdict not in NEEDS_RUNS
    return DEMANDS[verdict] if decided else RECORD


def diagnosis_json(diagnosis: Diagnosis, next_file: str | None = None) -> dict[str, Any]:
    """Return the keys of docs/which_effect.md; numbers SI."""
    noise = diagnosis.noise
    return {
        **verdict_json(diagnosis.judgement),
        "bookkeeping": mistakes_json(diagnosis.bookkeeping),
        "hypotheses": hypotheses_json(diagnosis),
        "not_excited": [
            {"kind": kind, "run_that_would_excite_it": run} for kind, run in diagnosis.not_excited.items()
        ],
        "indistinguishable": [vars(pair) for pair in diagnosis.indistinguishable],
        "classes": [vars(one) for one in diagnosis.classes],
        "posterior": None
        if (posterior := selected_posterior(diagnosis)) is None
        else posterior_json(posterior),
        "covariates": [
            {"name": name, "importance": value} for name, value in diagnosis.depends_on.items() if value > 0.0
        ],
        "next_experiment": next_run_json(diagnosis.next_run, next_file),
        "learned": learned_json(diagnosis.learned),
        "law_error": law_error_json(diagnosis.law_off),
        "smallest_detectable": [vars(one) for one in diagnosis.detectable],
        "floor": floors_json(noise.floors),
        "n_samples": diagnosis.table.n_readings,
        "n_effective": noise.n_effective,
        "slip": noise.between_run_scatter,
        "drift": None
        if noise.drift is None
        else {"output": noise.drift.output, "share": noise.drift.share, "over_floor": noise.drift.size},
        "judged": noise.judged,
        "remarks": list(diagnosis.remarks),
        "wall_s": diagnosis.wall_s,
    }


def selected_posterior(diagnosis: Diagnosis) -> Posterior | None:
    """Return the posterior of the selected effects; None where the verdict selects none."""
    if not diagnosis.selected:
        return None
    fit = diagnosis.fits[diagnosis.selected]
    return laplace_posterior(fit, np.ones(len(diagnosis.readings)), diagnosis.noise.n_effective)


def _unseen(diagnosis: Diagnosis) -> list[str]:
    posterior = selected_posterior(diagnosis)
    return [] if posterior is None else unseen_words(posterior)


def numbers_text(diagnosis: Diagnosis) -> str:
    """Return the numbers behind the verdict: held-out errors before and after, probabilities; may be empty."""
    probability = diagnosis.judgement.probability
    best = next((kinds for kinds in probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    before, after = (
        diagnosis.table.over_floor(diagnosis.table.rows[kinds].heldout_square) for kinds in (NOTHING, best)
    )
    if not math.isfinite(before) or diagnosis.verdict in ("not_repeatable", "insufficient_data"):
        return ""
    fall = f"the error on runs left out of the fit falls from {before:.2f} to {after:.2f} × the noise floor"
    if diagnosis.verdict == "unknown_effect":
        return f"Even with {named(best)}, the most probable in the list, {fall} only."
    if diagnosis.verdict == "missing_effect":
        return f"With {named(best)} {fall} (probability {probability_text(probability[best])})."
    if diagnosis.verdict in ("nothing_missing", "law_off"):
        return f"The model as it is leaves an error of {before:.2f} × the noise floor."
    probable = [f"{named(k)} {probability_text(probability[k])}" for k in diagnosis.judgement.credible[:4]]
    return f"The model as it is leaves {before:.2f} × the noise floor. Probabilities: {', '.join(probable)}."


def implausible(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each necessary parameter of the best explanation outside its plausible range."""
    fitted = diagnosis.estimates.get(diagnosis.explained)
    return (
        []
        if fitted is None
        else [implausible_text(e) for e in fitted.estimates if not (e.plausible or e.simpler)]
    )


def leading(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the kinds of effects that a page is about: those selected, else those of the most probable hypotheses."""
    if diagnosis.selected:
        return tuple(diagnosis.selected)
    known = {kind for kinds in diagnosis.judgement.credible for kind in kinds}
    return tuple(sorted(known - {LAW, *UNKNOWN}))


def _brief(diagnosis: Diagnosis) -> tuple[Any, ...]:
    rows, which = most_probable(diagnosis.judgement.probability, MOST_SHOWN)
    shown = diagnosis.judgement.credible[:MOST_SHOWN]
    fitted = [f"{named(k)}: {', '.join(texts)}" for k in shown if (texts := parameter_texts(diagnosis, k))]
    fitted += _unseen(diagnosis)
    lines = [line for text in fitted for line in textwrap.wrap(text, WIDTH, subsequent_indent="  ")]
    if diagnosis.not_excited:
        lines.append("not shown by these runs, and the run that would show it:")
        lines += [f"  {kind}: {run}" if run else f"  {kind}" for kind, run in diagnosis.not_excited.items()]
    return (brief_table(hypothesis_columns(diagnosis), rows, which), *lines)


def _drawn(diagnosed: Diagnosed, registry: Registry) -> Drawn:

    found, output = diagnosed.found, diagnosed.outputs_by_gain()[0]
    label = output_unit(output).label
    depends = picture(
        "depends",
        f"Mean error in {label} against the circumstances that explain most of it. Bars: 95 % under noise; filled: "
        "more than noise, corrected for looking at many places. An explanation that is right flattens all of them, not "
        "only one.",
        dependence_chart(diagnosed, output),
    )
    table = dependence_table(diagnosed)
    repeats = picture(
        "repeats",
        f"Repeats in {label}, each less their mean. The band is ± 2 times the noise within a run: runs that leave it "
        "as a whole have moved between one another.",
        repeats_chart(diagnosed, output),
    )
    made = [
        _next(found),
        _changes(diagnosed),
        learned_section(found.learned),
        law_section(found.law_off),
        section(
            "What the error depends on",
            depends,
            table,
            note="" if table is not None else "The error that is left depends on nothing that was recorded.",
        )
        if depends is not None
        else None,
        _limits(found, registry),
        section("Numbers", hypotheses_table(found, diagnosed.hypotheses()), text=_unseen(found)),
        section(
            "Noise",
            repeats,
            noise_table(found),
            text=_noise_text(found, repeats is not None),
            open=found.verdict == "not_repeatable",
        ),
    ]
    if found.verdict == "not_repeatable":  # the repeats are the finding
        made.insert(0, made.pop())
    doubt = found.verdict in ("not_repeatable", "insufficient_data")
    caption = (
        f"{'For completeness; no verdict rests on these numbers. ' if doubt else ''}"
        f"{len(found.table.rows)} explanations were fitted to all runs with the physics in the loop. Dark: "
        "together at least 90 % probable. A good explanation brings the error on runs that it was not fitted to down "
        "to the noise floor, with few parameters; a lower error with more parameters need not be more probable."
    )
    hero = Picture("hypotheses", caption, hypotheses_chart(diagnosed))
    return drawn(hero, *made)


def _next(diagnosis: Diagnosis) -> Section | None:
    step = diagnosis.next_run
    if step is None:
        return None
    text = [f"{capital(step.run)} ({step.minutes:g} min).", f"Why: {step.why}."]
    if step.separates:
        text.append(f"One such run would distinguish {_separated(step.separates)}.")
    title = "What to measure next" if diagnosis.verdict != "missing_effect" else "To be surer still"
    return Section(title, text=tuple(text), open=True)


def _separated(pairs: Sequence[tuple[Kinds, Kinds]]) -> str:
    """Return pairs in words, those with the same first member together."""
    every = list(dict.fromkeys(kinds for pair in pairs for kinds in pair))
    if len(every) > 2 and len(pairs) == len(every) * (len(every) - 1) // 2:
        return f"{listed([named(kinds) for kinds in every])} from one another"
    if len(pairs) > MOST_PAIRS:
        return f"{len(pairs)} of the {len(every) * (len(every) - 1) // 2} pairs of these explanations apart"
    others: dict[Kinds, list[str]] = {}
    for a, b in pairs:
        others.setdefault(a, []).append(named(b))
    return "; ".join(f"{named(a)} from {listed(names)}" for a, names in others.items())


def _changes(diagnosed: Diagnosed) -> Section:
    found, pictures = diagnosed.found, []
    which = (
        "the runs in which the explanation takes away most of the error, one of each condition"
        if diagnosed.explanations
        else "the runs in which the model errs most, one of each condition"
    )
    for k, output in enumerate(diagnosed.outputs_by_gain()[:OUTPUTS_DRAWN], start=1):
        words, floor = output_unit(output), diagnosed.floor(output)
        band = f" over ± 2 noise floors (one is {words.text(floor, 2)})" if np.isfinite(floor) else ""
        caption = (
            f"{capital(words.label)} in {which}: in time, the error (measured − model){band}, and the loop over the "
            "input."
        )
        pictures.append(Picture(f"changes_{k}", caption, explained_chart(diagnosed, output)))
    names = " or ".join(named(kinds) for kinds in diagnosed.explanations)
    title = {
        "missing_effect": f"What {names} changes",
        "unknown_effect": f"The most probable in the list, {names}, does not do it",
    }.get(found.verdict, f"What {names} would change")
    return Section(title if names else "The model in its worst runs", tuple(pictures), open=True)


def _limits(diagnosis: Diagnosis, registry: Registry) -> Section:
    notes = {
        kind: registry.get("effect", kind).implementation_class().notes for kind in diagnosis.excitations
    }
    made = (
        not_excited_table(diagnosis),
        classes_table(diagnosis),
        look_alikes_table(diagnosis, notes),
        detectable_table(diagnosis),
    )
    asked, unexcited = len(diagnosis.excitations), len(diagnosis.not_excited)
    text = f"These runs excite {asked - unexcited} of the {asked} candidate effects."
    text += "" if diagnosis.indistinguishable else " They distinguish all of these from each other."
    tables = tuple(table for table in made if table is not None)
    return Section("What these runs could not show", tables=tables, text=(text,))


def _noise_text(diagnosis: Diagnosis, repeated: bool) -> list[str]:
    text = [
        f"{diagnosis.table.n_readings} readings. Their effective sample size is "
        f"{diagnosis.noise.n_effective:.0f} in what the best explanation leaves, since neighbours in time share their "
        "noise. All probabilities rest on the smaller number."
    ]
    scatter = diagnosis.noise.between_run_scatter
    if not repeated:
        text.append(
            "No run has the same inputs as another, so that the repeatability of the bench is unknown."
        )
    elif scatter < 1.05:
        text.append(
            "Runs with the same inputs scatter no more than readings within a run: the bench repeats."
        )
    else:
        times = number(scatter, 2)
        text.append(f"Runs with the same inputs scatter {times} times as much as readings within a run.")
    if not diagnosis.noise.judged:
        text.append(
            "The floor comes from neighbouring readings only. Slow noise and offsets between runs are invisible to it: "
            "an error above it need not be the model's, and “an effect outside the list” cannot be judged."
        )
    return text
