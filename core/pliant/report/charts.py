"""Charts of a page: the chain's pose, a law with its states, a search as it went, what a diagnosis rests on."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from matplotlib.colors import Normalize, to_hex

from pliant.diagnosis.evidence_table import NOTHING
from pliant.diagnosis.verdict import named
from pliant.formatting import actuation_unit, deformation_unit, display_unit, effort_unit, unit_of
from pliant.records.design import Array
from pliant.records.fem import FemDataset, ModuleData
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, Panel
from pliant.report.evidence_view import Diagnosed, abscissa, clock, clock_words, input_of, thin
from pliant.report.figures import style
from pliant.report.figures.charts import level_line
from pliant.report.figures.diagnosis import AS_IT_IS, BAND, BAND_COLOUR, FIRST, MOST, OTHER, WITH, name_of
from pliant.report.figures.fem import Groups
from pliant.report.figures.finger import LEVELS, views
from pliant.report.figures.law import angle_range, curve_levels
from pliant.report.figures.search_course import MOST_PAIRS, moving_median, shown_range
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.run_view import band_of, history_levels, law_of, rest_markers
from pliant.report.search_view import SearchView


def pose_chart(run: FinishedRun) -> Chart:
    """A panel for each view of the chain."""
    unit = display_unit("m")
    levels = actuation_unit(run.designs[0].law.actuation_name)
    rest = rest_markers(run)
    panels = []
    for across, up in views(run):

        def line(points: Array, name: str, colour: str, width: float, dot: float, of: str = "") -> ChartLine:
            x, y = np.asarray(points)[:, [across, up]].T * unit.factor  # noqa: B023
            return ChartLine(name, x, y, of, colour, width, dot)

        lines = [] if rest is None else [line(rest, "at rest", "#9fa8b8", 2.4, 3.0)]
        for value, _, markers in history_levels(run.engines[0].result, LEVELS):
            lines.append(line(markers, "on the way", "#9cc3de", 1.1, 2.0, levels.text(value, 3)))
        for k, engine in enumerate(run.engines):
            lines.append(line(engine.markers_m, engine.kind, style.SERIES[k % 6], 2.6 if not k else 1.3, 6.0))
        axes = [ChartAxis("xyz"[k], unit.symbol) for k in (across, up)]
        title = f"{'xyz'[across]} and {'xyz'[up]} of the world"
        panels.append(Panel(axes[0], axes[1], tuple(lines), title=title, equal=True))
    return Chart(tuple(panels))


POINTS, DOT, OPEN = 121, 5.0, 4.0
CHECKED = style.SERIES[1]


def law_chart(run: FinishedRun, design: DesignResult) -> Chart:
    """A panel of the law's curves and its states, and one of law − state where there are states."""
    law, data = design.law, design.fem
    p_unit, u_unit, effort = actuation_unit(law.actuation_name), deformation_unit(law), effort_unit(law)
    x, y = _coordinate(law.joint, u_unit.symbol), ChartAxis("effort", effort.symbol)
    levels = curve_levels(run, design)
    u = np.linspace(*angle_range(run, design), POINTS)
    colours = _colours(levels)
    lines: list[ChartLine] = []
    bands: list[Band] = []
    for level, colour in zip(levels, colours, strict=True):
        at, name = np.full(len(u), level), p_unit.text(float(level), 3)
        tau = effort.factor * law_of(design, at, u)
        lines.append(ChartLine("law", u * u_unit.factor, tau, name, colour, 1.5))
        if (half := band_of(design, at, u)) is not None:
            half = effort.factor * half
            bands.append(Band("90 % band", u * u_unit.factor, tau - half, tau + half, name, f"{colour}38"))
    if data is not None:
        lines += _states(data, p_unit.text, colours_of(data, levels), u_unit.factor, effort.factor)
    panels = [Panel(x, y, tuple(lines), tuple(bands), "Joint law τ(p, u)", zero=style.SOFT)]
    if data is not None and len(data) and len(law.axes) == 1:
        panels.append(_missed(design, data, x, u_unit.factor))
    return Chart(tuple(panels))


