"""A finished search as JSON and as a table of its candidates (docs/design_for_a_task.md)."""

from __future__ import annotations

import csv
import math
import shutil
from pathlib import Path
from typing import Any

from pliant.records.search import STATUSES, FoundDesign, SearchResult, VariableRecord, Verification
from pliant.report.search_view import spread_of
from pliant.store.store import writing_in
from pliant.units import UNIT_SUFFIXES

HISTORY, JSON, BEST, EXPORTED = "history.csv", "optimize.json", "best.yaml", "optimizer"
DESIGN = ("family", "chain", "material", "surrogate")
MOST_ROWS = 20_000


def search_json(result: SearchResult, engine: str) -> dict[str, Any]:
    """The keys of the `optimize` result; `engine` is the study's own."""
    best = result.best[0] if result.best else None
    return {
        "optimizer": result.optimizer,
        "seed": result.seed,
        "best": _design_json(best) if best else None,
        "designs": [_design_json(design) for design in result.best],
        "objective": next(iter(best.objectives.values())) if best else None,
        "objectives": dict(
            zip(result.objectives, ["max" if m else "min" for m in result.maximised], strict=True)
        ),
        "variables": [vars(variable) for variable in result.variables],
        "branches": [dict(values) for values in result.branches],
        "evaluations": result.evaluations,
        "simulations": result.simulations,
        "refused": dict(result.refused),
        "failed": dict(result.failed),
        "stopped": result.stopped,
        "wall_s": result.wall_s,
        "slopes": [vars(slope) for slope in result.slopes],
        "limits": list(result.limits),
        "verified": _verified_json(result.verification, engine),
        "robustness": _robustness_json(result),
        "history": _history_json(result),
    }


def _design_json(design: FoundDesign) -> dict[str, Any]:
    """Settings parted into what is built and how it is driven."""
    built = {key: value for key, value in design.settings.items() if key.partition(".")[0] in DESIGN}
    return {
        "design": built,
        "controls": {key: value for key, value in design.settings.items() if key not in built},
        "values": dict(design.values),
        "objectives": dict(design.objectives),
        "metrics": dict(design.metrics),
        "conditions": {name: dict(metrics) for name, metrics in design.conditions.items()},
        "branch": design.branch,
        "context": design.context,
        "number": design.number,
        **({"objectives_before": dict(design.first)} if design.first else {}),
    }


def _verified_json(check: Verification | None, engine: str) -> dict[str, Any] | None:
    """The metrics of the study's engine, and beside them everything that the check found."""
    if check is None:
        return None
    return {
        **check.verified.get(engine, {}),
        "engines": {name: dict(metrics) for name, metrics in check.verified.items()},
        "predicted": {name: dict(metrics) for name, metrics in check.predicted.items()},
        "conditions": check.conditions,
        "laws": [dict(law) for law in check.laws],
        "fem_wall_s": check.fem_wall_s,
        "wall_s": check.wall_s,
        "notes": list(check.notes),
    }


def _robustness_json(result: SearchResult) -> dict[str, Any] | None:
    found = result.robustness
    return None if found is None else {**vars(found), "nominal": _design_json(found.nominal)}


def _history_json(result: SearchResult) -> list[dict[str, Any]]:
    """A row per candidate, of very long searches evenly spread ones, the last among them: all are in history.csv."""
    history = result.history
    best = history.best_so_far() if len(history) else history.objectives
    return [
        {
            "row": row,
            "branch": int(history.branch[row]),
            "context": int(history.context[row]),
            "status": STATUSES[int(history.status[row])],
            "objective": _stated(result, row, 0),
            "best": _signed(result, float(best[row]), 0),
            "values": {name: float(column[row]) for name, column in history.values.items()},
        }
        for row in spread_of(len(history), MOST_ROWS)
    ]


def _stated(result: SearchResult, row: int, column: int) -> float:
    return _signed(result, float(result.history.objectives[row, column]), column)


def _signed(result: SearchResult, value: float, column: int) -> float:
    return -value if result.maximised[column] else value


def write_history(result: SearchResult, path: Path) -> None:
    """One row per candidate, SI columns named key_unit; choices written out."""
    history = result.history
    known = {variable.name: variable for variable in result.variables}
    names = list(history.values)
    head = ["branch", "condition", "status"]
    head += [column_name(name, known.get(name)) for name in names]
    head += [f"objective.{name}" if name in names else name for name in result.objectives]
    metrics = [name for name in history.metrics if name not in head]
    with writing_in(path.parent), path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow([*head, *metrics, "wall_s"])
        for row in range(len(history)):
            context = int(history.context[row])
            cells: list[Any] = [int(history.branch[row])]
            cells.append(result.conditions[context] if 0 <= context < len(result.conditions) else "")
            cells.append(STATUSES[int(history.status[row])])
            cells += [_cell(float(history.values[name][row]), known.get(name)) for name in names]
            cells += [_stated(result, row, column) for column in range(len(result.objectives))]
            cells += [float(history.metrics[name][row]) for name in metrics]
            cells.append(float(history.wall_s[row]))
            table.writerow(["" if isinstance(c, float) and math.isnan(c) else c for c in cells])


def column_name(name: str, variable: VariableRecord | None) -> str:
    """`family.wall` in m → `family.wall_m`."""
    unit = variable.unit if variable else ""
    suffix = next((suffix for suffix, known in UNIT_SUFFIXES.items() if known == unit), "")
    return name if not suffix or name.endswith(suffix) else name + suffix


def _cell(value: float, variable: VariableRecord | None) -> Any:
    if math.isnan(value):
        return value
    if variable is not None and variable.type == "categorical":
        return variable.choices[int(value)]
    if variable is not None and variable.type == "integer":
        return int(value)
    return value


def copy_exported(names: tuple[str, ...], source: Path, folder: Path) -> list[Path]:
    """The optimizer's files beside the result; those that the store has lost are left out."""
    target = folder / EXPORTED
    copied = []
    with writing_in(folder):
        shutil.rmtree(target, ignore_errors=True)
        for name in names:
            if (source / name).is_file():
                (target / name).parent.mkdir(parents=True, exist_ok=True)
                copied.append(Path(shutil.copy2(source / name, target / name)))
    return copied
