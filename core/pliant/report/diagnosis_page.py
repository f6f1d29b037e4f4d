"""The tables and charts of a diagnosis: hypotheses, what they change, what the error depends on, repeats, noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis, circumstance
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.verdict import named
from pliant.evidence.covariates import Covariate
from pliant.evidence.measured_model import RunReadings
from pliant.formatting import NamedUnit, number, output_unit, whole_percent
from pliant.interfaces.effect import EffectNotes
from pliant.measurements.repeats import RepeatGroup, aligned, repeat_groups
from pliant.records.design import Array
from pliant.report.chart import (
    Band,
    Chart,
    ChartAxis,
    ChartBars,
    ChartLine,
    ChartNote,
    ChartRule,
    Mark,
    Panel,
    level_line,
    one_height,
    optional_chart,
    strokes,
)
from pliant.report.chart_colours import FAINT, INK, SERIES, SOFT, WARN
from pliant.report.document import Column, Table, as_json, optional_table, page_table
from pliant.report.evidence_view import (
    Compared,
    Diagnosed,
    abscissa,
    clock,
    clock_words,
    fitting,
    input_values,
    thin,
)
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


def hypotheses_json(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return every hypothesis, the most probable first."""
    columns, keys = hypothesis_columns(diagnosis), ("mean_square", "heldout_square", "unseen_square")
    made = []
    for kinds in diagnosis.judgement.probability:
        row = diagnosis.table.rows.get(kinds)
        fitted = {key: getattr(row, key) for key in (*keys, "n_parameters", "at_limit")} if row else {}
        forms = list(diagnosis.fits[kinds].candidate.forms) if kinds in diagnosis.fits else []
        made.append({**as_json(columns, kinds), **fitted, "forms": forms})
    return made


def hypotheses_table(diagnosis: Diagnosis, shown_kinds: Sequence[Kinds]) -> Table:
    """Return the hypotheses of the bar chart, with parameters and the error of each output."""
    rest = len(diagnosis.judgement.probability) - len(shown_kinds)
    note = (
        "Errors are rms on runs left out of the fit. ±: one standard deviation, coloured noise counted. Implausible: "
        "outside the range that would not surprise an expert; take such a number for a correction, not a property."
    )
    more = f" {rest} more hypotheses are in the JSON." if rest else ""
    return page_table("Hypotheses", hypothesis_columns(diagnosis), shown_kinds, note + more, 2)


def hypothesis_columns(diagnosis: Diagnosis) -> tuple[Column[Kinds], ...]:
    """Return the columns of any hypothesis, including an effect outside the list."""
    left = {kinds: diagnosis.left_out_errors(kinds) for kinds in diagnosis.fits}

    def heldout(kinds: Kinds) -> dict[str, Any]:
        return {name: {"rmse": rmse, "unit": si_unit(name)} for name, rmse in left.get(kinds, {}).items()}

    def ratio(kinds: Kinds, brief: bool = False) -> str:
        if kinds == UNKNOWN:
            return "any form" if brief else number(np.nan)
        value = diagnosis.left_out_ratio(kinds)
        return number(value, 3) if not brief else f"{value:.2f}" if np.isfinite(value) else "–"

    def error_column(name: str) -> Column[Kinds]:
        unit = output_unit(name)
        text = lambda kinds: "–" if kinds == UNKNOWN else unit.text(left[kinds][name], 3)  # noqa: E731
        return Column(list, "", unit.label, text=text)

    return (
        Column(list, "kinds", "hypothesis", "hypothesis", named),
        Column(
            lambda kinds: parameters_json(diagnosis.estimates.get(kinds)),
            "parameters",
            "parameters",
            text=lambda kinds: "; ".join(parameter_texts(diagnosis, kinds)) or "–",
        ),
        Column(
            lambda kinds: diagnosis.judgement.probability.get(kinds, 0.0),
            "probability",
            "probability",
            "probability",
            show=probability_text,
        ),
        Column(
            diagnosis.left_out_ratio,
            "rmse_over_floor",
            "in noise floors",
            "left-out error / floor",
            ratio,
            lambda kinds: ratio(kinds, True),
        ),
        Column(heldout, "heldout"),
        *map(error_column, diagnosis.readings.outputs[:OUTPUTS]),
    )


