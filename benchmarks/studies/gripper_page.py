"""The tables and pictures of docs/studies/gripper_codesign.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from benchmarks.pages import Result, Tables, table
from benchmarks.studies import page
from benchmarks.studies.gripper_bars import engine_metrics, rise_m, seed_statistics, stable
from benchmarks.studies.page import Pictures, clock, millimetres, number, percent
from benchmarks.studies.published import SOURCE

from pliant.report.chart_colours import SERIES, SOFT
from pliant.report.figures import style

Steps = tuple[Any, Any]
WIDE_PX = 1560
COLUMNS = 4
EARLY = 0.1  # of the grasps: from there on the scores of all seeds are visible


def grasps_picture(result: Result) -> bytes | None:
    """Draw per engine: stable grasps of the trials and z_max in every task, baseline and winners together."""
    grippers = {"baseline": result["baseline"], **result["runs"]}
    found = {name: engine_metrics(part) for name, part in grippers.items() if part and engine_metrics(part)}
    engines = list(dict.fromkeys(engine for tasks in found.values() for engine in tasks))
    if not engines:
        return None
    with style.canvas(WIDE_PX, 400 * len(engines) + 60) as figure:
        grid = figure.subplots(len(engines), 2, squeeze=False)
        for row, engine in zip(grid, engines, strict=True):
            _bars(row[0], found, engine, "success_share", 100.0)
            row[0].set_title(f"{engine}: stable grasps")
            row[0].set_ylabel("% of the trials")
            row[0].set_ylim(0, 105)
            _bars(row[1], found, engine, "z_max_m", 1e3)
            row[1].set_title(f"{engine}: rise of the object, mean of the trials")
            row[1].set_ylabel("z_max (mm)")
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(found))
        figure.set_layout_engine("constrained", w_pad=0.07, h_pad=0.07)
        return style.small_png(figure).tobytes()


def _bars(axes: Any, found: dict[str, Any], engine: str, metric: str, scale: float) -> None:
    tasks = list(dict.fromkeys(t for engines in found.values() for t in engines.get(engine, {})))
    width = 0.8 / len(found)
    for place, (name, engines) in enumerate(found.items()):
        own = engines.get(engine, {})
        values = [scale * own[task][metric] if task in own else np.nan for task in tasks]
        at = np.arange(len(tasks)) + (place - (len(found) - 1) / 2) * width
        colour = SOFT if name == "baseline" else SERIES[(place - 1) % len(SERIES)]
        axes.bar(at, values, 0.92 * width, color=colour, label=name)
    axes.set_xticks(range(len(tasks)), tasks)
    axes.set_xlim(-0.6, len(tasks) - 0.4)
    axes.grid(axis="x", visible=False)


def policy_picture(result: Result) -> bytes | None:
    """Draw a panel per variable, a row per task: proposals of the policy in the last quarter of its search."""
    tasks = result.get("policy") or {}
    variables = [v for v in result.get("variables", []) if any(v["name"] in own for own in tasks.values())]
    if not variables:
        return None
    columns = min(COLUMNS, len(variables))
    rows = -(-len(variables) // columns)
    with style.canvas(WIDE_PX, rows * (44 * len(tasks) + 130)) as figure:
        grid = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
        for axes, variable in zip(grid, variables, strict=False):
            _proposed(axes, variable, tasks)
        for axes in grid[len(variables) :]:
            axes.set_axis_off()
        grid[0].set_yticks(range(len(tasks)), list(tasks))
        grid[0].set_ylim(len(tasks) - 0.4, -0.6)
        figure.set_layout_engine("constrained", w_pad=0.07, h_pad=0.07)
        return style.small_png(figure).tobytes()


def _proposed(axes: Any, variable: dict[str, Any], tasks: dict[str, Any]) -> None:
    known = {"m": (1e3, "mm"), "Pa": (1e-3, "kPa"), "rad": (180 / np.pi, "°")}  # shown for SI units
    scale, unit = known.get(variable["unit"], (1.0, variable["unit"]))
    for row, own in enumerate(tasks.values()):
        values = scale * np.array(own.get(variable["name"], []), float)
        if not len(values):
            continue
        colour = SERIES[row % len(SERIES)]
        shift = np.random.default_rng(row).uniform(-0.22, 0.22, (2, len(values)))
        aside = 0.5 * shift[1] if variable["type"] == "integer" else 0.0
        axes.scatter(values + aside, row + shift[0], 8, color=colour, lw=0, alpha=0.5)
        axes.plot([np.median(values)] * 2, [row - 0.3, row + 0.3], color=colour, lw=2.2)
    low, high = scale * variable["low"], scale * variable["high"]
    pad = 0.06 * (high - low) or 0.5
    axes.set_xlim(low - pad, high + pad)
    axes.locator_params(axis="x", nbins=5, integer=variable["type"] == "integer")
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.set_title(f"{variable['name']} ({unit})" if unit else variable["name"], fontsize=9.5)


def seeds_picture(result: Result) -> bytes | None:
    """Draw the best score so far over the grasps: a panel per optimizer, a line per seed, and their median."""
    # Grasps made and the score since then, NaN before every task has one.
    drawn = {
        name: [tuple(np.array(part["curve"][key], float) for key in ("grasps", "score")) for part in parts]
        for name, parts in result["seeds"].items()
        if parts
    }
    if not drawn:
        return None
    with style.canvas(WIDE_PX, 480) as figure:
        panels = figure.subplots(1, len(drawn), squeeze=False, sharex=True, sharey=True)[0]
        for axes, (name, steps), colour in zip(panels, drawn.items(), SERIES, strict=False):
            for grasps_made, scores in steps:
                axes.plot(grasps_made, scores, drawstyle="steps-post", lw=0.9, alpha=0.6, color=colour)
            every = np.unique(np.concatenate([grasps_made for grasps_made, _ in steps]))
            median = np.median([_at(one, every) for one in steps], axis=0)
            axes.plot(every, median, drawstyle="steps-post", lw=2.2, color=colour)
            axes.set_title(f"{name}: {len(steps)} seed{'s' * (len(steps) > 1)} and their median")
            axes.set_xlabel("grasps")
        curves = [one for steps in drawn.values() for one in steps]
        early = [float(_at(one, EARLY * one[0][-1])) for one in curves]
        if np.isfinite(early).any():
            panels[0].set_ylim(np.nanmin(early) - 0.05, max(np.nanmax(scores) for _, scores in curves) + 0.05)
        panels[0].set_ylabel("best score so far")
        figure.set_layout_engine("constrained", w_pad=0.07)
        return style.small_png(figure).tobytes()


def _at(steps: Steps, grasps_made: Any) -> Any:
    """Return the score at some numbers of grasps."""
    before = np.searchsorted(steps[0], grasps_made, side="right") - 1
    return np.where(before >= 0, steps[1][np.maximum(before, 0)], np.nan)


def searches(result: Result) -> Iterator[str]:
    """Return the three searches, and the published one below."""
    rows = []
    for name, run in result["runs"].items():
        stored = " (searched before; kernel timed later)" if run["from_store"] else ""
        rows.append([
            f"`{name}`: {run['words']}", run["simulations"], sum(run["failed"].values()), clock(run["wall_s"]),
            f"{run['wall_in_kernels']:.0f}{stored}", _when_found(run), f"{run['score']:.3f}",
            f"{run['stable_tasks']} of {len(run['tasks'])}",
        ])  # fmt: skip
    given = result["published"]
    estimate = f"about {clock(given['our_estimates']['wall_s'])}: an estimate of ours"
    rows.append([f"published ({SOURCE}), PPO", given["grasps"], "", estimate, "", "–", "–", "–"])
    return table(
        "search | runs | failed candidates | wall time, search only | in kernels | score when found | score | "
        "stable tasks",
        rows,
    )


def grasps(result: Result) -> Iterator[str]:
    """Return stable grasps of the check, baseline first."""
    rows = []
    for name, engine, tasks, part in _checked(result):
        held, trials = stable(tasks)
        rise, of = millimetres(rise_m(tasks), 1), part.get("laws", "direct FEM")
        rows.append((f"`{name}`", engine, f"{held}/{trials}", rise, of))
    given = result["published"]
    rows.append((f"published ({SOURCE}), optimised", "one", f"{given['stable']}/{given['trials']}", "–", "–"))
    return table("gripper | engine | stable grasps | z_max, mean | laws", rows)


def robust(result: Result) -> Iterator[str]:
    """Yield a table of the cost of robustness, if such a search has run."""
    found = (result["runs"].get("robust") or {}).get("robustness")
    if not found:
        return
    ways = ("nominal", "robust")
    rows = (
        (f"of the {design} search", *(f"{found[f'{kind}_of_{design}']:.3f}" for kind in ways))
        for design in ways
    )
    over = f"{found['measure']} over {found['samples']} scenarios"
    yield from table(f"design | reward where nothing deviates | {over}", rows)


def by_task(result: Result) -> Iterator[str]:
    """Yield a table of stable grasps of every task."""
    columns = list(_checked(result))
    if not columns:
        return
    names = dict.fromkeys(task for _, _, tasks, _ in columns for task in tasks)
    rows = ((task, *(_task_text(tasks.get(task)) for _, _, tasks, _ in columns)) for task in names)
    yield from table(f"task | {' | '.join(f'`{name}`, {engine}' for name, engine, *_ in columns)}", rows)


def laws(result: Result) -> Iterator[str]:
    """Return a table of the errors of the searches' laws against direct FEM of the winners."""
    published = percent(result["published"]["law_rmse_of_largest"], 3)
    rows = page.laws(result, ("rmse_of_largest", "worst_of_largest", "rmse_of_range"))
    return table(
        "search | design | FEM states | RMS, of the largest torque | at worst | RMS, of the range",
        [*rows, (f"published ({SOURCE})", "", "", published, "–", "–")],
    )


