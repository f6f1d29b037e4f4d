"""The tables of a search's page: designs, branches, slopes, check, robustness, cost."""

from __future__ import annotations

import math

import numpy as np

from pliant.formatting import number, percent, seconds
from pliant.report.document import Cells, Table
from pliant.report.figures.search_slopes import by_influence, influence
from pliant.report.figures.search_verified import checked_metrics, success_counts
from pliant.report.search_sentences import found_where, measure_words, stopped_words
from pliant.report.search_view import Axis, SearchView, spread_of

MOST_COLUMNS = 8  # designs side by side
MOST_BRANCHES = 10
MOST_METRICS = 12


def design_table(read: SearchView) -> Table | None:
    """Variables, objectives and metrics of the best designs, a column each."""
    best = spread_of(len(read.result.best), MOST_COLUMNS)
    if not best:
        return None
    designs, names = [read.result.best[k] for k in best], read.design_names()
    rows: list[Cells] = [
        [axis.label, *(axis.text(read.value(d, axis.name)) for d in designs), _range(axis)]
        for axis in read.axes
        if any(read.value(d, axis.name) is not None for d in designs)
    ]
    for o in read.objectives:
        goal = "to be large" if o.maximised else "to be small"
        rows.append([o.label, *(o.text(d.objectives.get(o.name, math.nan)) for d in designs), goal])
    own = {*map(read.metric_of, read.objectives), "trials", "outside_domain"}
    metrics = [n for n in dict.fromkeys(n for d in designs for n in d.metrics) if n not in own][:MOST_METRICS]
    for name in metrics:
        label, unit = read.metric(name)
        rows.append([label, *(unit.text(d.metrics.get(name, math.nan)) for d in designs), "measured"])
    if read.shape == "one":
        rows.append(["found as", found_where(read, designs[0]), ""])
    left = len(read.result.best) - len(best)
    note = f"{left} further designs are in the record; these are spread over them." if left > 0 else ""
    return Table("The designs", ["", *(names[k] for k in best), "searched"], rows, note)


def branch_table(read: SearchView) -> Table | None:
    """The best branches."""
    if len(read.result.branches) < 2:
        return None
    names, scores = read.branch_names(), read.scores()
    rows = [
        [str(k + 1), names[branch], number(float(scores[row]), 4)]
        for k, (branch, row) in enumerate(read.best_of_branches()[:MOST_BRANCHES])
    ]
    empty = len(read.result.branches) - len(read.best_of_branches())
    note = f"{empty} of {len(read.result.branches)} searches found no design." if empty else ""
    return Table(
        "The best searches", ["rank", read.branch_title(), read.objective.title], rows, note, numeric=2
    )


def slope_table(read: SearchView) -> Table | None:
    """What each variable does to the objective."""
    axes = {axis.name: axis for axis in read.axes}
    unit = read.objective.unit
    rows = [
        [
            axes[s.name].label,
            axes[s.name].text(read.best.values.get(s.name)) if read.best is not None else "–",
            unit.text(abs(s.change), 2) if math.isfinite(s.change) else "–",
            unit.text(influence(s), 3),
            {"low": "lower", "high": "upper"}.get(s.at_bound, "no"),
            str(int((~np.isfinite(np.asarray(s.objective, float))).sum())),
        ]
        for s in by_influence(read)
    ]
    if not rows:
        return None
    head = [
        "variable",
        "at",
        "change for 1 % of the range",
        "change over the range",
        "at a bound",
        "not possible",
    ]
    return Table("What each variable does", head, rows)


def verified_tables(read: SearchView) -> list[Table]:
    """Metrics predicted and verified, laws, conditions."""
    return [t for t in (_metrics_table(read), _laws_table(read), _conditions_table(read)) if t is not None]


def _metrics_table(read: SearchView) -> Table | None:
    found = read.result.verification
    if found is None:
        return None
    rows = []
    for name in checked_metrics(read)[:MOST_METRICS]:
        label, unit = read.metric(name)
        for engine, metrics in found.verified.items():
            if name not in metrics or name not in found.predicted.get(engine, {}):
                continue
            a, b = float(found.predicted[engine][name]), float(metrics[name])
            rows.append([label, engine, unit.text(a), unit.text(b), unit.text(b - a, 3)])
    head = ["metric", "engine", "predicted", "verified", "difference"]
    return Table("Predicted against verified", head, rows, numeric=2) if rows else None


