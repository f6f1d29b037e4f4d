"""The tables of the report page: engines against each other, the law's errors, times, inputs, provenance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pliant.formatting import Unit, effort_unit, fixed, number, percent, seconds, small_length, unit_of_field
from pliant.records.law import FitReport
from pliant.report.document import Cells, Table
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.reading import Ran, distances_m, ran, study_form


def engine_table(run: FinishedRun) -> Table | None:
    """Settled tips, distances to the first engine, residuals."""
    engines = ran(run)
    if not engines:
        return None
    rows = [
        [
            engine.kind,
            *(fixed(1e3 * x, 4) for x in engine.result.final.tip_m),
            "–" if index == 0 else small_length(float(distance[-1])),
            "–" if index == 0 else small_length(float(distance.max())),
            _residual(engine, run),
            number(engine.result.final.converged),
            {True: "yes", False: "no", None: "not asked"}[engine.result.final.stable],
            str(engine.result.final.iterations),
        ]
        for index, (engine, distance) in enumerate(zip(engines, distances_m(engines), strict=True))
    ]
    first = engines[0].kind
    head = [
        "engine",
        "tip x (mm)",
        "tip y (mm)",
        "tip z (mm)",
        f"tip to {first}",
        f"farthest marker to {first}",
    ]
    head += ["residual", "converged", "stable", "iterations"]
    note = "Residual: largest unbalanced joint effort, measured by one common statics for all engines."
    return Table("Settled chain, engine by engine", head, rows, note)


def metrics_table(run: FinishedRun) -> Table | None:
    """The task's metrics, one column per engine."""
    engines = ran(run)
    names = list(dict.fromkeys(name for e in engines for name in e.result.metrics if name != "note"))
    if not names:
        return None
    rows = []
    for name in names:
        label, unit = unit_of_field(name)
        values = [_metric(e.result.metrics.get(name), unit) for e in engines]
        rows.append([_words(label) + (f" ({unit.symbol})" if unit.symbol else ""), *values])
    return Table("What the task measures", ["metric", *(e.kind for e in engines)], rows)


def law_table(run: FinishedRun) -> Table | None:
    """Errors of each law on states left out, with the study's form beside it."""
    rows: list[Cells] = []
    for design in run.designs:
        if design.fit is None:
            continue
        prefix = f"{design.name}: " if len(run.designs) > 1 else ""
        rows.append([f"{prefix}{_form(design.fit)}", *_scores(vars(design.fit), design)])
        form = study_form(design)
        if form is not None and design.fit.details.get("form") != "study":
            rows.append([f"{prefix}the study's form", *_scores(form, design)])
    if not rows:
        return None
    effort = effort_unit(run.designs[0].law).symbol
    head = ["law", "states left out", f"RMSE ({effort})", f"worst ({effort})", "worst, of effort range", "R²"]
    fits = [d.fit for d in run.designs if d.fit is not None]
    note = f"States left out: {fits[0].details['held_out']}." if "held_out" in fits[0].details else ""
    return Table("Errors of the joint law on states it has not seen", head, rows, note)


def time_tables(run: FinishedRun) -> list[Table]:
    """Wall time of each stage when it was computed, and of settling in each engine."""
    tables = []
    if run.provenance:
        rows = [[_stage_name(m), seconds(float(m["wall_s"]))] for m in run.provenance]
        note = "Times of the computation itself; a stage found in the store costs milliseconds."
        tables.append(Table("Stages", ["stage", "wall time"], rows, note))
    engines = ran(run)
    if engines:
        base = engines[0].result.final.wall_s
        rows = [
            [e.kind, seconds(e.result.final.wall_s), _ratio(e.result.final.wall_s, base)] for e in engines
        ]
        head = ["engine", "wall time", f"ratio to {engines[0].kind}"]
        tables.append(Table("Settling the chain, all levels of the history", head, rows))
    return tables


def input_table(run: FinishedRun) -> Table:
    """The study with all defaults, in readable units, one row per block."""
    rows: list[Cells] = []
    for key, value in run.study.items():
        blocks = value if isinstance(value, list) else [value]
        for block in blocks:
            texts = [f"{name} {text}".strip() for name, text in _inputs(block)]
            if key != "pliant" and texts:
                rows.append([_words(key), " · ".join(texts)])
    return Table("Inputs", ["block", "values, defaults included"], rows, numeric=9)


