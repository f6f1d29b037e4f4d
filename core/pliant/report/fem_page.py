"""The page of FEM data: module, states, sampling and cost, their tables and charts; also part of a run's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import (
    Unit,
    actuation_unit,
    deformation_unit,
    effort_unit,
    number,
    percent,
    seconds,
    slides,
)
from pliant.records.actuation import split_actuation_names
from pliant.records.fem import PASSED, TOUCHING, TRUSTED, FemDataset, ModuleData
from pliant.records.law import JointLaw
from pliant.report.chart import Chart, ChartAxis, ChartBars, ChartLine, ChartNote, ChartRule, Mark, Panel
from pliant.report.chart_colours import FAINT, PAPER, SERIES, SOFT, WARN, ColourScale
from pliant.report.document import (
    Cells,
    Drawn,
    Picture,
    Section,
    Table,
    drawn,
    named_values,
    numbered,
    optional_table,
    section,
)
from pliant.report.law_charts import (
    ZERO,
    Groups,
    actuation_axis,
    actuation_scale,
    coordinate_axis,
    plain_coordinate,
    state_lines,
)
from pliant.report.provenance import Manifests, closing_sections

SHOWN = 6  # designs whose pictures are drawn
IMAGES = {0: "the whole is solved", 1: "half is solved", 2: "a quarter is solved", 3: "an eighth is solved"}
ROUNDED = 9  # decimals of a coordinate in rad or m above rounding
FAILURES = 20  # failed states that are listed
STRATEGIES = {"adaptive": "one by one", "grid": "grid", "study": "published study's loads"}


@dataclass(frozen=True, eq=False)
class DesignStates:
    """The FEM data of a design, under its name; `backend` is the kind of the code that solved it."""

    name: str
    data: ModuleData
    backend: str = ""


def axis_record(data: ModuleData, axis: str) -> Mapping[str, Any]:
    """Return the sampler's record of an axis; empty without one."""
    axes = data.sampling.get("axes")
    found = axes.get(axis, {}) if isinstance(axes, Mapping) else {}
    return found if isinstance(found, Mapping) else {}


def foretold_axes(data: ModuleData) -> list[str]:
    """Return the axes whose states were chosen one by one."""
    return [name for name in data.explored_axes() if axis_record(data, name).get("tests")]


def solved_rows(data: ModuleData) -> NDArray[np.bool_]:
    """Return (n,) states that were solved; copies by symmetry took no time."""
    return np.asarray((data.wall_s > 0) | (data.iterations > 0))


def explored_kinds(data: ModuleData) -> list[str]:
    """Return the explored axes, the main one first, then "coupling" if several axes were prescribed together."""
    return [*data.explored_axes(), *(["coupling"] if np.any(data.explored == "coupling") else [])]


def fem_drawn(study: Mapping[str, Any], designs: Sequence[DesignStates], manifests: Manifests) -> Drawn:
    """Return a page with the states of the first design on top, then all of them."""
    shapes = shape_section([(d.name, d.data.axis(d.data.main_axis), None) for d in designs])
    if shapes is not None and any(len(d.data.actuations) > 1 for d in designs):
        # Pictures of states are over one actuation; the table has all.
        hero, *others = shapes.pictures
        return drawn(hero, replace(shapes, pictures=tuple(others)), *closing_sections(study, manifests))
    states, *rest = data_sections(designs)
    hero, *others = states.pictures
    states = replace(states, pictures=tuple(others))
    return drawn(hero, shapes, states, *rest, *closing_sections(study, manifests))


def shape_section(designs: Sequence[tuple[str, FemDataset, JointLaw | None]]) -> Section | None:
    """Return meshes at rest and deformed, and the stress, of designs whose data have shapes; None without any.

    `designs`: name, data, and fitted law of each.
    """
    # matplotlib takes a second to import
    from pliant.report.figures.module import can_show, has_stress, module_shape, module_stress, stress_caption
    from pliant.report.scenes.module import module_scene

    pictures = []
    for n, (name, data, law) in enumerate([d for d in designs if can_show(d[1])][:SHOWN]):
        links = " The rigid links beside the flexure are not drawn."
        mirrors = data.shapes[0].mirrors
        images = IMAGES[len(mirrors)] + ("; the rest are mirror images." if mirrors else ".")
        caption = f"{name}: the mesh at rest and on the free branch, orthographic, one scale; {images}"
        caption += links if data.actuation_name == "tendon_force_n" else ""
        pictures.append(
            Picture(numbered("module_shape", n), caption, module_shape(data), scene=module_scene(data, law))
        )
        if has_stress(data):
            caption = stress_caption(data)
            pictures.append(Picture(numbered("module_stress", n), caption, module_stress(data)))
    return section("One module, undeformed and deformed", *pictures, open=True)