def states_chart(data: ModuleData) -> Chart:
    """The free branch, then τ over u of every explored axis, one run per level of actuation."""
    main = data.axis(data.main_axis)
    p_unit, u_unit, effort = actuation_unit(data.actuation_name), deformation_unit(data), effort_unit(data)
    word = "tendon force" if data.actuation_name == "tendon_force_n" else "pressure"
    free = main.rows(main.branch == "free")
    order = np.argsort(free.actuation, kind="stable")
    p, u = free.actuation[order] * p_unit.factor, free.angle_rad[order] * u_unit.factor
    x = _coordinate(data.joint, u_unit.symbol)
    panels = [
        Panel(
            ChartAxis(word, p_unit.symbol),
            x,
            (ChartLine("free branch", p, u, colour=style.SERIES[0], dot=DOT),),
            title="Free branch",
            below="nothing holds the module",
        )
    ]
    for name in data.explored_axes():
        one = data.axis(name)
        lines = _states(one, p_unit.text, colours_of(one, one.actuation), u_unit.factor, effort.factor, 0.8)
        title = f"Held about {name}" if len(data.axes) > 1 else "Held"
        panels.append(
            Panel(x, ChartAxis("effort", effort.symbol), tuple(lines), title=title, zero=style.SOFT)
        )
    return Chart(tuple(panels))


def colours_of(data: FemDataset, levels: Array) -> dict[float, str]:
    """A colour for every actuation of the states, on the scale of these levels."""
    known = np.unique(data.actuation)
    return dict(zip(known.tolist(), _colours(known, levels), strict=True))


def _colours(values: Array, scale: Array | None = None) -> list[str]:
    of = values if scale is None else scale
    norm, shades = Normalize(float(np.min(of)), float(np.max(of)) or 1.0), style.pressure_map()
    return [to_hex(shades(float(norm(value)))) for value in values]


def _coordinate(joint: str, symbol: str) -> ChartAxis:
    return ChartAxis("extension" if joint == "prismatic" else "joint angle", symbol)


def _states(
    data: FemDataset,
    text: Callable[[float, int], str],
    colours: dict[float, str],
    u_factor: float,
    effort: float,
    width: float = 0.0,
) -> list[ChartLine]:
    """States of each actuation, those to fit and those left out apart; joined by a line where it has a width."""
    groups, lines = Groups.of(data), []
    kinds = (("states", groups.fit, width, DOT), ("states left out", groups.check, 0.0, OPEN))
    for level in np.unique(data.actuation):
        for name, rows, thick, dot in (*kinds, ("in self-contact", groups.untrusted, 0.0, OPEN)):
            mine = np.flatnonzero(rows & (data.actuation == level))
            mine = mine[np.argsort(data.angle_rad[mine], kind="stable")]
            if len(mine):
                at, tau = data.angle_rad[mine] * u_factor, data.moment_n_m[mine] * effort
                colour = style.WARN if name == "in self-contact" else colours[float(level)]
                lines.append(ChartLine(name, at, tau, text(float(level), 3), colour, thick, dot))
    return lines


def _missed(design: DesignResult, data: FemDataset, x: ChartAxis, u_factor: float) -> Panel:
    scale = design.fit.effort_range if design.fit else float(np.ptp(data.moment_n_m)) or 1.0
    missed = 100.0 * (law_of(design, data.actuation, data.angle_rad) - data.moment_n_m) / scale
    groups, at = Groups.of(data), data.angle_rad * u_factor
    lines = tuple(
        ChartLine(name, at[rows], missed[rows], colour=colour, width=0.0, dot=DOT)
        for name, rows, colour in (
            ("law − state", groups.fit, style.SERIES[0]),
            ("law − state left out", groups.check, CHECKED),
        )
        if rows.any()
    )
    return Panel(
        x, ChartAxis("law − state", "% of effort range"), lines, title="What it misses", zero=style.SOFT
    )


