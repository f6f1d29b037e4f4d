"""The page of a search: pictures and tables, each with a sentence on its meaning and its limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from pliant.formatting import number, percent, seconds
from pliant.report.chart import Chart
from pliant.report.contact_charts import stills_chart
from pliant.report.document import Cells, Drawn, Picture, Section, Table, capital, drawn, picture, section
from pliant.report.pose_charts import backbone_caption, backbone_chart
from pliant.report.provenance import input_table
from pliant_search.report.charts import (
    branches_chart,
    designs_chart,
    front_chart,
    history_chart,
    robust_chart,
    slopes_chart,
    successes_chart,
    verified_chart,
)
from pliant_search.report.folder import DrawnDesign
from pliant_search.report.variable_charts import answer_chart, parallel_chart, policy_chart
from pliant_search.report.view import (
    NO_RESULT,
    Axis,
    SearchView,
    evenly_spaced,
    labelled_metric_unit,
    measure_words,
    price,
)

MOST_COLUMNS = 8  # designs next to each other
MOST_BRANCHES = 10
MOST_METRICS = 12


def search_drawn(read: SearchView, designs: Sequence[DrawnDesign]) -> Drawn:
    """Return a page: the best designs in their ranges or else the history; then all parts of the record."""
    marks = "Marks are the best designs" if len(read.result.best) > 1 else "The mark is the best design"
    caption = (
        f"{marks}; each bar is the range that was searched, ticks are whole numbers and choices. A mark at an end of "
        "its bar says that the range, not the physics, may have set it."
    )
    took = "Wall times are those of the machine that searched; the counts are the same on every machine."
    return drawn(
        picture("search_answer", caption, answer_chart(read)) or _history_picture(read),
        section("The answer", design_table(read), text=_how_found(read), open=True),
        _history(read),
        _pictured(read, parallel_chart, PARALLEL),
        _designs(designs),
        _pictured(read, slopes_chart, SLOPES, _slope_table),
        _verified(read),
        robust_section(read),
        _pictured(read, policy_chart, POLICY),
        _pictured(read, front_chart, FRONT),
        section("What it took", _cost_table(read), _cause_table(read), text=took),
        section("Inputs", input_table(read.study)),
    )


def _how_found(read: SearchView) -> str:
    """Return a sentence on how reliable the best designs are."""
    if read.shape == "front":
        return (
            "No design of the front is beaten by another in every objective; which one is wanted is not for a search "
            "to say."
        )
    if read.shape == "one":
        return (
            "The best design is the best of those that were tried; nothing shows that no better one exists."
        )
    if any(design.number < 0 for design in read.result.best):
        return (
            "The optimizer recommends one design for each condition: the middle of what it has learned, which need not "
            "be the best single candidate that it tried."
        )
    if any(design.first for design in read.result.best):
        return "For each condition the best of the few designs that were tried again in it."
    return (
        "For each condition the best of the designs that were tried in it; a lucky trial may have made it so."
    )


# Sections of one picture: title, name of the picture, its caption, its meaning and limits.
PARALLEL = (
    "All variables at once",
    "search_parallel",
    "Each line is a candidate, each row a variable, the last row {label}: dark lines are good, the best is orange. Of "
    "many candidates the best tenth (at most 200) and an even choice of the rest are drawn.",
    "Where dark lines meet in one place, good designs agree on that variable. Optimizers try most where they have "
    "found something, so an empty stretch was not tried; it need not be bad.",
)
SLOPES = (
    "What the objective is sensitive to",
    "search_slopes",
    "{title} about the best design (star), one variable changed at a time, the most influential first. Crosses: no "
    "possible design, or it failed. An orange edge is a bound on which the design stands.",
    "A steep curve asks for care in manufacture, a flat one leaves freedom. One variable at a time cannot show what "
    "two of them do together.",
)
POLICY = (
    "Which design for which condition",
    "search_policy",
    "Designs tried for each condition in the last quarter of the search: dots, 5 to 95 % as a thin line, the middle "
    "half as a thick one. The star is the recommended design.",
    "Conditions whose spreads part want different designs; a wide spread says that the variable matters little there, "
    "or that the optimizer has not settled yet, and the picture does not show which.",
)
FRONT = (
    "The front",
    "search_front",
    "Every candidate by its objectives; orange are designs that no other candidate beats in all of them.",
    "The front is the best that was found: a longer search can only push it further.",
)


def _pictured(
    read: SearchView,
    make: Callable[[SearchView], Chart | None],
    words: tuple[str, str, str, str],
    table: Callable[[SearchView], Table | None] = lambda read: None,
) -> Section | None:
    """Return a section of one picture, with a table if there is the picture."""
    title, name, caption, text = words
    if (chart := make(read)) is None:
        return None
    caption = capital(caption.format(label=read.objective.unit.label, title=read.objective.unit.axis))
    return section(title, Picture(name, caption, chart), table(read), text=text)


def _history(read: SearchView) -> Section | None:
    """Return candidates in order, and the best of every branch."""
    title, searches = "How the search went", len(read.result.branches)
    if read.shape == "none":  # the picture is at the head of the page
        text = "No candidate is feasible, so there is nothing to learn from it but the causes below."
        return Section(title, text=(text,))
    caption = f"The best design of each search, sorted by {read.objective.unit.label}; orange is the winner."
    text = (
        "A curve that has gone flat says that this optimizer found nothing better from there, not that nothing better "
        "exists."
    )
    if searches > 1:
        text = (
            f"{searches} searches of equal budget, one for each structure. One run of each tells little about "
            "structures whose bests lie close together: another seed may swap them."
        )
    strip = picture("search_branches", caption, branches_chart(read))
    return section(title, _history_picture(read), strip, _branch_table(read), text=text)


def _history_picture(read: SearchView) -> Picture:
    lines = "moving medians of each condition" if read.contextual else "the best so far"
    caption = (
        f"{read.objective.unit.label} of every candidate in the order of evaluation, {read.objective.best_word}. The "
        f"lines are {lines}; strokes at the upper rim are candidates without an objective, "
        "dots at the edges lie beyond them."
    )
    return Picture("search_history", capital(caption), history_chart(read))


def _designs(designs: Sequence[DrawnDesign]) -> Section | None:
    """Return the designs as they settle or grasp."""
    if not designs:
        return None
    first = designs[0]
    caption = "The designs at one scale, as the search's laws settle them."
    if stills := first.result.stills:
        caption = (
            "The designs at one scale at the end of their first trial, from the side and from above: outlines of what "
            "collides."
        )
        one = picture("search_stills", f"{first.label}: the first trial.", stills_chart(stills))
    else:
        words = f"{first.label}: {backbone_caption(first.result)}"
        one = picture("search_backbones", words, backbone_chart(first.result))
    text = "Drawn from one run of each design with the search's laws; the check tells how far to trust them."
    every = picture("search_designs", caption, designs_chart(designs))
    return section("The best designs", every, one, text=text)


def _verified(read: SearchView) -> Section | None:
    """Return predicted against verified; None where nothing was, which the page's notes explain."""
    found = read.result.verification
    if found is None or not found.verified:
        return None
    fem = "by laws fitted to FEM of the design itself" if found.laws else "by a second simulation"
    text = (
        "The check replaces the laws of the search; chain, contact and material model stay as they were, so it cannot "
        "show what they leave out. Only a measurement can."
    )
    metrics = f"Metrics as predicted in the search, and {fem}; a row for each engine."
    counted = "Verified successes by condition and engine; bars are 95 % intervals of counting alone."
    return section(
        "Predicted and verified",
        picture("search_verified", metrics, verified_chart(read)),
        picture("search_successes", counted, successes_chart(read)),
        _metrics_table(read),
        _laws_table(read),
        _conditions_table(read),
        text=text,
    )