def data_sections(designs: Sequence[DesignStates], remark: str = "") -> list[Section]:
    """Return states, sampling and cost of each design; empty without any. `remark` ends the section of the states."""
    if not designs:
        return []
    cut = f"Pictures of the first {SHOWN} of {len(designs)} designs. " if len(designs) > SHOWN else ""
    first = Section("The FEM data", note=(cut + remark).strip())
    made = [first, Section("How the states were chosen"), Section("What the FEM cost")]
    for n, one in enumerate(designs):
        data, name = one.data, f"{one.name}: " if len(designs) > 1 else ""
        word = "forces in N, extensions in mm" if data.joint == "prismatic" else "moments of one module"
        captions = {
            "fem_states": (
                f"{one.name}: every solved state; {word}. Thin lines join states of one actuation that are to be "
                "fitted."
            ),
            "fem_sampling": (
                f"{one.name}. Left: blue with number = states chosen where the law was least certain, grey = free "
                "branch and corners, open = check states, cross = self-contact. Right: each new state against what "
                "was foretold of it."
            ),
            "fem_cost": f"{name}Seconds as measured when it was solved.",
        }
        drawing = (
            states_chart,
            sampling_chart if foretold_axes(data) else None,
            cost_chart if solved_rows(data).any() else None,
        )
        tables = (
            (states_table(data), failed_table(data)),
            (sampling_table(data), coupling_table(data)),
            (cost_table(data, one.backend),),
        )
        for k, (key, draw) in enumerate(zip(captions, drawing, strict=True)):
            own = (Picture(numbered(key, n), captions[key], draw(data)),) if n < SHOWN and draw else ()
            named = tuple(replace(t, title=name + t.title) for t in tables[k] if t is not None)
            made[k] = replace(made[k], pictures=made[k].pictures + own, tables=made[k].tables + named)
    return made


def states_table(data: ModuleData) -> Table:
    """Return the number of states of each kind, and their ranges."""
    p_unit, u_unit, effort = actuation_unit(data.actuation_name), deformation_unit(data), effort_unit(data)
    rows: list[Cells] = []
    trusted, check = np.isin(data.status, TRUSTED), data.role == "check"
    for kind in explored_kinds(data):
        chosen = data.explored == kind
        if kind == "coupling":
            spans = ["all axes held", "–", "–"]
        else:
            k = data.axes.index(kind)
            u, tau = data.deformation[chosen, k], data.tau[chosen, k]
            spans = [kind, _span(u, u_unit), _span(tau, effort)]
        groups = (chosen & trusted & ~check, chosen & trusted & check, chosen & ~trusted)
        counts = [str(int(group.sum())) for group in groups]
        rows.append([spans[0], *counts, _span(data.actuation[chosen], p_unit), *spans[1:]])
    head = ["axis", "to fit", "check", "self-contact", "actuation", "u", "effort τ"]
    copies = int(np.sum(~solved_rows(data)))
    note = "States in self-contact are marked: contact between the overlapping walls is not modelled there."
    if touching := int(np.sum(data.status == TOUCHING)):
        note += f" In {touching} states walls touch and hold each other, without friction."
    if passed := int(np.sum(data.status == PASSED)):
        note += f" In {passed} states walls pass through each other, as 'fem.self_contact: pass' lets them."
    if copies > 1:  # the rest state may cost nothing either
        note += (
            f" {copies} states are copies: mirror images at −u, and free states that belong to several axes."
        )
    return Table("States", head, rows, note)


