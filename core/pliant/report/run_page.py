"""The page of a run: the finger, its FEM, its laws, its poses in the engines, and how sure the tip is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pliant.formatting import fixed, number, small_length, unit_of
from pliant.report.document import Cells, Drawn, Picture, Section, Table, capital, numbered
from pliant.report.fem_page import data_sections, shape_section
from pliant.report.fem_view import Solved
from pliant.report.figures.backbones import backbone_picture
from pliant.report.figures.backbones import caption as backbone_caption
from pliant.report.figures.chain_pose import chain_pose
from pliant.report.figures.finger import finger_bodies, finger_picture
from pliant.report.figures.law import law_picture
from pliant.report.figures.stills import still_pictures
from pliant.report.figures.tip_cloud import COORDINATES, tip_cloud
from pliant.report.fit_tables import axes_table
from pliant.report.folder import FinishedRun
from pliant.report.provenance import closing_sections
from pliant.report.run_tables import coefficients, engine_table, law_table, metrics_table, time_tables
from pliant.report.run_view import gravity_words, ran, spread_sentence

TIP = ("tip_x_m", "tip_y_m", "tip_z_m")
TITLE = "From the laws' error bars to the tip"
RESIDUALS = "What the law misses of these states stands in the next section but one, beside the law."


def run_drawn(run: FinishedRun) -> Drawn:
    """Body, law and poses on top; then meshes, states, law, engines, uncertainty, cost. Same run, same bytes."""
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
        *([Section("Times", tables=tuple(times))] if (times := time_tables(run)) else []),
        *closing_sections(run.study, run.provenance),
    ]
    return Drawn(hero, tuple(section for section in parts if section is not None))


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
    return capital("; ".join(parts)) + "."


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
    tables = [law_table(run)]
    for design in run.designs:
        if design.module is not None and set(design.law.axes) == set(design.module.axes):
            table = axes_table(design.module, design.law)
            name = f"{design.name}: " if len(run.designs) > 1 else ""
            tables.append(replace(table, title=name + table.title) if table is not None else None)
    stated = [d for d in run.designs if d.fit is None]
    note = f"Stated law: {coefficients(stated[0])}" if stated else ""
    return Section(
        "The joint law τ(p, u)", pictures, tuple(table for table in tables if table is not None), note
    )


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


def uncertainty_section(run: FinishedRun) -> Section | None:
    """The cloud of tips, and intervals of what the task measures; None where the study asks for none."""
    spread, engines = run.uncertainty, ran(run)
    if spread is None or not engines:
        return None
    first = engines[0]
    text = spread_sentence(spread, first.kind)
    if "tip_mean_m" not in spread:
        return Section(TITLE, text=(text,))
    text += (
        " Modules of one design share one draw. What the laws leave out (friction, tolerances, the chain itself) is "
        "not in it."
    )
    picture = tip_cloud(spread, first.markers_m[-1])
    caption = (
        "Left: tips of the drawn laws, from the tip of the laws themselves, in the two coordinates that vary most. "
        "Right: share of the runs within a distance of their mean."
    )
    pictures = (Picture("tip_cloud", caption, picture),) if picture is not None else ()
    return Section(TITLE, pictures, (_spread_table(spread, run),), text=(text,))


def _spread_table(spread: Mapping[str, Any], run: FinishedRun) -> Table:
    first = ran(run)[0]
    rows: list[Cells] = []
    for k, name in enumerate(COORDINATES):
        ends = [spread["tip_low_m"][k], first.markers_m[-1][k], spread["tip_high_m"][k]]
        half = (ends[2] - ends[0]) / 2
        rows.append([f"tip {name} (mm)", *(fixed(1e3 * float(v), 4) for v in ends), small_length(half)])
    for name, interval in spread.get("metrics", {}).items():
        if name in TIP or not interval["high"] > interval["low"]:
            continue
        unit = unit_of(name)
        own = first.result.metrics.get(name)
        factor = unit.factor
        cells = [interval["low"], own, interval["high"]]
        texts = [number(float(v) * factor, 5) if isinstance(v, int | float) else "–" for v in cells]
        half = number((interval["high"] - interval["low"]) / 2 * factor, 2)
        rows.append([unit.axis, *texts, half])
    level = f"{100 * float(spread['level']):g} %"
    head = ["", f"{level} from", "the laws themselves", "to", "half-width"]
    return Table("Intervals", head, rows)