def robust_section(read: SearchView) -> Section | None:
    """Return nominal against robust design; None if they are the same."""
    found = read.result.robustness
    if found is None:
        return None
    caption = (
        "Both designs in the same scenarios: how many stay up to an objective, and each scenario as a dot with the "
        "median."
    )
    title = "What it costs to be robust"
    text = f"{price(read)} It holds for what was varied, over {found.samples} draws; what was not varied is not in it."
    if read.result.nominal_is_robust:
        return Section(title, text=(text,))
    return section(
        title, picture("search_robust", caption, robust_chart(read)), robust_table(read), text=text
    )


def design_table(read: SearchView) -> Table | None:
    """Return variables, objectives and metrics of the best designs, a column each."""
    best = evenly_spaced(len(read.result.best), MOST_COLUMNS)
    if not best:
        return None
    designs, names = [read.result.best[k] for k in best], read.design_names()
    rows: list[Cells] = [
        [axis.unit.label, *(axis.text(read.value(d, axis.name)) for d in designs), _range(axis)]
        for axis in read.axes
        if any(read.value(d, axis.name) is not None for d in designs)
    ]
    for o in read.objectives:
        goal = "to be large" if o.maximised else "to be small"
        rows.append([o.unit.label, *(o.unit.text(d.objectives.get(o.name, math.nan)) for d in designs), goal])
    own = {*(o.metric for o in read.objectives), *NO_RESULT}
    metrics = [n for n in dict.fromkeys(n for d in designs for n in d.metrics) if n not in own][:MOST_METRICS]
    for name in metrics:
        unit = labelled_metric_unit(name)
        rows.append([unit.label, *(unit.text(d.metrics.get(name, math.nan)) for d in designs), "measured"])
    if read.shape == "one":
        one = designs[0]
        where = "recommended by the optimizer" if one.number < 0 else f"candidate {one.number + 1}"
        if one.first:
            where += f", {read.objective.unit.text(one.first[read.objective.name])} before it was tried again"
        if len(read.result.branches) > 1:
            where += f" of the search {read.branch_names()[one.branch]}"
        rows.append(["found as", where, ""])
    left = len(read.result.best) - len(best)
    note = f"{left} further designs are in the record; these are spread over them." if left > 0 else ""
    return Table("The designs", ["", *(names[k] for k in best), "searched"], rows, note)


