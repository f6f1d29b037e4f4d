"""FEM data sets as a document: of the designs of one study, for terminal, page and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.formatting import actuation_unit, deformation_unit, fixed, percent, plural, units_footer
from pliant.pipeline.answer_checks import answer_doubts
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import PASSED, SELF_CONTACT, TOUCHING, TRUSTED, FemDataset, ModuleData
from pliant.report.document import Document, Warned, answers, capital
from pliant.report.fem_page import DesignStates, axis_record, failed_place, fem_drawn, solved_rows
from pliant.report.provenance import duration, made_by, stage_json
from pliant.report.stage import StoredPage
from pliant.store.store import Artifact

PAGE = "fem.html"  # the name leaves report.html in the same folder to `pliant run`
LISTED = 12  # entries that a warning lists
SENTENCES = 3  # number of designs in the page's first sentence
TOLD_OF_AXIS = ("error", "stated_error", "reached", "check_error", "symmetric")


def fem_document(study: Study, artifacts: Sequence[Artifact], tables: Sequence[str]) -> Document:
    """Return the document of `pliant fem`.

    Args:
        study: the study.
        artifacts: the data sets, one for each design.
        tables: their files, in the same order.
    """
    written = study.canonical()
    kind = str((written.get("fem") or {}).get("kind", ""))
    names = [study.name] if len(artifacts) == 1 else [f"design {n + 1}" for n in range(len(artifacts))]
    designs = [DesignStates(name, a.value, kind) for name, a in zip(names, artifacts, strict=True)]
    several = len(designs) > 1
    manifests = [a.manifest for a in artifacts]

    limits = tuple(w for d in designs for w in data_warnings(d.data, f"{d.name}: " if several else ""))
    return Document(
        kind="Pliant FEM data",
        title=study.name,
        sentence=" ".join(_sentence(d, several) for d in designs[:SENTENCES]),
        data={**fem_json(artifacts, tables), "material": _material(study)},
        answers=answers(
            good=capital(stated_error(axis_record(designs[0].data, designs[0].data.main_axis))),
            missing=limits[0].sentence if limits else "",
            after="Fit the joint law and see its errors on states left out: pliant fit.",
        ),
        brief=(*fem_lines(artifacts), f"table    {', '.join(tables)}"),
        warnings=limits,
        draw=lambda: fem_drawn(written, designs, manifests),
        footer=units_footer(pressures="Pa", forces="N", moments="N*m", angles="rad", extensions="m"),
        page=PAGE,
        version=made_by(manifests),
    )


def stored_fem_page(context: RunContext, study: Study, artifacts: Sequence[Artifact]) -> StoredPage:
    """Return the page of a data set with the data that it depends on."""
    manifests = [a.manifest for a in artifacts]
    return StoredPage(context, manifests, [], "pliant.report.fem_page", {"study": study.canonical()})


def fem_json(artifacts: Sequence[Artifact], tables: Sequence[str]) -> dict[str, Any]:
    """Return the `fem` result of docs/command_line.md."""
    data: list[ModuleData] = [a.value for a in artifacts]
    return {
        "n_states": sum(len(d) for d in data),
        "failed": [dict(f) for d in data for f in d.failed],
        "self_contact": sum(int(np.sum(d.status == SELF_CONTACT)) for d in data),
        "passed_through": sum(int(np.sum(d.status == PASSED)) for d in data),
        "touching": sum(int(np.sum(d.status == TOUCHING)) for d in data),
        "wall_s": sum(a.manifest["wall_s"] for a in artifacts),
        "newton_steps": sum(int(d.iterations.sum()) for d in data),
        "axes": _axis_summaries(data[0]) if len(data) == 1 else [_axis_summaries(d) for d in data],
        "checks": _checks(data[0]) if len(data) == 1 else [_checks(d) for d in data],
        "csv": tables[0] if len(tables) == 1 else list(tables),
        "stages": [stage_json(a) for a in artifacts],
    }


def _checks(data: ModuleData) -> dict[str, Any]:
    """Return the figures of the checks on the answer, and what is doubtful about them."""
    figures = data.sampling.get("checks")
    figures = dict(figures) if isinstance(figures, Mapping) else {}
    return {**figures, "doubts": list(answer_doubts(figures))}


def _material(study: Study) -> dict[str, Any]:
    """Return the material's kind, Poisson's ratio and whether the study states it: a default is no measurement."""
    config = study.material
    ratio = getattr(config, "poisson_ratio", None)
    stated = config is not None and "poisson_ratio" in config.model_fields_set
    return {"kind": config.kind if config else None, "poisson_ratio": ratio, "poisson_ratio_stated": stated}


def _axis_summaries(data: ModuleData) -> dict[str, dict[str, Any]]:
    """Return by axis the number of states and the error of its law that adaptive sampling states."""
    return {
        axis: {
            "n_states": int(np.sum(data.explored == axis)),
            **{key: record[key] for key in TOLD_OF_AXIS if key in (record := axis_record(data, axis))},
        }
        for axis in data.explored_axes()
    }


def fem_lines(artifacts: Sequence[Artifact]) -> list[str]:
    """Return states, axes and cost of each data set, for the terminal."""
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
    """Return the states of each axis, and the error that adaptive sampling states; empty for one axis on a grid."""
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
    """Return the stated error of an axis and whether it meets the tolerance; empty if no error was stated."""
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
    """Return time and Newton steps of a state; copies by symmetry need none."""
    solved = solved_rows(data)
    if not solved.any():
        return ""
    wall, steps = data.wall_s[solved], data.iterations[solved]
    return (
        f"{wall.mean():.2g} s and {steps.mean():.2g} Newton steps for a state, {wall.max():.2g} s and "
        f"{int(steps.max())} at most"
    )


def _sentence(design: DesignStates, named: bool) -> str:
    """Return free deformation, number of states, and whether the stated error meets the tolerance."""
    data = design.data
    record = axis_record(data, data.main_axis)
    parts = [f"the free module {free_reach(data)}", f"{len(data)} states"]
    if record.get("stated_error") is not None:
        parts.append(stated_error(record))
    text = "; ".join(parts) + "."
    return f"{design.name}: {text}" if named else capital(text)


def free_reach(data: ModuleData) -> str:
    """Return the range of the free branch, e.g. ``bends 23.1° at 15 kPa``; empty without one."""
    if len(data.actuations) > 1:
        turned = np.abs(data.deformation[data.branch == "free"]).max()
        return f"bends {deformation_unit(data).text(float(turned), 3)} at most under these inputs alone"
    main = data.axis(data.main_axis)
    free = main.branch == "free"
    if not free.any():
        return ""
    last = int(np.argmax(np.where(free, main.actuation, -np.inf)))
    unit, given = deformation_unit(data), actuation_unit(data.actuation_name)
    verb = "extends by" if data.joint == "prismatic" else "bends"
    u = fixed(float(main.angle_rad[last]) * unit.factor, 2)
    return f"{verb} {unit.attached(u)} at {given.text(float(main.actuation[last]))}"


def data_warnings(data: FemDataset | ModuleData, prefix: str = "") -> list[Warned]:
    """Return the limits of a data set: self-contact, untrusted states, states that failed."""
    found = []
    if contact := int(np.sum(data.status == SELF_CONTACT)):
        tendon = data.actuation_name == "tendon_force_n"
        touching = "links that would meet" if tendon else "touching walls"
        found.append(
            f"{contact} of {len(data)} states have {touching}, and this solver has no contact: the law's domain ends "
            "where they meet, and beyond it these states are too soft."
        )
    if passed := int(np.sum(data.status == PASSED)):
        found.append(
            f"In {passed} of {len(data)} states walls pass through each other, as 'fem.self_contact: pass' "
            "lets them: a real module is stiffer there."
        )
    if met := int(np.sum(data.status == TOUCHING)):
        found.append(
            f"In {met} of {len(data)} states walls touch and hold each other, without friction: the law bends "
            "where they meet, which 'surrogate: {kind: table}' follows better than a polynomial."
        )
    other = ~np.isin(data.status, (*TRUSTED, SELF_CONTACT))
    if other.any():
        names = ", ".join(sorted(set(data.status[other].tolist())))
        found.append(f"{int(other.sum())} states are not trusted ({names}).")
    if isinstance(data, ModuleData) and isinstance(figures := data.sampling.get("checks"), Mapping):
        found += answer_doubts(figures)
    warned = [Warned(prefix + text) for text in found]
    if count := len(data.failed):
        items = tuple(
            f"{', '.join(failed_place(entry, data))}: {entry.get('cause', 'no cause recorded')}"
            for entry in data.failed[:LISTED]
        )
        warned.append(Warned(f"{prefix}{plural(count, 'state')} failed{truncation_note(count)}.", items))
    return warned


def truncation_note(count: int) -> str:
    """Return the end of a sentence with a truncated list."""
    return f" (the first {LISTED} are listed)" if count > LISTED else ""
