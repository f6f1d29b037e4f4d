"""The tables and pictures of docs/studies/shape_matching.md, from the study's JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from benchmarks.pages import Result, Tables, table
from benchmarks.studies import page
from benchmarks.studies.page import Pictures, clock, millimetres, percent
from benchmarks.studies.published import SOURCE
from benchmarks.studies.shape_bars import METRICS, apart, engines, pair, verified_metric

from pliant.report.chart_colours import INK, SERIES, WARN
from pliant.report.figures import style

PLANES = ((0, 1), (0, 2), (2, 1))
TALL_PX, WIDE_PX = 430, 1560
NAMED = 5


def runs(result: Result) -> Iterator[str]:
    """Return a table of every search, with the published figures below."""
    rows = []
    for name, run in result["runs"].items():
        own, others = run["engine"], [e for e in engines(run) if e != run["engine"]]
        stored = " (searched before; kernel timed later)" if run["from_store"] else ""
        rows.append([
            f"`{name}`: {run['words']}", run["evaluations"], clock(run["wall_s"]),
            f"{run['wall_in_kernels']:.0f}{stored}", pair(run, own, "predicted"), pair(run, own, "engines"),
            "; ".join(f"{pair(run, e, 'engines')} ({e})" for e in others) or "–", millimetres(apart(run)),
            f"{_outside(run, 'predicted')} / {_outside(run, 'engines')}",
        ])  # fmt: skip
    given = result["published"]
    times, rmse_m = given["our_estimates"], given["verified"]["rmse_m"] - given["rmse_m"]
    rows.append([
        f"published ({SOURCE}), roll fixed", "",
        f"about {clock(times['evaluations_wall_s'])}; of generations {clock(times['generations_wall_s'])}: "
        "estimates of ours",
        "", _figures(given), _figures(given["verified"]), "–", millimetres(rmse_m), "–",
    ])  # fmt: skip
    return table(
        "search | candidates | wall time, search only | in kernels | predicted RMSE / e_max | verified | "
        "verified, other engine | apart | joints outside their data at any level, predicted / verified",
        rows,
    )


def missing(result: Result) -> Iterator[str]:
    """Yield which searches were not run with the laws of today."""
    names = [f"`{name}`" for name in result.get("asked", ()) if name not in result["runs"]]
    if names:
        yield f"**Not run with today's laws**: {', '.join(names)}; `make study-shape` runs what is missing."
    else:
        yield "Every search was run with today's laws."


def polish(result: Result) -> Iterator[str]:
    """Return a table of the descents of the searches that are polished, all together."""
    rows = []
    for name, run in result["runs"].items():
        descents = run.get("polished") or ()
        if descents:
            evaluations, slopes = (str(sum(one[key] for one in descents)) for key in ("evaluations", "steps"))
            before, after = (
                [millimetres(one[key]) for one in sorted(descents, key=lambda one: one["before"])]
                for key in ("before", "after")
            )
            rows.append((f"`{name}`", evaluations, slopes, ", ".join(before), ", ".join(after)))
    return table("search | evaluations | slopes | RMSE of each candidate before | after", rows)


def rounds(result: Result) -> Iterator[str]:
    """Return a table of the searches that went on with direct FEM of their winner among the laws' data."""
    rows = []
    for name, run in result["runs"].items():
        for number, one in enumerate(run.get("rounds") or (), start=1):
            worst = percent(one["worst_of_range"])
            causes = ", ".join([*one["broken"], *one["leaning"]])
            objective = millimetres(next(iter(one["objectives"].values())))
            rows.append((f"`{name}`, {number}", str(one["evaluations"]), objective, worst, causes))
    if not rows:
        return iter(["No winner was searched again."])
    return table(
        "search, round | evaluations | predicted RMSE | law against FEM, at worst | why it went on", rows
    )


def laws(result: Result) -> Iterator[str]:
    """Return a table of the errors of the searches' laws against direct FEM of the winners."""
    return table(
        "search | design | FEM states | RMS, of the range | at worst | RMS, of the largest effort",
        page.laws(result, ("rmse_of_range", "worst_of_range", "rmse_of_largest")),
    )


def best(result: Result) -> Iterator[str]:
    """Return the winners' values, one column per search."""
    shown = result["runs"]
    units = {name: unit for run in shown.values() for name, unit in run["units"].items()}
    return page.values({f"`{name}`": run["best"]["values"] for name, run in shown.items()}, units)


def _outside(run: Mapping[str, Any], what: str) -> str:
    count = verified_metric(run, "outside_domain", what=what)
    return "–" if count is None else f"{count:.0f}"


def _figures(figures: Mapping[str, Any]) -> str:
    return " / ".join(millimetres(figures[metric]) for metric in METRICS)