def _range(axis: Axis) -> str:
    if axis.choices:
        return ", ".join(axis.choices)
    each = ", each in a search of its own" if axis.variable.each else ""
    return f"{axis.tick(axis.low)} to {axis.tick(axis.high)} {axis.unit.symbol}".strip() + each


def _branch_table(read: SearchView) -> Table | None:
    """Return the best branches."""
    count, found = len(read.result.branches), read.branch_winners()
    if count < 2:
        return None
    names, scores = read.branch_names(), read.scores()
    rows = [
        [str(k + 1), names[branch], number(float(scores[row]), 4)]
        for k, (branch, row) in enumerate(found[:MOST_BRANCHES])
    ]
    note = f"{count - len(found)} of {count} searches found no design." if count > len(found) else ""
    head = ["rank", read.branch_title(), read.objective.unit.axis]
    return Table("The best searches", head, rows, note, numeric=2)


def _slope_table(read: SearchView) -> Table | None:
    """Return the slope of the objective by each variable."""
    axes, unit, best = {axis.name: axis for axis in read.axes}, read.objective.unit, read.best
    rows = [
        [
            axes[s.name].unit.label,
            axes[s.name].text(best.values.get(s.name)) if best is not None else "–",
            unit.text(abs(s.change), 2) if math.isfinite(s.change) else "–",
            unit.text(read.influence(s), 3),
            {"low": "lower", "high": "upper"}.get(s.at_bound, "no"),
            str(int((~np.isfinite(np.asarray(s.objective, float))).sum())),
        ]
        for s in read.by_influence()
    ]
    head = [
        "variable",
        "at",
        "change for 1 % of the range",
        "change over the range",
        "at a bound",
        "not possible",
    ]
    return Table("What each variable does", head, rows) if rows else None


def _metrics_table(read: SearchView) -> Table | None:
    """Return metrics predicted and verified."""
    found = read.result.verification
    assert found is not None
    rows = []
    for name in read.checked_metrics()[:MOST_METRICS]:
        unit = labelled_metric_unit(name)
        for engine, metrics in found.verified.items():
            a, b = found.predicted.get(engine, {}).get(name), metrics.get(name)
            if a is not None and b is not None:
                rows.append([unit.label, engine, unit.text(a), unit.text(b), unit.text(b - a, 3)])
    head = ["metric", "engine", "predicted", "verified", "difference"]
    return Table("Predicted against verified", head, rows, numeric=2) if rows else None