def designs(result: Result) -> Iterator[str]:
    """Return a table of the winners' values; of a policy one column per task."""
    units = {variable["name"]: variable["unit"] for variable in result["variables"]}
    columns = {"baseline": (result["baseline"] or {}).get("design", {})}
    for name, run in result["runs"].items():
        for one in run["designs"]:
            label = f"{name}, {run['tasks'][one['context']]}" if one["context"] >= 0 else name
            columns[label] = {k: v for k, v in one["values"].items() if k in _acting(run, one)}
    return page.values(columns, units)


def seeds(result: Result) -> Iterator[str]:
    """Yield a table of the optimizers at equal numbers of grasps."""
    shown = {name: parts for name, parts in result["seeds"].items() if parts}
    if not shown:
        return
    rows = []
    for name, parts in shown.items():
        found, grasped = seed_statistics(parts), [one["simulations"] for one in parts]
        counts = str(grasped[0]) if len(set(grasped)) == 1 else f"{min(grasped)} to {max(grasped)}"
        tasks, wall_s = (sum(one[key] for one in parts) / len(parts) for key in ("stable_tasks", "wall_s"))
        rows.append([
            f"`{name}`", len(parts), counts, f"{found['mean']:.3f} ± {number(found['sd'])}",
            f"{found['low']:.3f} to {found['high']:.3f}", f"{tasks:.1f}", clock(wall_s),
        ])  # fmt: skip
    yield from table(
        "optimizer | seeds | runs of each | score, mean ± sd | lowest to highest | stable tasks | wall time",
        rows,
    )