def parameter_texts(diagnosis: Diagnosis, kinds: Kinds) -> list[str]:
    """Return each parameter of a hypothesis: ``share 0.213 ± 0.004``; implausible values are marked."""
    if kinds not in diagnosis.estimates:
        return []
    return [
        f"{f'{e.kind} ' if len(kinds) > 1 else ''}{parameter_word(e.parameter.name, e.parameter.unit)} "
        f"{estimate_text(e)}"
        for e in diagnosis.estimates[kinds].estimates
    ]


def not_excited_table(diagnosis: Diagnosis) -> Table | None:
    """Return the effects that these runs cannot judge, and the run that would excite each."""
    rows = [[kind, run or "none that this bench can do"] for kind, run in diagnosis.not_excited.items()]
    note = "Even as strong as an expert considers plausible, they change these readings by less than 0.3 noise floors."
    return optional_table("Not shown by these runs", ["effect", "the run that would show it"], rows, note, 2)


def look_alikes_table(diagnosis: Diagnosis, notes: Notes) -> Table | None:
    """Return for each effect its confounders, and the test that distinguishes the leading ones."""

    def distinguishing_test(a: str, b: str) -> str:
        """Return what either plugin states about the pair; empty if neither names the other."""
        for note, other in ((notes.get(a), b), (notes.get(b), a)):
            if note is not None and note.confounder == other:
                return f"{b}: {note.distinguishing_test}" if note.distinguishing_test else ""
        return ""

    twins: dict[str, list[tuple[str, float]]] = {}
    for pair in diagnosis.indistinguishable:
        twins.setdefault(pair.a, []).append((pair.b, pair.unexplained_share))
    rows = []
    for a in sorted(twins, key=lambda kind: twins[kind][0][1]):
        imitators = [f"{b} ({whole_percent(share)})" for b, share in twins[a][:MOST_TWINS]]
        more = len(twins[a]) - len(imitators)
        cell = ", ".join(imitators) + (f" and {more} more" if more else "")
        rows.append([a, cell, next((text for b, _ in twins[a] if (text := distinguishing_test(a, b))), "")])
    note = (
        "In brackets: the share of the effect's change, at a strength of 2 noise floors, that the other cannot "
        "imitate; the noise hides it."
    )
    head = ["effect", "can be imitated by", "what distinguishes them"]
    return optional_table("Look-alikes under these runs", head, rows, note, 3)


def classes_table(diagnosis: Diagnosis) -> Table | None:
    """Return the effects that these runs do not distinguish, and the run that does."""
    rows = []
    for one in diagnosis.classes:
        parts = "; ".join(", ".join(part) for part in one.parts) if one.run else ""
        run = f"{one.run} ({one.minutes:g} min): {one.words}" if one.run else "–"
        rows.append([", ".join(one.kinds), run, parts])
    note = (
        "From the inputs, the noise and the model alone, at a strength of 2 noise floors: the readings have no part in "
        "it. A run is sought where an effect of the class is among the explanations that are left."
    )
    head = ["not distinguished", "run that would split them", "into"]
    return optional_table("Classes under these runs", head, rows, note, 3)


def detectable_table(diagnosis: Diagnosis) -> Table | None:
    """Return the smallest detectable strength of each effect."""
    rows = []
    for one in diagnosis.detectable:
        if one.kind in diagnosis.not_excited:
            continue
        asked = diagnosis.excitations[one.kind].strength.declared
        none, low, high = (strength_text(v, one.unit) for v in (asked.neutral, *asked.plausible))
        reach = max(abs(end - asked.neutral) for end in asked.plausible)
        flag = " (beyond plausible)" if abs(one.value - asked.neutral) > reach else ""
        word, value = parameter_word(one.parameter, one.unit), strength_text(one.value, one.unit)
        rows.append([one.kind, word, none, f"{value}{flag}", f"{low} to {high}"])
    head = ["effect", "parameter", "no effect at", "found from about", "plausible range"]
    note = "Weaker effects may be there and would not have been noticed: this is what “nothing missing” leaves open."
    return optional_table("Smallest strengths that these runs would show", head, rows, note, 2)