def sampling_table(data: ModuleData) -> Table:
    """Return the sampling of the states of each axis and the remaining error."""
    rows: list[Cells] = []
    kind = str(data.sampling.get("kind", ""))
    for axis in data.explored_axes():
        record = axis_record(data, axis)
        tests = record.get("tests") or []
        last = [percent(float(t["miss"])) for t in tests[-2:]]
        one_by_one = "stated_error" in record
        rows.append(
            [
                axis,
                STRATEGIES["adaptive"] if one_by_one else STRATEGIES.get(kind, kind or "–"),
                percent(float(record["error"])) if one_by_one else "–",
                _share(record.get("stated_error")),
                ", ".join(last) or "–",
                ("yes" if record.get("reached") else "NO") if one_by_one else "–",
                _share(record.get("check_error")),
                _sides(record),
            ]
        )
    head = ["axis", "states chosen", "wanted", "stated error", "last misses", "reached", "at check states"]
    note = (
        "Errors are shares of the effort's range in the data. Stated error: twice the largest deviation of a Gaussian "
        "process of all states and slopes, widened by its own misses. Reached: stated error and the last two misses "
        "are below the wanted one."
        if any("stated_error" in axis_record(data, axis) for axis in data.explored_axes())
        else "States at fixed places: no error is stated; see the law's errors on the check states."
    )
    return Table("How the states were chosen", [*head, "±u alike"], rows, note, numeric=2)


def coupling_table(data: ModuleData) -> Table | None:
    """Return how strongly the axes depend on each other; None for one axis."""
    found = data.sampling.get("coupling")
    if not isinstance(found, Mapping) or "largest" not in found:
        return None
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    first, second = (str(name) for name in found["between"])
    u = ", ".join(
        f"{axis} {u_unit.text(round(float(value), ROUNDED), 3)}"
        for axis, value in zip(data.axes, found["deformation"], strict=True)
    )
    differ = found.get("pieces_differ")
    values = {
        "largest off-diagonal slope": f"{number(float(found['largest']), 3)} between {first} and {second}",
        "found at": f"{p_unit.text(float(found['actuation']))}; {u}",
        "asymmetry of ∂τ/∂u": _tiny(float(found["largest_asymmetry"])),
        "free angle, piece of one axis against the whole": "–" if differ is None else _tiny(float(differ)),
        "states of the whole module": str(found["n_states"]),
    }
    note = (
        "Off-diagonal slopes ∂τᵢ/∂uⱼ by √(∂τᵢ/∂uᵢ ∂τⱼ/∂uⱼ): 0 for uncoupled axes. An energy makes the slopes "
        "symmetric, so that their asymmetry is the solver's error."
    )
    return named_values("Coupling of the axes", values, note)


def cost_table(data: ModuleData, backend: str) -> Table:
    """Return the size of the mesh, Newton steps and seconds of the states."""
    rows = solved_rows(data)
    wall, steps = data.wall_s[rows], data.iterations[rows]
    pieces = data.sampling.get("pieces")
    labels = {"main": "mesh", "full": "mesh of the whole module"}
    meshes = {
        labels.get(
            str(name), str(name)
        ): f"{size['n_cells']} elements of {size.get('cell_nodes', 27)} nodes, {size['n_nodes']} nodes"
        for name, size in (pieces if isinstance(pieces, Mapping) else {}).items()
    }
    values = {
        "FEM code": backend or "–",
        **meshes,
        "states solved": str(int(rows.sum())),
        "time of all states": seconds(float(wall.sum())),
        "time of a state": _mean_and_largest(wall.tolist(), seconds),
        "Newton steps of a state": _mean_and_largest(steps.tolist(), lambda s: number(float(s), 3)),
        "Newton steps in all": str(int(steps.sum())),
    }
    return named_values("Cost", values)


def failed_place(entry: Mapping[str, object], data: ModuleData | FemDataset) -> tuple[str, str]:
    """Return where a state failed: its actuation, and its prescribed coordinates."""
    value, angle = entry.get("actuation"), entry.get("angle_rad")
    actuation = actuation_unit(split_actuation_names(data.actuation_name)[0])
    where = actuation.text(float(value)) if isinstance(value, int | float) else "unknown actuation"
    if isinstance(value, list | tuple):
        where = ", ".join(actuation.text(float(one)) for one in value)
    u_unit, effort = deformation_unit(data), effort_unit(data)
    held, load = entry.get("held"), entry.get("effort")
    if isinstance(load, Mapping) and load:
        return where, ", ".join(f"τ {axis} {effort.text(float(v), 3)}" for axis, v in load.items())
    if isinstance(held, Mapping) and held:
        return where, ", ".join(f"{axis} {u_unit.text(float(v), 3)}" for axis, v in held.items())
    return where, u_unit.text(float(angle), 3) if isinstance(angle, int | float) else "free"


