"""`pliant fem --fields DIR`: displacement and stress of solved states as files for ParaView."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast, get_args

import typer

from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.pipeline.fields import SolvedFields, Which, field_targets, solve_fields
from pliant.pipeline.study import families_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.fem import ModuleData
from pliant.report.vtu import require_meshio, write_pvd, write_vtu
from pliant.store.store import Artifact, writing_in

FieldsFolder = Annotated[
    Path | None,
    typer.Option(
        "--fields", metavar="DIR", help="Also write displacement and stress as VTU files for ParaView."
    ),
]
FieldsOf = Annotated[
    str,
    typer.Option(
        "--fields-of",
        metavar="WHICH",
        help="States whose fields are written: free, extremes (and the outermost held ones), or all.",
    ),
]
DEFAULT_WHICH = "extremes"
TABLE = "states.csv"


@dataclass(frozen=True)
class FieldsRequest:
    """Where fields go, and of which states."""

    folder: Path
    which: Which


def fields_request(folder: Path | None, which: str) -> FieldsRequest | None:
    """The options, checked before any work is done. Raises `UserError`, `MissingDependencyError`."""
    if which not in get_args(Which):
        known = get_args(Which)
        raise UserError(
            f"--fields-of {which}: give {', '.join(known[:-1])} or {known[-1]}{closest(which, known)}"
        )
    if folder is None:
        if which != DEFAULT_WHICH:
            raise UserError("--fields-of tells which states --fields writes; give --fields DIR too.")
        return None
    require_meshio()
    check_writable(folder)
    return FieldsRequest(folder, cast(Which, which))


def write_fields(
    here: Session, bench: Workbench, study: Study, artifacts: Sequence[Artifact], request: FieldsRequest
) -> None:
    """Solve the states again and write their files; several designs get a folder each."""
    families = families_of_study(study)
    made: list[Path] = []
    for number, (family, artifact) in enumerate(zip(families, artifacts, strict=True)):
        folder = request.folder if len(families) == 1 else request.folder / f"design_{number + 1}"
        check_writable(folder)
        data: ModuleData = artifact.value
        targets = field_targets(data, request.which)
        solved = solve_fields(bench, family, study.need("material", "FEM"), study.need("fem", "FEM"), targets)
        with closing(solved), writing_in(folder):  # type: ignore[type-var]
            made += _write(folder, data, solved)
    here.result["fields"] = [str(path) for path in made]
    here.say(
        f"fields   {sum(p.suffix == '.vtu' for p in made)} states in {request.folder}; open free.pvd in ParaView"
    )


def _write(folder: Path, data: ModuleData, solved: Any) -> list[Path]:
    """One VTU file for each state, a PVD for each branch, and a table of what is what."""
    names: dict[str, list[tuple[float, str]]] = {"free": [], "held": []}
    rows: list[Mapping[str, Any]] = []
    for one in solved:
        branch = "held" if one.held else "free"
        name = f"{branch}_{len(names[branch]):03d}.vtu"
        write_vtu(folder / name, one.fields)
        # Time is the actuation where nothing is held, else the place in the row.
        time = one.state.actuation if branch == "free" else float(len(names[branch]))
        names[branch].append((time, name))
        rows.append(_row(name, one, data))
    paths = [folder / name for files in names.values() for _, name in files]
    for branch, files in names.items():
        if files:
            write_pvd(folder / f"{branch}.pvd", files)
            paths.append(folder / f"{branch}.pvd")
    with (folder / TABLE).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)), restval="")
        writer.writeheader()
        writer.writerows(rows)
    return [*paths, folder / TABLE]


def _row(name: str, one: SolvedFields, data: ModuleData) -> dict[str, Any]:
    """A state in the table, SI, one column for each coordinate and effort."""
    slides = data.joint == "prismatic"
    u, tau = ("extension_m", "force_n") if slides else ("angle_rad", "moment_n_m")
    several = len(data.axes) > 1
    row: dict[str, Any] = {"file": name, "branch": one.state.branch, "status": one.state.status}
    row[data.actuation_name] = one.state.actuation
    for axis in data.axes:
        end = f"_{axis}" if several else ""
        known = axis in one.axes  # a piece of the main axis alone has no others
        k = one.axes.index(axis) if known else 0
        row[u + end] = float(one.state.deformation[k]) if known else ""
        row[tau + end] = float(one.state.tau[k]) if known else ""
    row["held"] = " ".join(one.held)
    return row
