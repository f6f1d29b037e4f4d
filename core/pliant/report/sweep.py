"""A sweep of FEM as a document: its designs, why some are missing, what it took; for terminal and JSON."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pliant.formatting import deformation_unit, fixed, number, seconds, unit_of
from pliant.pipeline.sweep import DesignOutcome, SweepRun
from pliant.report.document import Column, Document, Table, as_json

MOST_LINES = 100

DESIGNS: tuple[Column[DesignOutcome], ...] = (
    Column("design.number", "", brief="design"),
    Column("design.parameters"),
    Column("status"),
    Column("cause"),
    Column("free_angle_rad", brief="free angle", text=lambda o: _free(o)),
    Column("n_states", brief="states", text=lambda o: _states(o)),
    Column("n_failed", "states_failed"),
    Column("self_contact"),
    Column("wall_s", brief="time", text=lambda o: _time(o)),
    Column("cached"),
    Column("key"),
)


def sweep_document(run: SweepRun, title: str, table: Path) -> Document:
    """The document of `pliant fem` of a sweep; `table` holds its states."""
    return Document(
        kind="Pliant FEM sweep",
        title=title,
        sentence="",
        data=_sweep_json(run, table),
        brief=(_designs_table(run), *_missing_lines(run), *_grouped(run), _total(run)),
    )


def _sweep_json(run: SweepRun, table: Path) -> dict[str, Any]:
    done = run.done()
    return {
        "n_states": sum(o.n_states for o in done),
        "failed": [{"design": o.design.number, **failure} for o in done for failure in o.failed],
        "self_contact": sum(o.self_contact for o in done),
        "passed_through": sum(o.passed_through for o in done),
        "wall_s": run.wall_s,
        "fem_wall_s": sum(o.wall_s for o in done),
        "csv": str(table),
        "swept": list(run.outcomes[0].design.changes),
        "designs_done": len(done),
        "designs_refused": len(run.refused()),
        "designs_failed": len(run.failed()),
        "designs": [as_json(DESIGNS, outcome) for outcome in run.outcomes],
    }


def _designs_table(run: SweepRun) -> Table:
    names = list(run.outcomes[0].design.changes)
    first, *rest = [column for column in DESIGNS if column.brief]
    rows = [
        [
            first.cell(o),
            *(_value(name, o.design.changes[name]) for name in names),
            *(column.cell(o) for column in rest),
        ]
        for o in run.outcomes[:MOST_LINES]
    ]
    return Table("", [first.brief, *(unit_of(name).axis for name in names), *(c.brief for c in rest)], rows)


def _missing_lines(run: SweepRun) -> list[str]:
    more = len(run.outcomes) - MOST_LINES
    return [f"… and {more} more designs"] if more > 0 else []


def _free(outcome: DesignOutcome) -> str:
    if outcome.status != "done":
        return outcome.status.replace("_", " ")
    if outcome.free_angle_rad is None:
        return "–"
    unit = deformation_unit(outcome)
    return unit.attached(
        fixed(unit.factor * outcome.free_angle_rad, 3 if outcome.joint == "prismatic" else 2)
    )


def _states(outcome: DesignOutcome) -> str:
    failed = f" ({outcome.n_failed} failed)" if outcome.n_failed else ""
    return f"{outcome.n_states}{failed}" if outcome.status == "done" else ""


def _time(outcome: DesignOutcome) -> str:
    if outcome.status != "done":
        return ""
    return "stored" if outcome.cached else seconds(outcome.wall_s)


def _value(name: str, value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return number(float(value) * unit_of(name).factor, 6)


def _grouped(run: SweepRun) -> list[str]:
    """Causes, each once: sentences that differ in their numbers only are one cause."""
    groups: dict[str, list[DesignOutcome]] = {}
    for outcome in run.outcomes:
        if outcome.status != "done":
            words = re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "…", outcome.cause)
            groups.setdefault(f"{outcome.status} {words}", []).append(outcome)
    text = []
    for group in sorted(groups.values(), key=len, reverse=True):
        status = group[0].status.replace("_", " ")
        numbers = _numbers([outcome.design.number for outcome in group])
        text.append(f"{len(group)} {status} ({numbers}): {group[0].cause}")
    return text


def _numbers(numbers: Sequence[int]) -> str:
    shown = ", ".join(map(str, numbers[:8]))
    return f"design {shown}" if len(numbers) == 1 else f"designs {shown}{', …' if len(numbers) > 8 else ''}"


def _total(run: SweepRun) -> str:
    done = run.done()
    stored = sum(outcome.cached for outcome in done)
    parts = [f"{len(done)} of {len(run.outcomes)} designs"]
    parts += [f"{stored} from the store"] if stored else []
    parts += [f"{len(run.refused())} refused by the family"] if run.refused() else []
    parts += [f"{len(run.failed())} FAILED"] if run.failed() else []
    states, failed = sum(o.n_states for o in done), sum(o.n_failed for o in done)
    parts.append(f"{states} states" + (f" ({failed} failed)" if failed else ""))
    return f"sweep    {', '.join(parts)}, {seconds(run.wall_s)}"