def noise_table(diagnosis: Diagnosis) -> Table:
    """Return floors by output, from the residuals of the best hypothesis."""
    rows = []
    for name, floor in diagnosis.noise.floors.items():
        words = output_unit(name)
        between = "no repeats" if floor.between is None else words.text(floor.between, 3)
        sigma = "not stated" if floor.sigma is None else words.text(floor.sigma, 3)
        value, within = words.text(floor.value, 3), words.text(floor.within, 3)
        rows.append([words.label, value, floor.source, within, between, sigma])
    head = ["output", "noise floor", "taken from", "within a run", "between repeats", "stated sigma"]
    return Table("Noise floors", head, rows, "", 3)


def dependence_table(diagnosed: Diagnosed) -> Table | None:
    """Return the quantities on which the remaining error depends."""
    found = diagnosed.found
    rows = [[circumstance(found, n), whole_percent(v)] for n, v in found.depends_on.items() if v >= 0.02]
    left = "model as it is" if found.explained == NOTHING else f"model with {named(found.explained)}"
    note = "Share of its variance that the circumstance alone predicts, without physics, on runs left out."
    head = ["circumstance", "share explained"]
    return optional_table(f"What the error of the {left} depends on", head, rows[:6], note, 1)


FIRST, OTHER = SERIES[0], "#9fb3c8"


def hypotheses_chart(diagnosed: Diagnosed) -> Chart:
    """Return bars of probability, and the rms error on held-out runs over the noise floor where it is known."""
    shown = diagnosed.hypotheses()
    y = ChartAxis("explanation", names=tuple(wrapped_name(kinds) for kinds in shown))
    credible = set(diagnosed.found.judgement.credible)
    colours = [FIRST if kinds in credible else OTHER for kinds in shown]
    shares = [diagnosed.found.judgement.probability.get(kinds, 0.0) for kinds in shown]
    errors = [diagnosed.left_out_error(kinds) for kinds in shown]
    marks: list[Mark] = []
    for row, (share, colour) in enumerate(zip(shares, colours, strict=True)):
        at, text = np.array([float(row)]), probability_text(share) if 100 * share >= 0.05 else "0 %"
        marks.append(ChartBars("", at, np.zeros(1), np.array([100 * share]), colour=colour))
        marks.append(ChartNote(text, 100 * share, row))
    title = "How probable, given these data"
    panels = [Panel(ChartAxis("probability", "%", ends=(0.0, 118.0)), y, tuple(marks), title)]
    if np.isfinite(errors).any():
        panels.append(_error_panel(y, shown, errors, colours))
    return Chart(tuple(panels), across=2, cell=(750, 66 * len(shown) + 190), legend=())


def _error_panel(y: ChartAxis, shown: list[Kinds], errors: list[float], colours: list[str]) -> Panel:
    marks: list[Mark] = [ChartRule(1.0, WARN, 1.6, upright=True, text="noise floor")]
    for row, (kinds, error, colour) in enumerate(zip(shown, errors, colours, strict=True)):
        at = np.full(2, float(row))
        if np.isfinite(error):
            marks.append(ChartLine("", np.array([0.0, error]), at, "", FAINT, 1.2))
            marks.append(ChartLine("", np.array([error]), at[:1], "", colour, 0.0, 8.0))
            marks.append(ChartNote(f"  {error:.2f}", error, row))
        else:
            text = "any form: reaches the floor" if kinds == UNKNOWN else "not known"
            marks.append(ChartNote(text, 1.0, row, colour=SOFT))
    ends = (0.0, 1.2 * max(float(np.nanmax(errors)), 1.6))
    x = ChartAxis("rms error on runs left out of the fit, in noise floors", ends=ends)
    return Panel(x, y, tuple(marks), "How much error it leaves")


def wrapped_name(kinds: Kinds) -> str:
    """Return a hypothesis in words."""
    return "nothing missing (model as it is)" if kinds == NOTHING else named(kinds)


MOST = 3  # panels in a row
BAND = 2.0  # in units of the floor
BAND_COLOUR = "#e8ecf2"
AS_IT_IS = WARN
WITH = (SERIES[0], SERIES[2])
ZERO = ChartRule(0.0, SOFT, 0.8)
Model = tuple[str, str, tuple[RunReadings, ...]]  # name, colour and readings by run


