"""A finished search as a document: the answer, its course, its check and its cost, for terminal, page and JSON."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.formatting import listed, percent, plural, quantity, unbroken, units_footer
from pliant.report import render
from pliant.report.document import Document, Warned, answers, capital
from pliant.report.fem import LISTED
from pliant.store.store import write_atomically, writing_in
from pliant.units import strip_unit_suffix
from pliant_search.optimizer import POLISHED
from pliant_search.problem.names import acts, metric_unit, objective_unit
from pliant_search.records import FoundDesign, SearchResult, Slope, Verification
from pliant_search.report.folder import DrawnDesign, read_search, search_json, write_search
from pliant_search.report.page import search_drawn
from pliant_search.report.view import SearchView, price

PAGE = "search.html"  # in the same folder as report.html, which `pliant run` writes
FAR = 0.1  # of the predicted objective: a larger deviation of the verified one gives a warning
OFTEN = 0.2  # of the candidates: more failures give a warning
LATE = 0.9  # of the search: a best design that came later may not be the last
# On the terminal:
STEEPEST = 3
MOST_DESIGNS = 6
MOST_CAUSES = 4
MOST_METRICS = 4
AS_IT_SHOULD = {"converged": 1.0, "outside_domain": 0.0, "unsettled_levels": 0.0}  # values not reported


def write_search_page(
    folder: Path, study: Study, result: SearchResult, drawn: Sequence[DrawnDesign] = ()
) -> Path:
    """Write `search.html` and the record from which `pliant report` rebuilds it; returns the page's path.

    Args:
        folder: of the search; created if it is missing.
        study: the searched one.
        result: the record.
        drawn: designs to draw, the best first; empty leaves their section out.

    Raises:
        UserError: the folder cannot be written.
    """
    write_search(folder, study.canonical(), result, drawn)
    return _write(folder, study.canonical(), result, drawn)


def rebuild_search_page(folder: Path) -> Path:
    """Write `search.html` again from the folder's record; raises `UserError` for a missing record."""
    return _write(folder, *read_search(folder))


def _write(
    folder: Path, study: Mapping[str, Any], result: SearchResult, drawn: Sequence[DrawnDesign]
) -> Path:
    html = render.page(search_document(study, result, drawn)).html
    with writing_in(folder):
        write_atomically(folder / PAGE, html)
    return folder / PAGE


def search_document(
    study: Mapping[str, Any], result: SearchResult, designs: Sequence[DrawnDesign] = (), engine: str = ""
) -> Document:
    """Return the document of `pliant optimize`.

    Args:
        study: all defaults, SI (`Study.canonical`).
        result: the record.
        designs: to draw; empty leaves their section out.
        engine: kind of the study's own engine, whose check comes first.
    """
    view = SearchView(result, study)

    limits = [unbroken(sentence) for sentence in result.limits]
    return Document(
        kind="Pliant optimize",
        title=str(study.get("name", "Search")),
        sentence=answer(view),
        data=search_json(result, engine),
        brief=tuple(lines(result, engine)) if result.best else (),
        answers=_answers(view, limits),
        points=(
            *limits,
            *([price(view)] if result.robustness is not None else []),
            *([f"Polish: {polish_said(result)}."] if result.polished else []),
            *(f"Round {sentence}." for sentence in each_round(result)),
        ),
        warnings=tuple(warned(view)),
        draw=lambda: search_drawn(view, designs),
        footer=units_footer(lengths="m", pressures="Pa", angles="rad"),
    )