def _laws_table(read: SearchView) -> Table | None:
    found = read.result.verification
    if found is None or not found.laws:
        return None
    rows = [
        [
            str(law.get("name", f"design {k + 1}")),
            str(law.get("n_states", "–")),
            percent(float(law.get("rmse_of_range", math.nan)), 3),
            percent(float(law.get("worst_of_range", math.nan)), 3),
        ]
        for k, law in enumerate(found.laws)
    ]
    head = ["module design", "FEM states", "RMSE, of the range of torque", "worst, of the range of torque"]
    note = f"Direct FEM took {seconds(found.fem_wall_s)}, the whole check {seconds(found.wall_s)}."
    return Table("What the search's laws miss of direct FEM", head, rows, note)


def _conditions_table(read: SearchView) -> Table | None:
    """Successes as counts; else the objective's metric, by condition and engine."""
    found, counts = read.result.verification, success_counts(read)
    if found is None or not found.conditions:
        return None
    engines = list(found.conditions)
    conditions = list(dict.fromkeys(c for one in found.conditions.values() for c in one))
    name = read.objective_metric
    if counts:
        rows: list[Cells] = [
            [
                c or "all trials",
                *(
                    "{} / {}".format(*counts[e][c or "all trials"]) if c in found.conditions[e] else "–"
                    for e in engines
                ),
            ]
            for c in conditions
        ]
        total = [[sum(pair[k] for pair in counts[e].values()) for k in (0, 1)] for e in engines]
        rows.append(["together", *(f"{good} / {n}" for good, n in total)])
        return Table("Stable grasps, verified", ["condition", *engines], rows)
    if len(conditions) < 2 or not any(name in m for one in found.conditions.values() for m in one.values()):
        return None
    rows = [
        [c, *(read.objective.text(found.conditions[e].get(c, {}).get(name, math.nan)) for e in engines)]
        for c in conditions
    ]
    return Table(f"Verified {read.objective.label} by condition", ["condition", *engines], rows)


def robust_table(read: SearchView) -> Table | None:
    """Both designs, without deviations and by the measure, and where they differ."""
    found, best = read.result.robustness, read.best
    if found is None:
        return None
    o = read.objective

    def text(stated: float) -> str:
        return number(stated * o.unit.factor, 4)

    rows: list[Cells] = [
        [f"{o.title}, nothing deviates", text(found.nominal_of_nominal), text(found.nominal_of_robust)],
        [f"{o.title}, {measure_words(found)}", text(found.robust_of_nominal), text(found.robust_of_robust)],
    ]
    for axis in read.axes:
        pair = [d.values.get(axis.name) if d is not None else None for d in (found.nominal, best)]
        if any(v is not None for v in pair):
            rows.append([axis.label, *map(axis.text, pair)])
    note = f"Varied: {'; '.join(found.sources)}." if found.sources else ""
    return Table("Nominal and robust design", ["", "nominal", "robust"], rows, note)


def cost_table(read: SearchView) -> Table:
    """What the search took."""
    r = read.result
    per = f", {seconds(r.wall_s / r.evaluations)} each" if r.evaluations else ""
    rows: list[Cells] = [
        ["optimizer", r.optimizer],
        ["seed", str(r.seed)],
        ["candidates", str(len(r.history))],
        ["evaluated", f"{r.evaluations}{per}"],
        ["simulations", str(r.simulations)],
        ["refused without simulation", str(sum(r.refused.values()))],
        ["failed", str(sum(r.failed.values()))],
        ["simulated, but break a constraint on metrics", str(int(read.broken.sum()))],
        ["searches", str(max(len(r.branches), 1))],
        ["wall time, all sessions", seconds(r.wall_s)],
        ["why it ended", stopped_words(r)],
    ]
    if r.verification is not None:
        rows.append(["check of the best design", seconds(r.verification.wall_s)])
    return Table("What it took", ["", ""], rows)


def cause_table(read: SearchView) -> Table | None:
    """Causes of refusal and failure, most frequent first."""
    listed = [("refused", read.result.refused), ("failed", read.result.failed)]
    rows = [
        [what, cause, str(n)]
        for what, causes in listed
        for cause, n in sorted(causes.items(), key=lambda item: -item[1])
    ][: 2 * MOST_METRICS]
    return (
        Table("Refused and failed, by cause", ["", "cause", "candidates"], rows, numeric=2) if rows else None
    )


def _range(axis: Axis) -> str:
    if axis.choices:
        return ", ".join(axis.choices)
    each = ", each in a search of its own" if axis.each else ""
    return f"{axis.tick(axis.low)} to {axis.tick(axis.high)} {axis.unit.symbol}".strip() + each
