"""Files of a finished search: JSON, the table of its candidates, and the record from which its page is rebuilt."""

from __future__ import annotations

import csv
import json
import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.pipeline.run_folder import replaced_folder
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.store.store import (
    CorruptedError,
    digests,
    read_checked,
    write_atomically,
    write_value,
    writing_in,
)
from pliant.units import UNIT_SUFFIXES
from pliant_search.records import STATUSES, FoundDesign, SearchResult, VariableRecord, Verification
from pliant_search.report.view import evenly_spaced

HISTORY, RESULT, BEST, EXPORTED = "history.csv", "optimize.json", "best.yaml", "optimizer"
DESIGNS = "designs.csv"  # the meta-model's data of a search that went on with the FEM of refused designs
DESIGN = ("family", "chain", "material", "surrogate")
EFFORT = ("evaluations", "simulations", "refused", "failed", "stopped", "wall_s")  # names in the record
MOST_ROWS = 20_000


def search_json(result: SearchResult, engine: str) -> dict[str, Any]:
    """Return the keys of the `optimize` result; `engine` is the study's own."""
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
        "branches": result.branches,
        **{name: getattr(result, name) for name in EFFORT},
        "slopes": [vars(slope) for slope in result.slopes],
        "limits": result.limits,
        "verified": _verified_json(result.verification, engine),
        "refused_by_check": [_design_json(design) for design in result.refused_by_check],
        "rounds": [{**dict(vars(one)), "best": None, **_design_json(one.best)} for one in result.rounds],
        "polished": [vars(one) for one in result.polished],
        "robustness": _robustness_json(result),
        "history": _history_json(result),
    }


def _design_json(design: FoundDesign) -> dict[str, Any]:
    """Return the settings, separated into the design and its actuation."""
    found = dict(vars(design))
    settings, before = found.pop("settings"), found.pop("first")
    built = {key: value for key, value in settings.items() if key.partition(".")[0] in DESIGN}
    controls = {key: value for key, value in settings.items() if key not in built}
    again = {"objectives_before": before} if before else {}
    return {"design": built, "controls": controls, **found, **again}


def _verified_json(check: Verification | None, engine: str) -> dict[str, Any] | None:
    """Return the metrics of the study's engine, together with all results of the check."""
    if check is None:
        return None
    found = dict(vars(check))
    engines = found.pop("verified")
    return {**engines.get(engine, {}), "engines": engines, **found}


def _robustness_json(result: SearchResult) -> dict[str, Any] | None:
    found = result.robustness
    return None if found is None else {**vars(found), "nominal": _design_json(found.nominal)}


def _history_json(result: SearchResult) -> list[dict[str, Any]]:
    """Return a row per candidate; very long searches are thinned evenly with the last one kept: history.csv has all."""
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
        for row in evenly_spaced(len(history), MOST_ROWS)
    ]


def _stated(result: SearchResult, row: int, column: int) -> float:
    return _signed(result, float(result.history.objectives[row, column]), column)


def _signed(result: SearchResult, value: float, column: int) -> float:
    return -value if result.maximised[column] else value


def write_history(result: SearchResult, path: Path) -> None:
    """Write one row per candidate, SI columns named key_unit; choices are written out."""
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
    """Return `family.wall` in m as `family.wall_m`."""
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
    """Copy the optimizer's files into the result's folder; those that the store has lost are left out."""
    target = folder / EXPORTED
    copied = []
    with writing_in(folder):
        shutil.rmtree(target, ignore_errors=True)
        for name in names:
            if (source / name).is_file():
                (target / name).parent.mkdir(parents=True, exist_ok=True)
                copied.append(Path(shutil.copy2(source / name, target / name)))
    return copied


DATA = Path("data") / "search_page"
DIGESTS = "digests.json"


@dataclass(frozen=True, eq=False)
class DrawnDesign:
    """A design to draw: its name, its task's result, the markers (n + 2, 3) of its straight chain, if any."""

    label: str
    result: TaskResult
    rest_m: Array | None = None

    @staticmethod
    def from_result(label: str, chain: ChainModel | None, result: TaskResult) -> DrawnDesign:
        """Return a design without the recorded motion, which no picture needs; `chain`: None for a scene."""
        rest = None
        if chain is not None and not result.stills:
            rest = ChainGeometry.from_chain(chain).markers(np.zeros_like(result.final.joint_angles))
        return DrawnDesign(label, replace(result, frames=None, rollout=None), rest)


def write_search(
    folder: Path, study: Mapping[str, Any], result: SearchResult, drawn: Sequence[DrawnDesign]
) -> None:
    """Write the record, replacing an earlier one as a whole. Raises `UserError` where it cannot."""
    value = {"study": study, "result": result, "drawn": [dict(vars(one)) for one in drawn]}
    with writing_in(folder), replaced_folder(folder / DATA) as fresh:
        fresh.mkdir(parents=True)
        write_value(fresh, value)
        write_atomically(fresh / DIGESTS, json.dumps(digests(fresh)))


def read_search(folder: Path) -> tuple[Mapping[str, Any], SearchResult, tuple[DrawnDesign, ...]]:
    """Read study, record and drawings; raises `UserError` for a missing or damaged record."""
    try:
        expected = json.loads((folder / DATA / DIGESTS).read_text())
        value = read_checked(folder / DATA, expected)
        return value["study"], value["result"], tuple(DrawnDesign(**one) for one in value["drawn"])
    except FileNotFoundError:
        raise UserError(f"{folder} holds no finished search; give the folder of 'pliant optimize'.") from None
    except (CorruptedError, OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise UserError(f"{folder} is damaged ({error}); run 'pliant optimize' again.") from None
