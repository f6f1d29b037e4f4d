"""FEM data sets as a document: of the designs of one study, for terminal, page and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.formatting import percent, units_of_page
from pliant.pipeline.workbench import Workbench
from pliant.records.fem import PASSED, SELF_CONTACT, TOUCHING, ModuleData
from pliant.report.document import Document, Drawn, answers, capital
from pliant.report.fem_view import DesignStates, axis_record, data_warnings, free_reach, solved_rows
from pliant.report.provenance import duration, made_by, stage_json
from pliant.report.stage import StoredPage
from pliant.store.store import Artifact

PAGE = "fem.html"  # beside fem.csv; `pliant run` in the same folder writes report.html
SENTENCES = 3  # designs that the page's first sentence speaks of
TOLD_OF_AXIS = ("error", "stated_error", "reached", "check_error", "symmetric")


def fem_document(study: Study, artifacts: Sequence[Artifact], tables: Sequence[str]) -> Document:
    """The document of `pliant fem`.

    Args:
        study: the study.
        artifacts: the data sets, one for each design.
        tables: files that hold them, in the same order.
    """
    written = study.canonical()
    kind = str((written.get("fem") or {}).get("kind", ""))
    names = [study.name] if len(artifacts) == 1 else [f"design {n + 1}" for n in range(len(artifacts))]
    designs = [DesignStates(name, a.value, kind) for name, a in zip(names, artifacts, strict=True)]
    several = len(designs) > 1
    manifests = [a.manifest for a in artifacts]

    def draw() -> Drawn:
        from pliant.report.fem_page import fem_drawn  # matplotlib takes a second to import

        return fem_drawn(written, designs, manifests)

    limits = tuple(w for d in designs for w in data_warnings(d.data, f"{d.name}: " if several else ""))
    return Document(
        kind="Pliant FEM data",
        title=study.name,
        sentence=" ".join(_sentence(d, several) for d in designs[:SENTENCES]),
        data=fem_json(artifacts, tables),
        answers=answers(
            good=capital(stated_error(axis_record(designs[0].data, designs[0].data.main_axis))),
            missing=limits[0].sentence if limits else "",
            after="Fit the joint law and see its errors on states left out: pliant fit.",
        ),
        brief=(*fem_lines(artifacts), f"table    {', '.join(tables)}"),
        warnings=limits,
        draw=draw,
        footer=units_of_page(pressures="Pa", forces="N", moments="N*m", angles="rad", extensions="m"),
        page=PAGE,
        version=made_by(manifests),
    )


def stored_fem_page(bench: Workbench, study: Study, artifacts: Sequence[Artifact]) -> StoredPage:
    """What the page of a data set depends on."""
    manifests = [a.manifest for a in artifacts]
    return StoredPage(bench, manifests, [], "pliant.report.fem_page", {"study": study.canonical()})


def fem_json(artifacts: Sequence[Artifact], tables: Sequence[str]) -> dict[str, Any]:
    """The `fem` result of docs/command_line.md."""
    data: list[ModuleData] = [a.value for a in artifacts]
    return {
        "n_states": sum(len(d) for d in data),
        "failed": [dict(f) for d in data for f in d.failed],
        "self_contact": sum(int(np.sum(d.status == SELF_CONTACT)) for d in data),
        "passed_through": sum(int(np.sum(d.status == PASSED)) for d in data),
        "touching": sum(int(np.sum(d.status == TOUCHING)) for d in data),
        "wall_s": sum(a.manifest["wall_s"] for a in artifacts),
        "newton_steps": sum(int(d.iterations.sum()) for d in data),
        "axes": _of_axes(data[0]) if len(data) == 1 else [_of_axes(d) for d in data],
        "csv": tables[0] if len(tables) == 1 else list(tables),
        "stages": [stage_json(a) for a in artifacts],
    }


def _of_axes(data: ModuleData) -> dict[str, dict[str, Any]]:
    """By axis, how many states it has and what adaptive sampling states of its law's error."""
    return {
        axis: {
            "n_states": int(np.sum(data.explored == axis)),
            **{key: record[key] for key in TOLD_OF_AXIS if key in (record := axis_record(data, axis))},
        }
        for axis in data.explored_axes()
    }


def fem_lines(artifacts: Sequence[Artifact]) -> list[str]:
    """States, axes and cost of each data set, for the terminal."""
    lines = []
    for artifact in artifacts:
        data: ModuleData = artifact.value
        check, contact = int(np.sum(data.role == "check")), int(np.sum(data.status == SELF_CONTACT))
        passed, touching = int(np.sum(data.status == PASSED)), int(np.sum(data.status == TOUCHING))
        through = f"{passed} passed through, " if passed else ""
        through += f"{touching} with walls that hold each other, " if touching else ""
        lines.append(
            f"FEM      {len(data)} states ({check} never fitted, {contact} with self-contact, {through}"
            f"{len(data.failed)} failed), {free_reach(data)}, {duration(artifact)}"
        )
        lines += [f"         {line}" for line in (*_axis_lines(data), _cost_line(data)) if line]
    return lines


def _axis_lines(data: ModuleData) -> list[str]:
    """States of each axis, and the error that adaptive sampling states; nothing to say of one axis on a grid."""
    lines = []
    for axis in data.explored_axes():
        stated = stated_error(axis_record(data, axis))
        if len(data.axes) > 1:
            count = int(np.sum(data.explored == axis))
            lines.append(f"axis {axis}: {count} states{f', {stated}' if stated else ''}")
        elif stated:
            lines.append(stated)
    if together := int(np.sum(data.explored == "coupling")):
        lines.append(f"all axes held: {together} state{'s' * (together > 1)}")
    return lines


def stated_error(record: Mapping[str, Any]) -> str:
    """The stated error of an axis and whether it is as small as wanted; empty where no error was stated."""
    if "stated_error" not in record:
        return ""
    stated, wanted = record["stated_error"], percent(float(record["error"]))
    if stated is None:
        return f"error not stated: too few states for it (wanted {wanted})"
    text = f"stated error {percent(float(stated))} of the effort's range"
    if record.get("reached"):
        return f"{text} (wanted {wanted})"
    if stated <= record["error"]:
        return f"{text}, NOT TESTED by enough good predictions (wanted {wanted})"
    return f"{text}, NOT REACHED (wanted {wanted})"


def _cost_line(data: ModuleData) -> str:
    """Time and Newton steps of a state; copies by symmetry took none."""
    solved = solved_rows(data)
    if not solved.any():
        return ""
    wall, steps = data.wall_s[solved], data.iterations[solved]
    return (
        f"{wall.mean():.2g} s and {steps.mean():.2g} Newton steps for a state, {wall.max():.2g} s and "
        f"{int(steps.max())} at most"
    )


def _sentence(design: DesignStates, named: bool) -> str:
    """Free deformation, number of states, whether the stated error was reached."""
    data = design.data
    record = axis_record(data, data.main_axis)
    parts = [f"the free module {free_reach(data)}", f"{len(data)} states"]
    if record.get("stated_error") is not None:
        parts.append(stated_error(record))
    text = "; ".join(parts) + "."
    return f"{design.name}: {text}" if named else capital(text)