def explained_chart(diagnosed: Diagnosed, output: str) -> Chart:
    """Return per shown run a panel of the readings, one of the errors with a band of ± 2 floors, one of the loop."""
    driver = abscissa(diagnosed.before)
    models: list[Model] = [("model as it is", AS_IT_IS, diagnosed.predicted(NOTHING))]
    for kinds, colour in zip(diagnosed.explanations, WITH, strict=False):
        models.append((f"model with {named(kinds)}", colour, diagnosed.predicted(kinds)))
    names, column = diagnosed.telling_runs(MOST), 2 if driver is None else 3
    panels = [panel for name in names for panel in _run_panels(diagnosed, name, output, models, driver)]
    legend = ("measured", *(name for name, *_ in models))
    layout = {"column": column, "heights": (2.2, 1.4, 2.4)[:column], "cell": (520, 330 * column)}
    return Chart(one_height(panels, every=column), legend=legend, **layout)  # type: ignore[arg-type]


def _run_panels(
    diagnosed: Diagnosed, name: str, output: str, models: list[Model], driver: tuple[str, NamedUnit] | None
) -> list[Panel]:
    index = next(k for k, one in enumerate(diagnosed.measurement.runs) if one.name == name)
    run, words = diagnosed.measurement.runs[index], output_unit(output)
    pick = thin(len(run))
    time, measured = clock(run)[0][pick], words.factor * run.outputs[output][pick]
    dot = 3.0 if len(pick) < 40 else 0.0
    predicted = [(model, colour, words.factor * of[index][output][pick]) for model, colour, of in models]

    def readings(x: Array) -> tuple[Mark, ...]:
        lines = [
            ChartLine(model, x, values, name, colour, 1.5, dashed=order == 0 and len(models) > 1)
            for order, (model, colour, values) in enumerate(predicted)
        ]
        return (*lines, ChartLine("measured", x, measured, name, INK, 0.9, dot))

    errors: list[Mark] = [ZERO]
    errors += [ChartLine(model, time, measured - v, name, colour, 1.0, dot) for model, colour, v in predicted]
    half = BAND * diagnosed.floor(output) * words.factor
    if np.isfinite(half):
        ends, high = level_line(time, half)
        errors.insert(0, Band("± 2 noise floors", ends, -high, high, name, BAND_COLOUR))
    x, y = ChartAxis(*clock_words(run)), ChartAxis(words.label, words.symbol)
    title, below = _title(diagnosed, index, name), fitting(diagnosed.before.words(name), 52)
    panels = [
        Panel(x, y, readings(time), title, below, linked=name),
        Panel(x, ChartAxis("error", words.symbol), tuple(errors), linked=name),
    ]
    if driver is not None:
        over = driver[1].factor * input_values(run, driver[0])[pick]
        panels.append(Panel(ChartAxis(driver[1].label, driver[1].symbol), y, readings(over)))
    return panels


def _title(diagnosed: Diagnosed, index: int, name: str) -> str:
    """Return a run's name with its error in noise floors without and with the explanation."""
    if not diagnosed.explanations:
        return diagnosed.before.title(name)
    before, after = (_ratio(diagnosed, index, kinds) for kinds in (NOTHING, diagnosed.explanations[0]))
    known = np.isfinite(before)
    return f"{name}: {before:.1f} → {after:.1f} × noise" if known else diagnosed.before.title(name)


def _ratio(diagnosed: Diagnosed, index: int, kinds: Kinds) -> float:
    """Return the root mean square error of a run in noise floors, over all outputs."""
    mine = diagnosed.found.readings.run == index
    square = np.mean(diagnosed.found.fits[kinds].residual[mine] ** 2) if mine.any() else np.nan
    return diagnosed.found.table.over_floor(float(square))


