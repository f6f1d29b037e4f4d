"""A sweep of FEM as a document: its designs, causes of missing ones, and cost; for terminal and JSON."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pliant.formatting import deformation_unit, fixed, number, output_unit, seconds
from pliant.report.document import Column, Document, Table, as_json, brief_table
from pliant_designs.sweep import DesignOutcome, SweepRun

MOST_LINES = 100

DESIGNS: tuple[Column[DesignOutcome], ...] = (
    Column("design.number", "", brief="design"),
    Column("design.parameters"),
    Column("status"),
    Column("cause"),
    Column("free_angle_rad", brief="free angle", text=lambda o: _free(o)),
    Column("n_states", brief="states", text=lambda o: _if_done(o, f"{o.n_states}{_failed(o.n_failed)}")),
    Column("n_failed", "states_failed"),
    Column("self_contact"),
    Column("wall_s", brief="time", text=lambda o: _if_done(o, "stored" if o.cached else seconds(o.wall_s))),
    Column("cached"),
    Column("key"),
)


def sweep_document(run: SweepRun, title: str, table: Path) -> Document:
    """Return the document of `pliant fem` of a sweep; `table` is the file of its states."""
    done, more = run.done(), len(run.outcomes) - MOST_LINES
    data = {
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
    cut = [f"… and {more} more designs"] if more > 0 else []
    lines = [*cut, *_grouped(run), _total(run)]
    brief: tuple[Table | str, ...] = (_designs_table(run), *lines)
    return Document(kind="Pliant FEM sweep", title=title, sentence="", data=data, brief=brief)


def _designs_table(run: SweepRun) -> Table:
    """Return the terminal's columns, those of varied parameters after the number."""
    number_, *rest = [column for column in DESIGNS if column.brief]

    def varied(name: str) -> Column[DesignOutcome]:
        return Column(
            "design", "", brief=output_unit(name).axis, text=lambda o: _value(name, o.design.changes[name])
        )

    columns = (number_, *map(varied, run.outcomes[0].design.changes), *rest)
    return brief_table(columns, run.outcomes[:MOST_LINES])


def _if_done(outcome: DesignOutcome, text: str) -> str:
    return text if outcome.status == "done" else ""


def _failed(count: int) -> str:
    return f" ({count} failed)" if count else ""


def _free(outcome: DesignOutcome) -> str:
    if outcome.status != "done":
        return outcome.status.replace("_", " ")
    if outcome.free_angle_rad is None:
        return "–"
    unit = deformation_unit(outcome)
    return unit.attached(
        fixed(unit.factor * outcome.free_angle_rad, 3 if outcome.joint == "prismatic" else 2)
    )


def _value(name: str, value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return number(float(value) * output_unit(name).factor, 6)


def _grouped(run: SweepRun) -> list[str]:
    """Return each cause once: sentences that differ only in numbers are one cause."""
    groups: dict[str, list[DesignOutcome]] = {}
    for outcome in run.outcomes:
        if outcome.status != "done":
            words = re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "…", outcome.cause)
            groups.setdefault(f"{outcome.status} {words}", []).append(outcome)
    text = []
    for group in sorted(groups.values(), key=len, reverse=True):
        shown = ", ".join(str(outcome.design.number) for outcome in group[:8])
        numbers = f"design{'s' * (len(group) > 1)} {shown}{', …' if len(group) > 8 else ''}"
        text.append(f"{len(group)} {group[0].status.replace('_', ' ')} ({numbers}): {group[0].cause}")
    return text


def _total(run: SweepRun) -> str:
    done = run.done()
    stored = sum(outcome.cached for outcome in done)
    parts = [f"{len(done)} of {len(run.outcomes)} designs"]
    parts += [f"{stored} from the store"] if stored else []
    parts += [f"{len(run.refused())} refused by the family"] if run.refused() else []
    parts += [f"{len(run.failed())} FAILED"] if run.failed() else []
    states = sum(o.n_states for o in done)
    parts.append(f"{states} states{_failed(sum(o.n_failed for o in done))}")
    return f"sweep    {', '.join(parts)}, {seconds(run.wall_s)}"