def _answers(read: SearchView, limits: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return the limits of the answer, and whether it was checked."""
    found = read.result.verification
    if not read.result.best:
        return answers(
            after="Widen the ranges or ease the constraints that refuse most candidates; see below."
        )
    sure = "Nothing was verified: the numbers rest on the laws that the search used."
    if found is not None:
        how = "Verified by direct FEM" if found.laws else "Checked again"
        sure = f"{how} in {listed(list(found.verified))}."
        if found.broken:
            sure = f"Not confirmed by direct FEM: {broken_said(found)}."
    best, objective = read.result.best[0], read.objective
    value = objective.unit.text(best.objectives[objective.name])
    return answers(
        f"{objective.unit.label} {value}, the best of {plural(read.result.evaluations, 'evaluated design')}"
        if read.shape == "one"
        else "",
        missing=" ".join(limits[:2]),
        sure=sure,
        after="Make the best design and measure it; pliant compare says how far the model holds.",
    )


def answer(read: SearchView) -> str:
    """Return the best design's objective, predicted and verified; or a sentence that no design was found."""
    result, first = read.result, read.objective
    if not result.best:
        broken = int(read.broken.sum())
        return (
            f"No design was found among {plural(len(result.history), 'candidate')}: {sum(result.refused.values())} "
            f"refused, {sum(result.failed.values())} failed"
            f"{f', {broken} simulated that break a constraint on metrics' if broken else ''}."
        )

    def span(k: int) -> tuple[str, str]:
        objective = read.objectives[k]
        values = [float(d.objectives[objective.name]) for d in result.best]
        return objective.unit.text(min(values)), objective.unit.text(max(values))

    evaluated, found = plural(result.evaluations, "evaluated design"), result.verification
    if read.shape == "contextual":
        low, high = span(0)
        text = (
            f"one design for each of {len(result.best)} conditions, {first.unit.label} from {low} to {high}"
        )
        text += f", learned from {evaluated}"
    elif read.shape == "front":
        each = (
            " to ".join([f"{o.unit.label} {span(k)[0]}", span(k)[1]]) for k, o in enumerate(read.objectives)
        )
        text = f"a front of {plural(len(result.best), 'compromise')} of {evaluated}: {'; '.join(each)}"
    else:
        value = first.unit.text(result.best[0].objectives[first.name])
        how = ", predicted and not verified" if found is None else " as the search predicts it"
        text = f"the best of {evaluated}: {first.unit.label} {value}{how}"
    if found is not None and read.shape in ("one", "front"):
        name = read.objective.metric
        values = [
            f"{first.unit.text(m[name])} in {engine}" for engine, m in found.verified.items() if name in m
        ]
        how = "verified by direct FEM" if found.laws else "checked again"
        text += f"; {how}: {', '.join(values)}" if values else ""
        if found.broken:
            text = f"no design is confirmed: by direct FEM the best one breaks {broken_said(found)}; it is {text}"
        elif result.refused_by_check:
            count = len(result.refused_by_check)
            text += f"; {plural(count, 'better one')} broke a constraint by direct FEM"
    if result.rounds:
        text += "; " + rounds_said(result)
    return unbroken(capital(text) + ".")


def rounds_said(result: SearchResult) -> str:
    """Return how often the search continued with FEM of refused designs, as part of a sentence."""
    count = len(result.rounds)
    first = "its best design" if count == 1 else f"{plural(count, 'best design')} in a row"
    what = "broke a constraint" if any(one.broken for one in result.rounds) else "leant on extrapolation"
    return f"by direct FEM {first} {what}, and the search went on with that among its data"


def each_round(result: SearchResult) -> Iterator[str]:
    """Yield the outcome of each round before the last, in words."""
    for number, one in enumerate(result.rounds, start=1):
        off = f", its law {percent(one.worst_of_range)} of the range off" if one.worst_of_range > 0 else ""
        breaks = f"breaks {', '.join(one.broken)}" if one.broken else "leans on extrapolation"
        yield (
            f"{number}: {plural(one.evaluations, 'evaluation')}; by direct FEM the best design, "
            f"{best_said(result, one.best)}, {breaks}{off}"
        )


def polish_said(result: SearchResult) -> str:
    """Return the descents from the best candidates in words: how many, at what cost, from what to what."""
    descents, better = result.polished, max if result.maximised[0] else min
    sides = [better(getattr(one, side) for one in descents) for side in ("before", "after")]
    metrics = result.best[0].metrics if result.best else {}
    unit = objective_unit(result.objectives[0], result.variables, metrics)
    before, after = (quantity(value, unit, 4) for value in sides)
    slopes = plural(sum(one.steps for one in descents), "slope")
    evaluated = plural(sum(one.evaluations for one in descents), "evaluation")
    gained = sum(one.after != one.before for one in descents)
    return (
        f"{plural(len(descents), 'descent')} with {slopes} and {evaluated}, {gained} of them to a better design: "
        f"{result.objectives[0]} {before} before, {after} after"
    )


def broken_said(check: Verification) -> str:
    """Return the constraints that the check breaks, with its values of the metrics in them."""
    said = []
    for engine, constraints in check.broken.items():
        metrics = check.verified.get(engine, {})
        for text in constraints:
            names = [name for name in metrics if re.search(rf"\b{re.escape(name)}\b", text)]
            values = [f"{name} {quantity(metrics[name], metric_unit(name, metrics), 4)}" for name in names]
            said.append(f"{text} in {engine}" + (f" ({', '.join(values)})" if values else ""))
    return "; ".join(said)


def warned(read: SearchView) -> Iterator[Warned]:
    """Yield limits of the numbers, the gravest first."""
    result, found = read.result, read.result.verification
    if result.best and found is None:
        yield Warned("Nothing was verified: every number rests on the laws that the search used.")
    if found is not None:
        for engine, metrics in found.verified.items():
            name, text = read.objective.metric, read.objective.unit.text
            predicted, verified = found.predicted.get(engine, {}).get(name), metrics.get(name)
            if predicted is None or verified is None or not np.isfinite([predicted, verified]).all():
                continue
            off = abs(verified - predicted) / max(abs(predicted), 1e-12)
            if off > FAR:
                sentence = (
                    f"In {engine} the verified {read.objective.unit.label} is {text(verified)}, {percent(off)} off the "
                    f"predicted {text(predicted)}."
                )
                yield Warned(unbroken(sentence))
        yield from map(Warned, found.notes)
    if (failures := sum(result.failed.values())) > OFTEN * max(result.evaluations, 1):
        sentence = f"{failures} of {plural(result.evaluations, 'evaluation')} failed; good designs may be among them."
        yield Warned(sentence, tuple(f"{cause}: {n}" for cause, n in list(result.failed.items())[:LISTED]))
    if late(read):
        yield Warned(
            "The best design came in the last tenth of a search that its budget ended: a longer one may do better."
        )
    if tied := sum(1 for s in result.slopes if s.at_bound):
        verb = "stands on its bound" if tied == 1 else "stand on their bounds"
        yield Warned(f"{plural(tied, 'variable')} of the best design {verb}: a wider range may do better.")


def late(read: SearchView) -> bool:
    """Return whether the best single design came at the end of its search, which only the budget ended."""
    best, result = read.best, read.result
    polished = best is not None and best.number == POLISHED
    if best is None or polished or read.shape != "one" or result.stopped != "budget" or not len(read.order()):
        return False
    own = np.flatnonzero(np.asarray(result.history.branch) == best.branch)
    row = int(read.order()[0])
    return len(own) >= 10 and int(np.searchsorted(own, row)) >= LATE * len(own)


def lines(result: SearchResult, engine: str) -> Iterator[str]:
    """Yield the lines of the terminal; `engine` is the study's own."""
    for design in result.best[:MOST_DESIGNS]:
        yield from _design(result, design)
    if len(result.best) > MOST_DESIGNS:
        yield f"         and {len(result.best) - MOST_DESIGNS} more"
    yield _effort(result)
    if result.polished:
        yield f"polish   {polish_said(result)}"
    yield from (f"round    {sentence}" for sentence in each_round(result))
    for word, causes in (("refused", result.refused), ("failed", result.failed)):
        listed = list(causes.items())
        yield from (f"{word:<8} {count} × {cause}" for cause, count in listed[:MOST_CAUSES])
        if left := listed[MOST_CAUSES:]:
            yield f"         {sum(count for _, count in left)} × {len(left)} other causes"
    unit = objective_unit(result.objectives[0], result.variables, result.best[0].metrics)
    for slope in steepest(result.slopes):
        bound = f", at its {slope.at_bound} bound" if slope.at_bound else ""
        yield f"slope    {slope.name}: {quantity(slope.change, unit, 2)} for 1 % of its range{bound}"
    yield from (f"limit    {sentence}" for sentence in result.limits)
    if (found := result.robustness) is not None:
        measure = f"{found.measure} {found.level:g}" if found.measure == "cvar" else found.measure
        robust, of_nominal, undisturbed, nominal = (
            quantity(value, unit, 3)
            for value in (
                found.robust_of_robust, found.robust_of_nominal, found.nominal_of_robust, found.nominal_of_nominal,
            )
        )  # fmt: skip
        together = f"robust   {measure} over {found.samples} scenarios {robust}"
        if result.nominal_is_robust:
            yield f"{together}; undisturbed {undisturbed}: the best nominal design, nothing more robust was found"
        else:
            yield (
                f"{together} (nominal design {of_nominal}); undisturbed {undisturbed} (nominal design {nominal})"
            )
    yield from _checked(result, engine)


def best_said(result: SearchResult, design: FoundDesign) -> str:
    """Return objectives in words: rmse 1.2 mm."""
    return ", ".join(
        f"{name} {quantity(value, objective_unit(name, result.variables, design.metrics), 4)}"
        for name, value in design.objectives.items()
    )


def steepest(slopes: Sequence[Slope]) -> list[Slope]:
    """Return the variables with the largest slopes."""
    known = [slope for slope in slopes if math.isfinite(slope.change)]
    return sorted(known, key=lambda slope: -abs(slope.change))[:STEEPEST]


def _design(result: SearchResult, design: FoundDesign) -> Iterator[str]:
    known = {variable.name: variable for variable in result.variables}
    where = f" for {result.conditions[design.context]}" if design.context >= 0 and result.conditions else ""
    origins = {POLISHED: ", polished", -1: ", as the optimizer recommends"}
    recommended = origins.get(design.number, "")
    yield f"best     {best_said(result, design)}{where}{recommended}"
    if design.first:
        before = best_said(result, replace(design, objectives=design.first))
        yield f"         {before} in the search, before it was tried again"
    for name, value in design.values.items():
        unit = known[name].unit if name in known else ""
        if name not in known or acts(known[name], design):
            text = str(value) if isinstance(value, int) and not unit else quantity(value, unit, 4)
            yield f"         {name:<32} {text}"
    stated = {name.rpartition(".")[2] for name in design.objectives}
    numbers = [
        f"{strip_unit_suffix(name)} {quantity(value, metric_unit(name, design.metrics), 3)}"
        for name, value in design.metrics.items()
        if math.isfinite(value)
        and not {name, strip_unit_suffix(name)} & stated
        and AS_IT_SHOULD.get(name) != value
    ]
    if numbers:
        yield f"         {', '.join(numbers[:MOST_METRICS])}"


def _effort(result: SearchResult) -> str:
    rate = result.evaluations / result.wall_s if result.wall_s > 0 else 0.0
    speed = f"{rate:.1f}/s" if rate >= 1 else f"{1 / rate:.1f} s each" if rate else ""
    of_many = f" in {len(result.branches)} searches" if len(result.branches) > 1 else ""
    took = f"{result.wall_s:.1f} s" if result.wall_s < 120 else f"{result.wall_s / 60:.1f} min"
    ends = {
        "budget": "the budget is used up",
        "until": "'until' is reached",
        "exhausted": "ended early: nothing more to try",
    }
    return (
        f"search   {result.optimizer}, {result.evaluations} evaluations{of_many} with {result.simulations} simulations "
        f"in {took} ({speed}); {ends.get(result.stopped, result.stopped)}"
    )


def _checked(result: SearchResult, engine: str) -> Iterator[str]:
    """Yield metrics of the objectives first, verified against predicted; then the laws."""
    check = result.verification
    if check is None:
        return
    for kind in dict.fromkeys((engine, *check.verified, *check.predicted)):
        verified, predicted = check.verified.get(kind, {}), check.predicted.get(kind, {})
        units = {name: metric_unit(name, {**predicted, **verified}) for name in {**predicted, **verified}}
        stems = {name: strip_unit_suffix(name) if unit else name for name, unit in units.items()}
        wanted = [name for name in units if any(stems[name] in text for text in result.objectives)]
        others = [n for n in units if AS_IT_SHOULD.get(n) != verified.get(n, predicted.get(n))]
        parts = []
        for name in (wanted or others)[:MOST_METRICS]:
            sides = (("verified", verified), ("predicted", predicted))
            told = [f"{quantity(of[name], units[name], 3)} {side}" for side, of in sides if name in of]
            parts.append(f"{stems[name]} {', '.join(told)}")
        if units:
            yield f"checked  {kind}: {'; '.join(parts)}"
    for law in check.laws:
        if "rmse_of_range" in law:
            yield (
                f"law      {law.get('name') or 'of the design'}: misses FEM by {100 * law['rmse_of_range']:.2g} % of "
                f"the range (rms), {100 * law['worst_of_range']:.2g} % at worst, {law['n_states']} states"
            )