def failed_table(data: ModuleData) -> Table | None:
    """Return the states that were not reached, with their causes."""
    shown, more = data.failed[:FAILURES], len(data.failed) - FAILURES
    rows = [[*failed_place(entry, data), str(entry.get("cause", "–"))] for entry in shown]
    note = f"{more} more in the JSON result." if more > 0 else ""
    return optional_table("Failed states", ["actuation", "held", "cause"], rows, note, numeric=9)


def _span(values: NDArray[np.float64], unit: Unit) -> str:
    low, high = (number(float(v) * unit.factor, 4) for v in (values.min(), values.max()))
    return unit.attached(f"{low} to {high}")


def _share(value: Any) -> str:
    return "–" if value is None else percent(float(value))


def _tiny(value: float) -> str:
    return number(value, 2) if value else "0"


def _sides(record: Mapping[str, Any]) -> str:
    if "symmetric" not in record:
        return "–"
    apart = record.get("difference_of_sides")
    word = "yes" if record["symmetric"] else "no"
    return word if apart is None else f"{word} ({_tiny(float(apart))})"


def _mean_and_largest(values: Sequence[float], text: Any) -> str:
    if not values:
        return "–"
    return f"{text(sum(values) / len(values))} on average, {text(max(values))} at most"


def states_chart(data: ModuleData) -> Chart:
    """Return the free branch, then τ over u of every explored axis, coloured by the actuation."""
    scale = actuation_scale(data, data.actuation)
    panels = [_free_panel(data, scale), *(_held_panel(data, name, scale) for name in data.explored_axes())]
    across = len(panels) if len(panels) < 4 else 2
    return Chart(tuple(panels), across=across, cell=(1620 // across, 560))


def _free_panel(data: ModuleData, scale: ColourScale) -> Panel:
    """Return u over the actuation, without external effort."""
    main = data.axis(data.main_axis)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    free = main.rows(main.branch == "free")
    order = np.argsort(free.actuation, kind="stable")
    p, u = free.actuation[order] * p_unit.factor, free.angle_rad[order] * u_unit.factor
    lines = [ChartLine("free branch", p, u, "", SOFT, 1.1)]
    for name, check, marker in (("fitted", False, "o"), ("left out", True, "D")):
        for k in np.flatnonzero((free.role[order] == "check") == check).tolist():
            run, colour = p_unit.text(float(free.actuation[order][k]), 3), scale.to_hex(p[k : k + 1])[0]
            lines.append(ChartLine(name, p[k : k + 1], u[k : k + 1], run, colour, 0.0, 5.0, marker, check))
    y_axis = plain_coordinate(data, u_unit.symbol, data.main_axis if len(data.axes) > 1 else "")
    title = "Free branch: nothing holds the module"
    return Panel(actuation_axis(data), y_axis, tuple(lines), title, scale=scale)


def _held_panel(data: ModuleData, name: str, scale: ColourScale) -> Panel:
    """Return τ over u of one axis, with lines between states of one actuation, and failed states at the bottom."""
    one, several = data.axis(name), len(data.axes) > 1
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data, name)
    effort = effort_unit(data, name)
    marks: list[Mark] = [ZERO, *state_lines(one, p_unit.text, scale, (u_unit.factor, effort.factor), 0.8)]
    lost = [f["angle_rad"] for f in one.failed if isinstance(f.get("angle_rad"), int | float)]
    if lost:
        x = np.array(lost, float) * u_unit.factor
        marks.append(
            ChartLine(f"failed ({len(lost)})", x, np.zeros(len(lost)), "", WARN, 0.0, 6.0, "^", rim=True)
        )
    y = ChartAxis(f"effort τ about {name}" if several else "effort τ", effort.symbol)
    follows = f"{data.main_axis} follows freely" if name != data.main_axis else "the others at zero"
    held = f"Held {'along' if slides(data, name) else 'about'} {name}; {follows}"
    title = held if several else "Held: the effort that opposes actuation"
    return Panel(coordinate_axis(data, name), y, tuple(marks), title, scale=scale)


SMALLEST_MISS = 1e-8  # a share of the range below which a miss is rounding


def sampling_chart(data: ModuleData) -> Chart:
    """Return for each axis the plane of u and actuation, and misses over the number of states."""
    panels = [
        panel for name in foretold_axes(data) for panel in (_plane_panel(data, name), _miss_panel(data, name))
    ]
    return Chart(tuple(panels), across=2, cell=(780, 580))


def _plane_panel(data: ModuleData, name: str) -> Panel:
    """Return the positions of the states; those chosen one by one have their number."""
    one, groups = data.axis(name), Groups.from_data(data.axis(name))
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data, name)
    x, y = one.angle_rad * u_unit.factor, one.actuation * p_unit.factor
    kinds = (
        ("free branch and corners", groups.fit, FAINT, "o", 4.5),
        ("check states", groups.check, SOFT, "D", 5.0),
        ("self-contact", groups.untrusted, WARN, "x", 5.5),
    )
    marks: list[Mark] = [
        ChartLine(label, x[rows], y[rows], "", colour, 0.0, size, marker, marker == "D")
        for label, rows, colour, marker, size in kinds
        if rows.any()
    ]
    tests = axis_record(data, name)["tests"]
    at = [np.array([test[key] for test in tests]) for key in ("deformation", "actuation")]
    at = [at[0] * u_unit.factor, at[1] * p_unit.factor]
    marks.append(ChartLine("chosen one by one", at[0], at[1], "", SERIES[0], 0.0, 11.0))
    marks += [
        ChartNote(str(k), x, y, "centre", PAPER)
        for k, (x, y) in enumerate(zip(at[0].tolist(), at[1].tolist(), strict=True), start=1)
    ]
    title = "Where the states lie, in the order of choice"
    return Panel(coordinate_axis(data, name), actuation_axis(data), tuple(marks), title)


