"""A dry run: the next protocol, its limits and the motion that is expected of it; nothing moves."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from pliant import api
from pliant.execution.executors import Workers
from pliant.formatting import output_unit
from pliant.records.design import Array
from pliant.records.history import History
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, ChartRule, Mark, Panel
from pliant.report.chart_colours import INK, SERIES, WARN
from pliant.report.document import Document, Drawn, Table, drawn, picture, section
from pliant_bench.bench import BenchChannel, BenchProtocol
from pliant_bench.choose import Choice
from pliant_bench.limits import check_protocol
from pliant_bench.loop.expectation import expect, expect_without_data
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.person import words
from pliant_bench.loop.planner import TellingPlanner
from pliant_bench.loop.rounds import situation
from pliant_bench.plans import history_from_columns
from pliant_bench.watchdog import Expectation

# Changes of a slope below this share of an input's range are no corners.
FLAT = 1e-3


def dry_run_document(
    opened: api.OpenStudy,
    folder: ExperimentFolder,
    planner: TellingPlanner,
    inputs: Sequence[str],
    kinds: Sequence[str],
    assumed: Sequence[str],
    workers: Workers,
) -> Document:
    """Return the next run of an experiment with its expected motion, after the runs that are on disk.

    `assumed` says which orientation and gravity the motion is expected for.

    Raises:
        UserError: the run exceeds a limit of the bench.
    """
    choice, expected = _next(opened, folder, planner, inputs, kinds, workers)
    protocol = choice.protocol
    if protocol is None:
        return Document(
            kind="Pliant: a dry run", title=choice.why, sentence="Nothing is left to run.", data={}
        )
    channels = planner.bench.limited_inputs
    check_protocol(protocol, channels)
    corners = corner_table(protocol)
    asked = [words(name, value) for name, value in protocol.conditions.items()]
    return Document(
        kind=f"Pliant: a dry run · {opened.study.name}",
        title=protocol.words,
        sentence=f"{choice.why} {protocol.duration_s:.3g} s, {len(protocol)} samples; nothing was moved.",
        data={
            "words": protocol.words,
            "why": choice.why,
            "duration_s": protocol.duration_s,
            "samples": len(protocol),
            "conditions": dict(protocol.conditions),
            "corners": [dict(zip(corners.head, row, strict=True)) for row in corners.rows],
            "expected": {
                name: {"low": float(np.nanmin(v)), "high": float(np.nanmax(v))}
                for name, v in expected.mean.items()
                if np.isfinite(v).any()
            },
        },
        brief=(*assumed, corners, *([f"conditions: {', '.join(asked)}"] if asked else [])),
        draw=partial(_drawn, protocol, channels, expected, corners, assumed),
        footer="The limits of the study and of the driver are checked again before every sample",
    )


def _next(
    opened: api.OpenStudy,
    folder: ExperimentFolder,
    planner: TellingPlanner,
    inputs: Sequence[str],
    kinds: Sequence[str],
    workers: Workers,
) -> tuple[Choice, Expectation]:
    rounds = [one for one in folder.rounds() if one.is_recorded]
    outputs = tuple(channel.name for channel in planner.bench.outputs)

    def history(protocol: BenchProtocol | None) -> History:
        assert protocol is not None
        columns = {**protocol.conditions, **protocol.commands}
        return history_from_columns(protocol.name, protocol.time_s, columns, inputs)

    if len(rounds) < planner.settings.first_repeats:
        first = planner.repeat(len(rounds) + 1)
        return first, expect_without_data(opened, outputs, history(first.protocol))
    data = api.read_measurement(opened, folder.recordings())
    diagnosis = api.diagnose(opened, data, kinds=kinds, workers=workers)
    choice = planner.next(situation(rounds, planner.settings, data, diagnosis, np.inf))
    if choice.protocol is None:
        return choice, Expectation({}, {})
    return choice, expect(opened, data, diagnosis, history(choice.protocol))


def corner_table(protocol: BenchProtocol) -> Table:
    """Return the instants at which an input changes its rate, with the inputs there."""
    kept = {0, len(protocol) - 1}
    for values in protocol.commands.values():
        rate = np.diff(values) / np.diff(protocol.time_s)
        largest = float(np.abs(rate).max(initial=0.0))
        if largest > 0.0:
            kept |= set((np.flatnonzero(np.abs(np.diff(rate)) > FLAT * largest) + 1).tolist())
    if len(kept) > 60:
        kept = set(np.unique(np.linspace(0, len(protocol) - 1, 40).round().astype(int)).tolist())
    head = ["time", *(output_unit(name).axis for name in protocol.commands)]
    rows = [
        [
            f"{protocol.time_s[k]:.4g} s",
            *(output_unit(name).text(v[k]) for name, v in protocol.commands.items()),
        ]
        for k in sorted(kept)
    ]
    return Table("", head, rows)


def _drawn(
    protocol: BenchProtocol,
    channels: Sequence[BenchChannel],
    expected: Expectation,
    corners: Table,
    assumed: Sequence[str],
) -> Drawn:
    return drawn(
        picture(
            "dry_run",
            "Commands with their limits, and the expected readings ± 2 sd.",
            chart(protocol, channels, expected),
        ),
        section("The protocol", corners, text=assumed, open=True),
    )


def chart(protocol: BenchProtocol, channels: Sequence[BenchChannel], expected: Expectation) -> Chart:
    """Return the commands with the limits of their inputs, and the expected readings, over time."""
    limits = {channel.name: channel.limits for channel in channels}
    panels = [
        _panel(name, protocol.time_s, values, None, (limits[name].low, limits[name].high))
        for name, values in protocol.commands.items()
    ]
    panels += [_panel(name, protocol.time_s, v, expected.sd[name], ()) for name, v in expected.mean.items()]
    return Chart(tuple(panels), across=2, cell=(700, 360))


def _panel(name: str, clock: Array, values: Array, sd: Array | None, limits: Sequence[float]) -> Panel:
    unit = output_unit(name)
    marks: list[Mark] = [ChartRule(unit.factor * v, WARN, 1.0, True) for v in limits if np.isfinite(v)]
    if sd is not None:
        low, high = unit.factor * (values - 2.0 * sd), unit.factor * (values + 2.0 * sd)
        marks.append(Band("expected ± 2 sd", clock, low, high))
    colour = INK if sd is None else SERIES[0]
    marks.append(
        ChartLine("commanded" if sd is None else "expected", clock, unit.factor * values, "", colour, 1.6)
    )
    return Panel(ChartAxis("time", "s"), ChartAxis(unit.label, unit.symbol), tuple(marks))