def _laws_table(read: SearchView) -> Table | None:
    """Return the errors of the search's laws against direct FEM."""
    found = read.result.verification
    assert found is not None
    rows = [
        [
            str(law.get("name", f"design {k + 1}")),
            str(law.get("n_states", "–")),
            *(percent(float(law.get(f"{of}_of_range", math.nan)), 3) for of in ("rmse", "worst")),
        ]
        for k, law in enumerate(found.laws)
    ]
    head = ["module design", "FEM states", "RMSE, of the range of torque", "worst, of the range of torque"]
    note = f"Direct FEM took {seconds(found.fem_wall_s)}, the whole check {seconds(found.wall_s)}."
    return Table("What the search's laws miss of direct FEM", head, rows, note) if rows else None


def _conditions_table(read: SearchView) -> Table | None:
    """Return successes as counts; else the objective's metric, by condition and engine."""
    found, counts, name = read.result.verification, read.success_counts(), read.objective.metric
    if found is None or not found.conditions:
        return None
    engines = list(found.conditions)
    conditions = list(dict.fromkeys(c for one in found.conditions.values() for c in one))
    if counts:
        rows: list[Cells] = []
        for c in conditions:
            cells = [counts[e][c or "all trials"] if c in found.conditions[e] else None for e in engines]
            rows.append([c or "all trials", *("–" if n is None else f"{n[0]} / {n[1]}" for n in cells)])
        total = [[sum(pair[k] for pair in counts[e].values()) for k in (0, 1)] for e in engines]
        rows.append(["together", *(f"{good} / {n}" for good, n in total)])
        return Table("Stable grasps, verified", ["condition", *engines], rows)
    if len(conditions) < 2 or not any(name in m for one in found.conditions.values() for m in one.values()):
        return None
    rows = [
        [c, *(read.objective.unit.text(found.conditions[e].get(c, {}).get(name, math.nan)) for e in engines)]
        for c in conditions
    ]
    return Table(f"Verified {read.objective.unit.label} by condition", ["condition", *engines], rows)


def robust_table(read: SearchView) -> Table | None:
    """Return both designs, without deviations and by the measure, and their differences."""
    found, o = read.result.robustness, read.objective
    if found is None:
        return None
    pairs = {
        "nothing deviates": (found.nominal_of_nominal, found.nominal_of_robust),
        measure_words(found): (found.robust_of_nominal, found.robust_of_robust),
    }
    rows: list[Cells] = [
        [f"{o.unit.axis}, {what}", *(number(v * o.unit.factor, 4) for v in both)]
        for what, both in pairs.items()
    ]
    for axis in read.axes:
        values = [d.values.get(axis.name) if d is not None else None for d in (found.nominal, read.best)]
        if any(v is not None for v in values):
            rows.append([axis.unit.label, *map(axis.text, values)])
    note = f"Varied: {'; '.join(found.sources)}." if found.sources else ""
    return Table("Nominal and robust design", ["", "nominal", "robust"], rows, note)


def _cost_table(read: SearchView) -> Table:
    """Return the cost of the search."""
    r = read.result
    ends = {
        "budget": "the budget was spent",
        "until": "what was asked for was reached",
        "exhausted": "nothing was left to try",
    }
    rows = {
        "optimizer": r.optimizer,
        "seed": r.seed,
        "candidates": len(r.history),
        "evaluated": f"{r.evaluations}{f', {seconds(r.wall_s / r.evaluations)} each' if r.evaluations else ''}",
        "simulations": r.simulations,
        "refused without simulation": sum(r.refused.values()),
        "failed": sum(r.failed.values()),
        "simulated, but break a constraint on metrics": int(read.broken.sum()),
        "searches": max(len(r.branches), 1),
        "wall time, all sessions": seconds(r.wall_s),
        "why it ended": ends.get(r.stopped, r.stopped),
    }
    if r.verification is not None:
        rows["check of the best design"] = seconds(r.verification.wall_s)
    return Table("What it took", ["", ""], [[name, str(value)] for name, value in rows.items()])


def _cause_table(read: SearchView) -> Table | None:
    """Return the causes of refusal and failure, most frequent first."""
    listed = (("refused", read.result.refused), ("failed", read.result.failed))
    rows = [
        [what, cause, str(n)]
        for what, causes in listed
        for cause, n in sorted(causes.items(), key=lambda item: -item[1])
    ][: 2 * MOST_METRICS]
    head = ["", "cause", "candidates"]
    return Table("Refused and failed, by cause", head, rows, numeric=2) if rows else None