def _miss_panel(data: ModuleData, name: str) -> Panel:
    """Return each new state against its prediction, and the stated error at the end."""
    record: Any = axis_record(data, name)
    tests, wanted = record["tests"], 100 * float(record["error"])
    numbers, last = np.arange(1.0, len(tests) + 1), np.array([len(tests) + 0.6])
    spread, misses = (100 * np.maximum([t[k] for t in tests], SMALLEST_MISS) for k in ("deviation", "miss"))
    deviation = "deviation of the process where it was largest"
    marks: list[Mark] = [
        ChartRule(wanted, SERIES[2], 1.4, text=f"wanted: {percent(wanted / 100)}"),
        ChartLine(deviation, numbers, spread, "", SOFT, 1.1, dashed=True),
        ChartLine("miss of the prediction", numbers, misses, "", SERIES[0], 1.0, 5.0),
    ]
    if (stated := record.get("stated_error")) is not None:
        label = f"stated at the end: {percent(float(stated))}"
        marks.append(ChartLine(label, last, np.array([100 * float(stated)]), "", SERIES[1], 0.0, 7.0, "s"))
    if (check := record.get("check_error")) is not None:
        label, y = f"largest error at check states: {percent(float(check))}", max(float(check), SMALLEST_MISS)
        marks.append(ChartLine(label, last, np.array([100 * y]), "", SERIES[3], 0.0, 7.0, "D", hollow=True))
    x = ChartAxis("state chosen, in order", ends=(0.4, len(tests) + 0.95))
    title = f"Misses of each new state{f', axis {name}' if len(data.axes) > 1 else ''}"
    return Panel(x, ChartAxis("miss", "% of the effort's range", log=True), tuple(marks), title)


def cost_chart(data: ModuleData) -> Chart:
    """Return bars of seconds above bars of Newton steps, coloured by the axis that each state explores."""
    rows = solved_rows(data)
    explored, place = data.explored[rows], np.arange(1.0, int(rows.sum()) + 1)
    colours = dict(zip(explored_kinds(data), SERIES, strict=False))
    words = {"coupling": "all axes held"}
    x = ChartAxis("state, in the order of solution")
    panels: list[Panel] = []
    for label, unit, values in (("time", "s", data.wall_s), ("Newton steps", "", data.iterations)):
        heights = np.asarray(values, float)[rows]
        marks: list[Mark] = []
        for kind in dict.fromkeys(explored.tolist()):
            at, top = place[explored == kind], heights[explored == kind]
            name, colour = words.get(kind, f"axis {kind}"), colours.get(kind, SOFT)
            marks.append(ChartBars(name, at, np.zeros(len(at)), top, "", colour, 0.8, upright=True))
        title = "" if panels else "Time and Newton steps of each state"
        panels.append(Panel(x, ChartAxis(label, unit), tuple(marks), title))
    return Chart(tuple(panels), column=2, cell=(1560, 520))
