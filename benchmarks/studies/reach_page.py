"""The tables and the picture of docs/studies/reach_around.md, from the study's JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from benchmarks.pages import Result, Tables, table
from benchmarks.studies import page
from benchmarks.studies.page import Pictures, clock, millimetres, percent
from benchmarks.studies.reach_bars import gain

from pliant.report.chart_colours import INK, SERIES, SOFT
from pliant.report.figures import style

WIDE_PX, TALL_PX = 1560, 640
VIEWS = ((0, 2), (0, 1))
HAND = "hand-made"


def runs(result: Result) -> Iterator[str]:
    """Return a table of the hand-made arm and of the winners, by laws of direct FEM."""
    rows = []
    base = result["baseline"]
    if base:
        rows.append((f"{HAND}, pressures of inverse statics", "", "", *_reached(base["statics"]), "", ""))
        rows.append((
            f"{HAND}, pressures searched", str(base["evaluations"]), clock(base["wall_s"]), *_reached(base),
            f"{base['objective']:.3g}", "",
        ))  # fmt: skip
    for name, run in result["runs"].items():
        rows.append((
            f"`{name}`: {run['words']}", str(run["evaluations"]), clock(run["wall_s"]), *_reached(run),
            f"{run['objective']:.3g}", percent(gain(result, name), 3),
        ))  # fmt: skip
    return table(
        "arm | candidates | wall time | objective | distance | direction | least clearance | objective, predicted | "
        "below the hand-made arm",
        rows,
    )


def _reached(part: Mapping[str, Any]) -> tuple[str, ...]:
    metrics = part["reached"]
    return (
        f"{part['reached_objective']:.3g}",
        millimetres(metrics["distance_m"]),
        f"{np.degrees(metrics['angle_rad']):.2g}°",
        millimetres(metrics["least_clearance_m"]),
    )


def engines(result: Result) -> Iterator[str]:
    """Return a table of the winners in every engine, with laws of direct FEM."""
    rows = []
    for name, run in result["runs"].items():
        check = run["verified"] or {}
        for kind, metrics in check.get("engines", {}).items():
            shown = [millimetres(metrics.get(key), 3) for key in ("distance_m", "least_clearance_m")]
            rows.append((f"`{name}`", kind, shown[0], f"{np.degrees(metrics['angle_rad']):.3g}°", shown[1]))
    return table("arm | engine | distance | direction | least clearance of the whole motion", rows)


def laws(result: Result) -> Iterator[str]:
    """Return a table of the errors of the searches' laws against direct FEM of the winners."""
    keys = ("rmse_of_range", "worst_of_range")
    return table("search | design | FEM states | RMS, of the range | at worst", page.laws(result, keys))


def solids(result: Result) -> Iterator[str]:
    """Return a table of the 3MF files."""
    rows = []
    for name, run in result["runs"].items():
        made = run.get("printed") or {}
        if made:
            closed = "yes" if made["watertight"] and not made["crossings"] else "**no**"
            wall, stated = (millimetres(made[key], 3) for key in ("thinnest_wall_m", "stated_wall_m"))
            errors = [f"{100 * made[key]:+.2f} %" for key in ("volume_error", "wall_error")]
            mass = f"{1e3 * made['mass_kg']:.1f} g"
            rows.append(
                (f"`{name}`", closed, str(made["triangles"]), mass, errors[0], wall, stated, errors[1])
            )
    return table(
        "arm | closed, no crossings | triangles | mass | volume against FEM | thinnest wall | the parameters' | error",
        rows,
    )


def best(result: Result) -> Iterator[str]:
    """Return the values of the winners, one column per search, and the pressures of the hand-made arm."""
    found = result["runs"]
    units = {name: unit for run in found.values() for name, unit in run["units"].items()}
    columns = {f"`{name}`": run["best"]["values"] for name, run in found.items()}
    if result["baseline"]:
        columns[HAND] = result["baseline"]["best"]["values"]
    return page.values(columns, units)


def arms(result: Result) -> bytes | None:
    """Draw the arms where they end, with post and shelf, from the side and from above."""
    if not result["runs"]:
        return None
    drawn = {**({HAND: result["baseline"]} if result["baseline"] else {}), **result["runs"]}
    with style.canvas(WIDE_PX, TALL_PX) as figure:
        panels = figure.subplots(1, len(VIEWS), squeeze=False)[0]
        for axes, (across, up) in zip(panels, VIEWS, strict=True):
            _scene(axes, result["scene"], across, up)
            for (name, part), colour in zip(drawn.items(), (INK, *SERIES), strict=False):
                line = 1e3 * np.array(part["markers_m"], float)
                axes.plot(line[:, across], line[:, up], "o-", ms=3.5, lw=2, color=colour, label=name)
            axes.set_aspect("equal", adjustable="datalim")
            axes.set_xlabel(f"{'xyz'[across]} (mm)")
            axes.set_ylabel(f"{'xyz'[up]} (mm)")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
        figure.set_layout_engine("constrained", w_pad=0.07, h_pad=0.07)
        return style.small_png(figure).tobytes()


def _scene(axes: Any, scene: Mapping[str, Any], across: int, up: int) -> None:
    for box in scene["boxes"]:
        edges, centre = 1e3 * np.array(box["edges_m"]), 1e3 * np.array(box["centre_m"])
        low = centre - edges / 2
        y = [low[up], low[up] + edges[up]]
        axes.fill_between([low[across], low[across] + edges[across]], y[0], y[1], color=SOFT, lw=0)
    tip, way = 1e3 * np.array(scene["tip_m"]), np.array(scene["direction"], float)
    way = 15 * way / np.linalg.norm(way)
    axes.plot(tip[across], tip[up], "x", ms=9, mew=2, color=INK, label="target")
    axes.annotate(
        "",
        (tip[across] + way[across], tip[up] + way[up]),
        (tip[across], tip[up]),
        arrowprops={"arrowstyle": "->"},
    )


PICTURES: Pictures = {"arms": arms}
WORDS = {"arms": "The arms where they end, from the side and from above; target, post and shelf"}
TABLES: Tables = {
    **{one.__name__: one for one in (page.state, page.reached, runs, engines, laws, solids, best)},
    **page.shown_pictures("reach_around", PICTURES, WORDS),
}
