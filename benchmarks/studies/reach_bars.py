"""Targets of the study `reach_around`, figures of a printed arm, and the runs in lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import sin
from typing import Any

from benchmarks.output import Bar
from benchmarks.studies.page import clock, percent
from benchmarks.studies.shape_bars import worst_law

from pliant.config.study import Study
from pliant.pipeline.segments import segment_designs
from pliant_print.solids import PrintedSolid

BETTER, LAW, VOLUME, WALL = 0.2, 0.03, 5e-3, 1e-2
NAMES = ("cmaes", "optuna")


def printed_figures(made: PrintedSolid, arm: Study) -> dict[str, Any]:
    """Return the figures of an arm's solid; `stated_wall_m` is the thinnest that the families' parameters state."""
    families = [one.family for one in segment_designs(arm) if one is not None and one.family is not None]
    stated = min(stated_wall_m(one) for one in families)
    measured = min(wall.thickness_m for wall in made.module_walls.values())
    return {
        "watertight": all(body.check.open_edges == 0 for body in made.bodies),
        "crossings": sum(body.check.crossings for body in made.bodies),
        "triangles": sum(body.check.triangles for body in made.bodies),
        "volume_error": made.volume_error,
        "mass_kg": sum(body.mass_kg or 0.0 for body in made.bodies),
        "thinnest_wall_m": measured,
        "stated_wall_m": stated,
        "wall_error": measured / stated - 1,
        "whole_wall_m": made.thinnest.thickness_m,
        "notes": list(made.notes),
    }


def stated_wall_m(family: Any) -> float:
    """Return the thinnest wall of three chambers: the wall, or a rib, which is a sector, at the bore's wall."""
    inner = family.bore_m + family.wall_m
    rib: float = 2 * inner * sin(family.rib_m / (family.radius_m + family.bore_m))
    return min(float(family.wall_m), rib)


def gain(result: Mapping[str, Any], name: str) -> float | None:
    """Return by which share a winner's objective is below that of the hand-made arm with searched pressures."""
    run, base = result["runs"].get(name), result["baseline"]
    if not run or not base:
        return None
    return float(1 - run["reached_objective"] / base["reached_objective"])


def bars(result: Mapping[str, Any]) -> list[Bar]:
    """Return the bars of both searches; missing ones are not run."""
    found = []
    for name in NAMES:
        run = result["runs"].get(name)
        solid = (run or {}).get("printed") or {}
        what = f"{name}: objective below that of the hand-made arm, pressures of both searched, by direct FEM"
        found.append(Bar(what, gain(result, name), BETTER, "%", at_most=False, scale=100))
        what = f"{name}: a law of the search against direct FEM of the winner, at worst of all states"
        found.append(Bar(what, worst_law(run), LAW, "% of its range", scale=100))
        open_edges = None if not solid else float(not solid["watertight"] or solid["crossings"] > 0)
        found.append(
            Bar(f"{name}: bodies of the 3MF file that are open or cross themselves", open_edges, 0, "")
        )
        for key, words, limit in (
            ("volume_error", "modules' volume against the FEM's", VOLUME),
            ("wall_error", "thinnest wall against the parameters'", WALL),
        ):
            value = abs(solid[key]) if solid else None
            found.append(Bar(f"{name}: {words}", value, limit, "%", scale=100))
    return found


def lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines to print: the hand-made arm, every run, the bars."""
    if result["baseline"]:
        base = result["baseline"]
        yield (
            f"hand-made  objective {base['reached_objective']:.4g}; with the pressures of inverse statics "
            f"{base['statics']['reached_objective']:.4g}"
        )
    for name, run in result["runs"].items():
        below = percent(gain(result, name))
        yield (
            f"{name:<10} {run['evaluations']} candidates in {clock(run['wall_s'])}: objective {run['objective']:.4g}, "
            f"{run['reached_objective']:.4g} where it ends, {below} below the hand-made arm"
        )
        for note in (run["verified"] or {}).get("notes", ()):
            yield f"{'':<10} note: {note}"
    for one in result["bars"]:
        yield str(Bar.from_result(one))
