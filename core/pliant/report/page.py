"""A finished run as one self-contained HTML page: no script, no network, pictures inside."""

from __future__ import annotations

from collections.abc import Mapping

from pliant import __version__
from pliant.report.document import Page, Picture, Section
from pliant.report.facts import (
    coefficients,
    engine_table,
    input_table,
    law_table,
    metrics_table,
    provenance_table,
    time_tables,
)
from pliant.report.fem_law import law_by_axis
from pliant.report.fem_section import Solved, data_sections, numbered, shape_section
from pliant.report.figures.backbones import backbone_picture
from pliant.report.figures.backbones import caption as backbone_caption
from pliant.report.figures.chain_pose import chain_pose
from pliant.report.figures.finger import finger_bodies, finger_picture
from pliant.report.figures.law import law_picture
from pliant.report.figures.stills import still_pictures
from pliant.report.folder import FinishedRun
from pliant.report.reading import ran
from pliant.report.template import page_template
from pliant.report.uncertainty_section import uncertainty_section, uncertainty_warnings
from pliant.report.words import gravity_words, result_sentence, warnings

RESIDUALS = "What the law misses of these states stands in the next section but one, beside the law."


def render(run: FinishedRun) -> Page:
    """Draw and write the report. The same run gives the same bytes."""
    states, how, cost = _fem(run)
    hero = Picture("finger", _hero_caption(run), finger_picture(run))
    parts = [
        _meshes(run),
        states,
        how,
        _laws(run),
        _poses(run),
        uncertainty_section(run),
        cost,
        *_tables(run),
    ]
    sections = [s for s in parts if s is not None]
    text = page_template().render(
        title=str(run.study.get("name", "Pliant run")),
        sentence=result_sentence(run),
        hero=hero,
        warnings=[*warnings(run), *uncertainty_warnings(run)],
        sections=sections,
        version=run.provenance[0].get("pliant", __version__) if run.provenance else __version__,
    )
    pictures = {p.name: p.png for p in (hero, *(p for s in sections for p in s.pictures))}
    return Page(text, pictures)


def _hero_caption(run: FinishedRun) -> str:
    parts = []
    if finger_bodies(run) is not None:
        parts.append(
            "FEM shape of one module at this pressure, bent to each joint's angle and stacked; ghosts show the rest "
            "state and levels on the way, colour the stretch of the skin"
        )
    parts.append("the joint law with the states behind it")
    if ran(run):
        scene = ran(run)[0].result.stills
        parts.append("the scene at the end" if scene else f"the chain's pose {gravity_words(run)}")
    text = "; ".join(parts)
    return text[0].upper() + text[1:] + "."


def _meshes(run: FinishedRun) -> Section | None:
    return shape_section([(d.name, d.fem) for d in run.designs if d.fem is not None])


def _fem(run: FinishedRun) -> list[Section | None]:
    """The FEM data, how its states were chosen and what they cost; nothing for laws that no FEM was made for."""
    block = run.study.get("fem") or {}
    backend = str(block.get("kind", "")) if isinstance(block, Mapping) else ""
    solved = [Solved(d.name, d.module, backend) for d in run.designs if d.module is not None]
    return [*data_sections(solved, RESIDUALS)] or [None, None, None]


def _laws(run: FinishedRun) -> Section:
    pictures = tuple(
        Picture(numbered("law", n), _law_caption(run, n), law_picture(run, d))
        for n, d in enumerate(run.designs)
    )
    several = len(run.designs) > 1
    by_axis = [
        law_by_axis(d.module, d.law, f"{d.name}: " if several else "")
        for d in run.designs
        if d.module is not None
    ]
    tables = tuple(table for table in (law_table(run), *by_axis) if table is not None)
    stated = [d for d in run.designs if d.fit is None]
    note = f"Stated law: {coefficients(stated[0])}" if stated else ""
    return Section("The joint law τ(p, u)", pictures, tables, note)


def _law_caption(run: FinishedRun, number: int) -> str:
    design = run.designs[number]
    name = f"{design.name}: " if len(run.designs) > 1 else ""
    text = f"{name}τ is the external moment that opposes actuation; where it is zero the module is free."
    if len(design.law.axes) > 1:
        text += " The other axes are held at zero."
    if design.fem is not None:
        text += " Right: law minus state in percent of the effort's range, filled = fitted, open = left out."
    if design.law.error is not None:
        text += " Shaded, and as bars at the states left out: the band that holds a state with a probability of 90 %."
    return text


def _poses(run: FinishedRun) -> Section | None:
    if not ran(run):
        return None
    if ran(run)[0].result.stills:
        return _stills(run)
    caption = "Markers are base, joints and tip, at equal scales; faint lines are levels of the actuation."
    tables = [t for t in (engine_table(run), metrics_table(run)) if t is not None]
    first = ran(run)[0].result
    curves = backbone_picture(first)
    measured = [Picture("backbones", backbone_caption(first), curves)] if curves is not None else []
    pictures = (Picture("chain_pose", caption, chain_pose(run)), *measured)
    return Section("The finger in the engines", pictures, tuple(tables))


def _stills(run: FinishedRun) -> Section:
    """A task with contact: outlines of its scene, and its metrics."""
    pictures = tuple(
        Picture(
            numbered("stills", number),
            f"{engine.kind}: outlines of what collides, from the side and from above; the first trial.",
            still_pictures(engine.result.stills),
        )
        for number, engine in enumerate(ran(run))
    )
    table = metrics_table(run)
    notes = dict.fromkeys(str(e.result.metrics["note"]) for e in ran(run) if "note" in e.result.metrics)
    return Section("The scene in the engines", pictures, (table,) if table else (), " ".join(notes))


def _tables(run: FinishedRun) -> list[Section]:
    found = []
    if times := time_tables(run):
        found.append(Section("Times", tables=tuple(times)))
    found.append(Section("Inputs", tables=(input_table(run),)))
    if run.provenance:
        found.append(Section("Provenance", tables=(provenance_table(run),)))
    return found