def provenance_table(run: FinishedRun) -> Table:
    """Where every artifact came from."""
    rows = []
    for m in run.provenance:
        libraries = {**m.get("libraries", {}), **m.get("versions", {})}
        rows.append(
            [
                _stage_name(m),
                str(m.get("key", ""))[:12],
                str(m.get("created", "")).replace("T", " ").replace("+00:00", " UTC"),
                seconds(float(m["wall_s"])),
                str(m.get("code", ""))[:12],
                f"pliant {m.get('pliant', '?')}, Python {m.get('python', '?')}, "
                + ", ".join(f"{name} {version}" for name, version in libraries.items()),
                str(m.get("platform", "")),
            ]
        )
    head = ["stage", "key", "computed", "wall time", "code", "versions", "platform"]
    note = "Key: hash of config, inputs, code and library versions. Code: fingerprint of the sources it depends on."
    return Table("Provenance", head, rows, note, numeric=9)


def coefficients(design: DesignResult) -> str:
    """The parameters of a stated law, as one line; empty for a fitted one."""
    record = design.law.record()
    shown = {**record.values, **{k: v.tolist() for k, v in record.arrays.items()}}
    return "; ".join(f"{key} = {_plain(value)}" for key, value in shown.items())


def _scores(scores: Mapping[str, Any], design: DesignResult) -> list[str]:
    effort = effort_unit(design.law).factor
    held_out = str(design.fit.n_heldout) if design.fit else "–"
    return [
        held_out,
        number(scores["rmse"] * effort, 3),
        number(scores["worst"] * effort, 3),
        percent(scores["worst_of_range"]),
        "–" if scores["r2"] != scores["r2"] else f"{scores['r2']:.7f}",
    ]


def _form(fit: FitReport) -> str:
    form = fit.details.get("form", "law")
    degree = fit.details.get("degree")
    terms = fit.details.get("terms")
    extra = f", degree {degree}" if degree is not None else ""
    return (
        f"{form}{extra}"
        + (f", {terms} terms" if terms is not None else "")
        + f", {fit.n_fitted} states fitted"
    )


def _residual(engine: Ran, run: FinishedRun) -> str:
    return effort_unit(run.designs[0].law).text(engine.result.final.residual, 2)


def _metric(value: Any, unit: Unit) -> str:
    if isinstance(value, list | tuple):
        return _listed(value, unit)
    if isinstance(value, Mapping):
        if any(isinstance(item, list | tuple) for item in value.values()):
            return "in run.json"
        return ", ".join(f"{key} {_metric(item, unit)}" for key, item in value.items())
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, int | float):
        return "–" if value is None else str(value)
    return number(value * unit.factor if unit.symbol else value, 6)


def _listed(values: Sequence[Any], unit: Unit) -> str:
    """A short list of numbers; points stand in pictures and in run.json."""
    if any(isinstance(value, list | tuple) for value in values):
        return f"{len(values)} entries, in run.json"
    return ", ".join(_metric(value, unit) for value in values)


def _ratio(wall_s: float, base: float) -> str:
    return f"{number(wall_s / base, 3)} ×" if base > 0 else "–"


def _stage_name(manifest: Mapping[str, Any]) -> str:
    physics = (manifest.get("config") or {}).get("physics") or {}
    kind = f" ({physics['kind']})" if "kind" in physics else ""
    return f"{manifest.get('stage', '?')}{kind}"


def _inputs(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Names and texts of a block's values; what is not set is left out."""
    if value is None or value == [] or value == {}:
        return
    if isinstance(value, Mapping) and key != "coefficients":
        for inner, item in value.items():
            yield from _inputs(item, f"{key} {inner}".strip())
    elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        for index, item in enumerate(value):
            yield from _inputs(item, f"{key} {index + 1}".strip())
    else:
        label, unit = unit_of_field(key)
        yield ("" if key == "kind" else _words(label)), _quantity(value, unit)


def _quantity(value: Any, unit: Unit) -> str:
    if isinstance(value, bool | str):
        return number(value) if isinstance(value, bool) else value
    if isinstance(value, Mapping):
        return "; ".join(f"{k} = {_plain(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        inner = ", ".join(_plain(v * unit.factor) if isinstance(v, float | int) else str(v) for v in value)
        return f"({inner}) {unit.symbol}".strip()
    return unit.text(value, 6) if unit.symbol else number(value, 6)


def _plain(value: Any) -> str:
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_plain(v) for v in value) + "]"
    return number(value, 5) if isinstance(value, int | float) else str(value)


def _words(name: str) -> str:
    return name.replace("_", " ")