def dependence_chart(diagnosed: Diagnosed, output: str) -> Chart | None:
    """Return a panel for each covariate that explains most of the error, before and after; None where none varies."""
    explained = diagnosed.before.comparison.depends_on
    items = [item for item in diagnosed.before.covariates.items if item.name in explained]
    items = sorted(items, key=lambda item: -explained[item.name])[:MOST]
    models = [(diagnosed.before, AS_IT_IS, "model as it is")]
    if diagnosed.after is not None:
        models.append((diagnosed.after, WITH[0], f"with {' + '.join(diagnosed.explanations[0])}"))
    panels = [_dependence_panel(models, item, output) for item in items]
    legend = tuple(name for _, _, name in models)
    return optional_chart(one_height(panels), cell=(560, 520), legend=legend)


def _dependence_panel(models: list[tuple[Compared, str, str]], item: Covariate, output: str) -> Panel:
    words, x = output_unit(output), ChartAxis(item.shown.label, item.shown.symbol)
    marks: list[Mark] = [ZERO]
    for compared, colour, name in models:
        places = [p for p in compared.comparison.places if p.covariate == item.name and output in p.outputs]
        if item.numeric:
            at = np.array([p.centre for p in places], float) * item.shown.factor
        else:
            at = np.arange(len(places), dtype=float)
            x = ChartAxis(item.shown.label, names=tuple(fitting(p.condition, 16) for p in places))
        entries = [p.outputs[output] for p, place in zip(places, at, strict=True) if np.isfinite(place)]
        at, factor = at[np.isfinite(at)], words.factor
        mean = np.array([entry.mean for entry in entries]) * factor
        half = np.array([np.ptp(entry.interval) / 2 for entry in entries]) * factor
        real = np.array([entry.significant for entry in entries], bool)
        marks += [
            ChartLine(name, at, mean, "", colour, 1.2 if item.numeric else 0.0, 6.0, hollow=True),
            ChartLine(name, *strokes(at, mean - half, mean + half), "", colour, 1.2),
            ChartLine(name, at[real], mean[real], "", colour, 0.0, 6.0),
        ]
    shares = [whole_percent(one.comparison.depends_on.get(item.name, 0.0)) for one, *_ in models]
    below = f"explains {' → '.join(shares)} of the error's variance"
    return Panel(x, ChartAxis("mean error", words.symbol), tuple(marks), fitting(item.shown.label, 34), below)


def repeats_chart(diagnosed: Diagnosed, output: str) -> Chart | None:
    """Return the groups that scatter most, over ± 2 times the noise within a run; None without repeats."""
    found = []
    for group in repeat_groups(diagnosed.measurement):
        runs = [diagnosed.measurement.runs[k] for k in group.runs]
        values = aligned(runs, [run.outputs[output] for run in runs]).values
        if min(values.shape) >= 2:
            found.append((group, np.asarray(values - values.mean(axis=0), float)))
    found = sorted(found, key=lambda item: -float(np.nanmean(item[1] ** 2)))[:MOST]
    panels = [_repeats_panel(diagnosed, group, values, output) for group, values in found]
    return optional_chart(one_height(panels), cell=(560, 460), legend=None if len(found) == 1 else ())


def _repeats_panel(diagnosed: Diagnosed, group: RepeatGroup, values: Array, output: str) -> Panel:
    """Return (runs, t) readings minus their mean."""
    runs, words = [diagnosed.measurement.runs[k] for k in group.runs], output_unit(output)
    time, x = clock(runs[0])[0], ChartAxis(*clock_words(runs[0]))
    if len(time) != values.shape[1]:
        time, x = np.arange(1.0, values.shape[1] + 1), ChartAxis("reading in common")
    pick = thin(len(time))
    marks: list[Mark] = [ZERO]
    for k, (run, row) in enumerate(zip(runs, values, strict=False)):
        marks.append(ChartLine(run.name, time[pick], words.factor * row[pick], run.name, SERIES[k % 6]))
    band = BAND * diagnosed.found.noise.floors[output].within * words.factor
    if np.isfinite(band):
        ends, high = level_line(time, band)
        marks.insert(0, Band("± 2 times the noise", ends, -high, high, "", BAND_COLOUR))
    many = ", ".join(run.name for run in runs[:5]) + (" …" if len(runs) > 5 else "")
    y = ChartAxis("less their mean", words.symbol)
    return Panel(x, y, tuple(marks), f"{many}: the same inputs")
