"""The option `--fields` of `pliant fem`: fields of an FEM data set's states as files for ParaView."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, cast, get_args

from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.meshing.meshio_package import require_meshio
from pliant.pipeline.study import study_families
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import ModuleData
from pliant.store.store import Artifact, writing_in
from pliant_view.fields import SolvedFields, Which, field_targets, solve_fields
from pliant_view.vtu import write_pvd, write_vtu

FIELDS_TABLE = "states.csv"


def fields_writer(folder: Path, which: str) -> Callable[..., None]:
    """Return `write_fields` for a folder and a choice of states, checked before any work is done.

    Raises:
        UserError: an unknown choice.
        MissingDependencyError: no meshio.
    """
    if which not in get_args(Which):
        known = get_args(Which)
        raise UserError(
            f"--fields-of {which}: give {', '.join(known[:-1])} or {known[-1]}{closest(which, known)}"
        )
    require_meshio()
    check_writable(folder)
    return partial(write_fields, target=folder, which=cast(Which, which))


def write_fields(
    session: Session,
    context: RunContext,
    study: Study,
    artifacts: Sequence[Artifact],
    target: Path,
    which: Which,
) -> None:
    """Solve the states again and write their files; several designs get a folder each."""
    families = study_families(study)
    made: list[Path] = []
    for number, (family, artifact) in enumerate(zip(families, artifacts, strict=True)):
        folder = target if len(families) == 1 else target / f"design_{number + 1}"
        check_writable(folder)
        data: ModuleData = artifact.value
        targets = field_targets(data, which)
        solved = solve_fields(
            context, family, study.need("material", "FEM"), study.need("fem", "FEM"), targets
        )
        with closing(solved), writing_in(folder):  # type: ignore[type-var]
            made += _write_states(folder, data, solved)
    session.result["fields"] = [str(path) for path in made]
    session.say(
        f"fields   {sum(p.suffix == '.vtu' for p in made)} states in {target}; open free.pvd in ParaView"
    )


def _write_states(folder: Path, data: ModuleData, solved: Any) -> list[Path]:
    """Write one VTU file for each state, a PVD for each branch, and a table of the states."""
    names: dict[str, list[tuple[float, str]]] = {"free": [], "held": []}
    rows: list[Mapping[str, Any]] = []
    for one in solved:
        branch = "held" if one.held else "free"
        name = f"{branch}_{len(names[branch]):03d}.vtu"
        write_vtu(folder / name, one.fields)
        # Time is the actuation if the deformation is free, else the index in the row.
        time = one.state.actuation if branch == "free" else float(len(names[branch]))
        names[branch].append((time, name))
        rows.append(_row(name, one, data))
    paths = [folder / name for files in names.values() for _, name in files]
    for branch, files in names.items():
        if files:
            write_pvd(folder / f"{branch}.pvd", files)
            paths.append(folder / f"{branch}.pvd")
    with (folder / FIELDS_TABLE).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)), restval="")
        writer.writeheader()
        writer.writerows(rows)
    return [*paths, folder / FIELDS_TABLE]


def _row(name: str, one: SolvedFields, data: ModuleData) -> dict[str, Any]:
    """Return a state's row of the table, SI, one column for each coordinate and effort."""
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
