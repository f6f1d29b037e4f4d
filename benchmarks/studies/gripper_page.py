"""The tables and pictures of docs/studies/gripper_codesign.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.pages import Result, Tables, table
from benchmarks.studies import gripper_pictures, page
from benchmarks.studies.gripper_bars import of_seeds
from benchmarks.studies.gripper_check import engines_of, rise_m, stable
from benchmarks.studies.page import Pictures, clock, millimetres, number, percent
from benchmarks.studies.published import SOURCE


def searches(result: Result) -> Iterator[str]:
    """The three searches, and the published one below."""
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
    """Stable grasps of the check, baseline first."""
    rows = []
    for name, engine, tasks, part in _checked(result):
        held, trials = stable(tasks)
        rise, of = millimetres(rise_m(tasks), 1), part.get("laws", "direct FEM")
        rows.append((f"`{name}`", engine, f"{held}/{trials}", rise, of))
    given = result["published"]
    rows.append((f"published ({SOURCE}), optimised", "one", f"{given['stable']}/{given['trials']}", "–", "–"))
    return table("gripper | engine | stable grasps | z_max, mean | laws", rows)


def robust(result: Result) -> Iterator[str]:
    """What it costs to be robust, where such a search has run."""
    found = (result["runs"].get("robust") or {}).get("robustness")
    if not found:
        return
    rows = (
        (
            f"of the {design} search",
            *(f"{found[f'{kind}_of_{design}']:.3f}" for kind in ("nominal", "robust")),
        )
        for design in ("nominal", "robust")
    )
    over = f"{found['measure']} over {found['samples']} scenarios"
    yield from table(f"design | reward where nothing deviates | {over}", rows)


def by_task(result: Result) -> Iterator[str]:
    """Stable grasps of every task."""
    columns = list(_checked(result))
    if not columns:
        return
    names = dict.fromkeys(task for _, _, tasks, _ in columns for task in tasks)
    rows = ((task, *(_of_task(tasks.get(task)) for _, _, tasks, _ in columns)) for task in names)
    yield from table(f"task | {' | '.join(f'`{name}`, {engine}' for name, engine, *_ in columns)}", rows)


def laws(result: Result) -> Iterator[str]:
    """What the laws of the searches missed of direct FEM of the winners."""
    published = percent(result["published"]["law_rmse_of_largest"], 3)
    rows = page.laws(result, ("rmse_of_largest", "worst_of_largest", "rmse_of_range"))
    return table(
        "search | design | FEM states | RMS, of the largest torque | at worst | RMS, of the range",
        [*rows, (f"published ({SOURCE})", "", "", published, "–", "–")],
    )


def designs(result: Result) -> Iterator[str]:
    """The winners' values; of a policy one column per task."""
    units = {variable["name"]: variable["unit"] for variable in result["variables"]}
    columns = {"baseline": (result["baseline"] or {}).get("design", {})}
    for name, run in result["runs"].items():
        for one in run["designs"]:
            label = f"{name}, {run['tasks'][one['context']]}" if one["context"] >= 0 else name
            columns[label] = {k: v for k, v in one["values"].items() if k in _acting(run, one)}
    return page.values(columns, units)


def seeds(result: Result) -> Iterator[str]:
    """The optimizers at equal numbers of grasps."""
    shown = {name: parts for name, parts in result["seeds"].items() if parts}
    if not shown:
        return
    rows = []
    for name, parts in shown.items():
        found, grasped = of_seeds(parts), [one["simulations"] for one in parts]
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
    """Gripper, engine, metrics by task, and the part that they are of, baseline first."""
    for name, part in {"baseline": result["baseline"], **result["runs"]}.items():
        for engine, tasks in engines_of(part).items() if part else ():
            yield name, engine, tasks, part


def _when_found(run: Mapping[str, Any]) -> str:
    """The score of designs that were tried again, as the search had seen them."""
    before = [
        next(iter(one["objectives_before"].values()))
        for one in run["designs"]
        if one.get("objectives_before")
    ]
    return number(sum(before) / len(before)) if before else "–"


def _acting(run: Mapping[str, Any], design: Mapping[str, Any]) -> list[str]:
    """Variables that act in the tasks of a design."""
    acting: dict[str, list[str]] = run["acting"]
    tasks = [run["tasks"][design["context"]]] if design["context"] >= 0 else run["tasks"]
    return [name for name in design["values"] if any(name in acting[task] for task in tasks)]


def _of_task(metrics: Mapping[str, float] | None) -> str:
    if metrics is None:
        return "–"
    held, trials = stable({"": metrics})
    return f"{held}/{trials}"


PICTURES: Pictures = {
    "grasps": gripper_pictures.grasps,
    "policy": gripper_pictures.policy,
    "seeds": gripper_pictures.seeds,
}
WORDS = {
    "grasps": "Stable grasps and rise of every gripper, task and engine",
    "policy": "What the policy proposes for every task",
    "seeds": "Score against grasps of every optimizer and seed",
}
TABLES: Tables = {
    "state": page.state,
    "reached": page.reached,
    "searches": searches,
    "grasps": grasps,
    "robust": robust,
    "by_task": by_task,
    "laws": laws,
    "designs": designs,
    "seeds": seeds,
    **{
        f"{label}_picture": shows
        for label, shows in page.shown_pictures("gripper_codesign", PICTURES, WORDS).items()
    },
}
