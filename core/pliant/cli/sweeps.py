"""`pliant fem` of a study with a sweep: options, JSON (docs/run_a_sweep_on_a_cluster.md) and lines for people."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.cli.options import workers_or_scheduler
from pliant.cli.session import Session, check_writable, plain
from pliant.config.study import Study
from pliant.errors import NotReachedError
from pliant.formatting import deformation_unit, fixed, number, unit_of_field
from pliant.pipeline.sweep import sweep_study
from pliant.pipeline.sweep_records import DesignOutcome, SweepRun
from pliant.pipeline.sweep_table import write_sweep_table
from pliant.pipeline.workbench import Workbench
from pliant.store.store import write_atomically

TABLE, INDEX = "fem.csv", "sweep.json"
MOST_LINES = 100


def fem_of_sweep(
    here: Session, bench: Workbench, study: Study, folder: Path, workers: int | None, scheduler: str | None
) -> None:
    """Solve the sweep, write its table and index, say what came of it."""
    chosen = workers_or_scheduler(workers, scheduler)
    check_writable(folder)
    run = sweep_study(bench, study, executor=chosen)
    write_sweep_table(run, folder / TABLE)
    here.result.update(result(run, folder))
    index = {"pliant": __version__, "study": study.name, **plain(here.result)}
    write_atomically(folder / INDEX, json.dumps(index, indent=1, allow_nan=False))
    for line in lines(run):
        here.say(line)
    here.say(f"table    {folder / TABLE}, designs in {folder / INDEX}")
    if here.result["failed"] or run.failed() or not run.done():
        here.exit_code = NotReachedError.exit_code


def result(run: SweepRun, folder: Path) -> dict[str, Any]:
    """The `fem` result of a sweep."""
    done = run.done()
    return {
        "n_states": sum(o.n_states for o in done),
        "failed": [{"design": o.design.number, **failure} for o in done for failure in o.failed],
        "self_contact": sum(o.self_contact for o in done),
        "passed_through": sum(o.passed_through for o in done),
        "wall_s": run.wall_s,
        "fem_wall_s": sum(o.wall_s for o in done),
        "csv": str(folder / TABLE),
        "swept": list(run.outcomes[0].design.changes),
        "designs_done": len(done),
        "designs_refused": len(run.refused()),
        "designs_failed": len(run.failed()),
        "designs": [_design(outcome) for outcome in run.outcomes],
    }


def _design(outcome: DesignOutcome) -> dict[str, Any]:
    return {
        "parameters": outcome.design.parameters,
        "status": outcome.status,
        "cause": outcome.cause,
        "n_states": outcome.n_states,
        "states_failed": outcome.n_failed,
        "self_contact": outcome.self_contact,
        "free_angle_rad": outcome.free_angle_rad,
        "wall_s": outcome.wall_s,
        "cached": outcome.cached,
        "key": outcome.key,
    }


def lines(run: SweepRun) -> list[str]:
    """The result for people: a table of designs, then the causes of those that are missing."""
    names = list(run.outcomes[0].design.changes)
    heads = [_head(name) for name in names]
    rows = [["design", *heads, "free angle", "states", "time"]]
    for outcome in run.outcomes[:MOST_LINES]:
        values = [_value(name, outcome.design.changes[name]) for name in names]
        rows.append([str(outcome.design.number), *values, *_came_to(outcome)])
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    text = ["  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in rows]
    if len(run.outcomes) > MOST_LINES:
        text.append(f"… and {len(run.outcomes) - MOST_LINES} more designs")
    return [*text, *_grouped(run), _total(run)]


def _came_to(outcome: DesignOutcome) -> list[str]:
    if outcome.status != "done":
        return [outcome.status.replace("_", " "), "", ""]
    angle = "–" if outcome.free_angle_rad is None else _angle(outcome)
    failed = f" ({outcome.n_failed} failed)" if outcome.n_failed else ""
    return [angle, f"{outcome.n_states}{failed}", "stored" if outcome.cached else f"{outcome.wall_s:.1f} s"]


def _angle(outcome: DesignOutcome) -> str:
    assert outcome.free_angle_rad is not None
    unit = deformation_unit(outcome)
    return unit.attached(
        fixed(outcome.free_angle_rad * unit.factor, 3 if outcome.joint == "prismatic" else 2)
    )


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
    return f"sweep    {', '.join(parts)}, {run.wall_s:.1f} s"


def _head(name: str) -> str:
    word, unit = unit_of_field(name)
    return f"{word} ({unit.symbol})" if unit.symbol else word


def _value(name: str, value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return number(value * unit_of_field(name)[1].factor, 6)