def backbones(result: Result) -> bytes | None:
    """Draw a row per search, three projections in the base's frame, x along the chain."""
    shown = [(name, run["lines"], run) for name, run in result["runs"].items() if run.get("lines")]
    if not shown:
        return None
    with style.canvas(WIDE_PX, TALL_PX * len(shown) + 70) as figure:
        grid = figure.subplots(len(shown), len(PLANES), squeeze=False)
        for row, (name, lines, _) in zip(grid, shown, strict=True):
            for axes, plane in zip(row, PLANES, strict=True):
                _projection(axes, lines, plane)
            row[0].set_title(f"{name}, laws of {lines['laws']}")
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        figure.set_layout_engine("constrained", w_pad=0.07, h_pad=0.07)
        return style.small_png(figure).tobytes()


def _projection(axes: Any, lines: dict[str, Any], plane: tuple[int, int]) -> None:
    for label, colour, look in (("target", SERIES[1], "--"), ("backbone", SERIES[0], "-")):
        points = 1e3 * np.array(lines[f"{label}_m"], float)
        axes.plot(points[:, plane[0]], points[:, plane[1]], look, color=colour, lw=2, label=label)
    joints = 1e3 * np.array(lines["joints_m"], float)
    axes.plot(joints[:, plane[0]], joints[:, plane[1]], "o", ms=3, color=SERIES[0], label="joints")
    axes.plot([0], [0], "s", ms=6, color=INK)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{'xyz'[plane[0]]} of the base (mm)")
    axes.set_ylabel(f"{'xyz'[plane[1]]} of the base (mm)")


def history(result: Result) -> bytes | None:
    """Draw the best so far of every structure of the main search; the winner's in front."""
    found = result.get("structures", [])
    if not found or not found[0]["values"]:
        return None
    with style.canvas(WIDE_PX, 640) as figure:
        axes = figure.subplots()
        for order, one in enumerate(reversed(found)):
            first = order == len(found) - 1
            values = [np.nan if value is None else 1e3 * value for value in one["best_so_far"]]
            axes.plot(
                one["at"], values, drawstyle="steps-post", color=WARN if first else SERIES[0],
                lw=2.4 if first else 0.8, alpha=1 if first else 0.45, label=f"winner, {structure(one)}" if first else
                ("another structure" if order == 0 else None),
            )  # fmt: skip
        axes.set_yscale("log")
        style.log_labels(axes.yaxis)
        axes.locator_params(axis="x", integer=True)
        axes.set_xlabel("candidate of its structure")
        axes.set_ylabel("RMSE, best so far (mm)")
        axes.set_title(f"Best so far of {len(found)} structures")
        axes.legend(loc="upper right")
        figure.set_layout_engine("constrained")
        return style.small_png(figure).tobytes()


def strip(result: Result) -> bytes | None:
    """Draw the best of every structure by its total number of modules; the first few are named."""
    found = result.get("structures", [])
    if not found or not found[0]["values"]:
        return None
    totals = sorted({total(one) for one in found})
    with style.canvas(WIDE_PX, 620) as figure:
        axes = figure.subplots()
        for column, modules in enumerate(totals):
            values = [1e3 * one["best"] for one in found if total(one) == modules]
            places = column + np.random.default_rng(modules).uniform(-0.16, 0.16, len(values))
            axes.plot(places, values, "o", ms=5, alpha=0.7, color=SERIES[0], mew=0)
            axes.plot([column - 0.25, column + 0.25], [np.median(values)] * 2, color=INK, lw=1.5)
        names = "\n".join(f"{structure(one)}   {1e3 * one['best']:.2f} mm" for one in found[:NAMED])
        axes.annotate(f"best:\n{names}", (1.01, 0.98), xycoords="axes fraction", va="top", linespacing=1.5)
        axes.set_xticks(range(len(totals)), [str(modules) for modules in totals])
        axes.set_xlim(-0.5, len(totals) - 0.5)
        axes.set_ylim(0, 1.06e3 * max(one["best"] for one in found))
        axes.set_xlabel("modules in all")
        axes.set_ylabel("RMSE, best of a structure (mm)")
        axes.set_title("Best of every structure; bars are medians")
        figure.set_layout_engine("constrained")
        return style.small_png(figure).tobytes()


def structure(one: dict[str, Any]) -> str:
    """Return modules of the segments as text, 7-7-6-6."""
    return "-".join(str(value) for value in one["values"].values())


def total(one: dict[str, Any]) -> int:
    """Return modules of all segments."""
    return sum(int(value) for value in one["values"].values())


PICTURES: Pictures = {"backbones": backbones, "history": history, "structures": strip}
WORDS = {
    "backbones": "Backbone of the winners against the target, three projections",
    "history": "Best so far of every structure",
    "structures": "Best of every structure",
}
TABLES: Tables = {
    make.__name__: make for make in (page.state, page.reached, runs, missing, polish, rounds, laws, best)
}
TABLES |= page.shown_pictures("shape_matching", PICTURES, WORDS)