def _checked(result: Result) -> Iterator[tuple[str, str, dict[str, Any], dict[str, Any]]]:
    """Yield gripper, engine, metrics by task, and their part, baseline first."""
    for name, part in {"baseline": result["baseline"], **result["runs"]}.items():
        for engine, tasks in engine_metrics(part).items() if part else ():
            yield name, engine, tasks, part


def _when_found(run: Mapping[str, Any]) -> str:
    """Return the score of repeated designs in the search."""
    tried = (one.get("objectives_before") for one in run["designs"])
    before = [next(iter(objectives.values())) for objectives in tried if objectives]
    return number(sum(before) / len(before)) if before else "–"


def _acting(run: Mapping[str, Any], design: Mapping[str, Any]) -> list[str]:
    """Return variables that act in the tasks of a design."""
    acting: dict[str, list[str]] = run["acting"]
    tasks = [run["tasks"][design["context"]]] if design["context"] >= 0 else run["tasks"]
    return [name for name in design["values"] if any(name in acting[task] for task in tasks)]


def _task_text(metrics: Mapping[str, float] | None) -> str:
    return "–" if metrics is None else "{}/{}".format(*stable({"": metrics}))


PICTURES: Pictures = {"grasps": grasps_picture, "policy": policy_picture, "seeds": seeds_picture}
WORDS = {
    "grasps": "Stable grasps and rise of every gripper, task and engine",
    "policy": "What the policy proposes for every task",
    "seeds": "Score against grasps of every optimizer and seed",
}
TABLES: Tables = {
    make.__name__: make
    for make in (page.state, page.reached, searches, grasps, robust, by_task, laws, designs, seeds)
}
SHOWN = page.shown_pictures("gripper_codesign", PICTURES, WORDS)
TABLES |= {f"{label}_picture": shows for label, shows in SHOWN.items()}