CANDIDATE = "#6f9dc2"
MOST_DRAWN = 8000  # candidates; of more every n-th, while the best so far has all of them


def history_chart(read: SearchView) -> Chart | None:
    """Candidates' objectives and the best so far, branch by branch; None where none has an objective."""
    scores = read.scores()
    finite = np.isfinite(scores)
    if not finite.any():
        return None
    better = np.fmax if read.objective.maximised else np.fmin
    branch, context = np.asarray(read.result.history.branch), np.asarray(read.result.history.context)
    names = read.branch_names()
    lines: list[ChartLine] = []
    stride = -(-len(scores) // MOST_DRAWN)
    winner = read.best_of_branches()[0][0] if read.best_of_branches() else -1
    for k in np.unique(branch).tolist():
        mine = np.flatnonzero(branch == k)
        x, run = np.arange(1.0, len(mine) + 1), names[k] if len(names) > 1 else ""
        lines.append(ChartLine("candidate", x[::stride], scores[mine][::stride], run, CANDIDATE, 0.0, 3.5))
        if not read.contextual:
            won = len(names) > 1 and k == winner
            look = (style.WARN, 2.4) if won else (style.SERIES[0], 1.8 if len(names) < 2 else 0.7)
            at, best = _steps(x, better.accumulate(scores[mine]))
            lines.append(ChartLine("best so far", at, best, run, *look))
            continue
        for which in np.unique(context[context >= 0]).tolist():
            rows = np.flatnonzero((context[mine] == which) & finite[mine])
            if len(rows):
                at, median = moving_median(x[rows], scores[mine][rows])
                shade = style.SERIES[which % 6]
                lines.append(ChartLine("moving median", at, median, read.condition(which), shade, 2.0))
    low, high = shown_range(scores, read.objective.maximised)
    pad = 0.06 * (high - low) or 0.05 * max(abs(high), 1e-12)
    y = ChartAxis(read.objective.unit.label, read.objective.unit.symbol)
    title = f"Objective of every candidate ({read.objective.best_word})"
    panel = Panel(ChartAxis("candidate"), y, tuple(lines), title=title, y_range=(low - pad, high + pad))
    return Chart((panel,))


def front_chart(read: SearchView) -> Chart | None:
    """A panel per pair of objectives; None for one objective."""
    pairs = list(itertools.combinations(range(len(read.objectives)), 2))[:MOST_PAIRS]
    if not pairs or not read.result.best:
        return None
    panels, stride = [], -(-len(read.scores()) // MOST_DRAWN)
    for pair in pairs:
        one, other = (read.objectives[k] for k in pair)
        points = np.array(
            [[d.objectives[o.name] * o.unit.factor for o in (one, other)] for d in read.result.best]
        )
        scores = [read.scores(k)[::stride] for k in pair]
        points = points[np.argsort(points[:, 0])]
        width = 1.2 if len(read.objectives) == 2 else 0.0
        lines = (
            ChartLine("candidate", scores[0], scores[1], "", CANDIDATE, 0.0, 3.5),
            ChartLine("front", points[:, 0], points[:, 1], "", style.WARN, width, 6.0),
        )
        axes = [ChartAxis(o.unit.label, o.unit.symbol) for o in (one, other)]
        below = "; ".join(f"{o.unit.label}: {o.best_word}" for o in (one, other))
        panels.append(Panel(axes[0], axes[1], lines, title="The front among all candidates", below=below))
    return Chart(tuple(panels))


def _steps(x: Array, y: Array) -> tuple[Array, Array]:
    """Corners of a staircase that keeps each value until it changes."""
    turns = np.flatnonzero(np.append(True, y[1:] != y[:-1]) | (np.arange(len(y)) == len(y) - 1))
    return np.repeat(x[turns], 2)[1:], np.repeat(y[turns], 2)[:-1]


def explained_chart(diagnosed: Diagnosed, output: str) -> Chart:
    """Per telling run a panel of the readings, one of the errors in a band of ± 2 floors, one of the loop."""
    driver = abscissa(diagnosed.before)
    words = unit_of(output)
    models = [("model as it is", AS_IT_IS, diagnosed.predicted(NOTHING))]
    for kinds, colour in zip(diagnosed.explanations, WITH, strict=False):
        models.append((f"model with {named(kinds)}", colour, diagnosed.predicted(kinds)))
    half = BAND * diagnosed.floor(output) * words.factor
    panels = []
    for name in diagnosed.telling_runs(MOST):
        index = next(k for k, one in enumerate(diagnosed.measurement.runs) if one.name == name)
        run = diagnosed.measurement.runs[index]
        pick = thin(len(run))
        time, measured = clock(run)[0][pick], words.factor * run.outputs[output][pick]
        lines: list[ChartLine] = []
        errors: list[ChartLine] = []
        over = None if driver is None else driver[1].factor * input_of(run, driver[0])[pick]
        for model, colour, predicted in models:
            values = words.factor * predicted[index][output][pick]
            lines.append(ChartLine(model, time, values, name, colour, 1.5))
            errors.append(ChartLine(model, time, measured - values, name, colour, 1.0))
        lines.append(
            ChartLine("measured", time, measured, name, style.INK, 0.9, 3.0 if len(pick) < 40 else 0.0)
        )
        x = ChartAxis(*clock_words(run))
        top = Panel(x, ChartAxis(words.label, words.symbol), tuple(lines), title=name, linked=name)
        bands: tuple[Band, ...] = ()
        if np.isfinite(half):
            ends, high = level_line(time, half)
            bands = (Band("± 2 noise floors", ends, -high, high, name, BAND_COLOUR),)
        below = replace(
            top,
            y=ChartAxis("error", words.symbol),
            lines=tuple(errors),
            bands=bands,
            title="",
            zero=style.SOFT,
        )
        panels += [top, below]
        if driver is not None and over is not None:
            loops = tuple(replace(line, x=over) for line in lines)
            x = ChartAxis(driver[1].label, driver[1].symbol)
            panels.append(replace(top, x=x, lines=loops, title="", linked=""))
    return Chart(tuple(panels), column=2 if driver is None else 3)


def hypotheses_chart(diagnosed: Diagnosed) -> Chart:
    """Bars of probability, and of the rms error on runs left out over the noise floor where it is known."""
    shown = diagnosed.hypotheses()
    names = tuple(name_of(kinds).replace("\n", " ") for kinds in shown)
    credible = set(diagnosed.found.judgement.credible)
    y, ends = ChartAxis("explanation", names=names), (-len(shown) + 0.4, 0.6)
    shares = [100 * diagnosed.found.judgement.probability.get(kinds, 0.0) for kinds in shown]
    errors = [diagnosed.left_out_error(kinds) for kinds in shown]

    def bars(values: list[float]) -> tuple[ChartLine, ...]:
        return tuple(
            ChartLine(
                name,
                np.array([0.0, v]),
                np.full(2, -float(k)),
                "",
                FIRST if kinds in credible else OTHER,
                7.0,
            )
            for k, (name, kinds, v) in enumerate(zip(names, shown, values, strict=True))
            if np.isfinite(v)
        )

    panels = [Panel(ChartAxis("probability", "%"), y, bars(shares), title="How probable", y_range=ends)]
    if np.isfinite(errors).any():
        floor = ChartLine("noise floor", np.ones(2), np.array(ends), "", style.WARN, 1.2)
        x = ChartAxis("rms error on runs left out of the fit, in noise floors")
        panels.append(Panel(x, y, (*bars(errors), floor), title="How much error it leaves", y_range=ends))
    return Chart(tuple(panels))
