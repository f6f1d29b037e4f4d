"""The tables and pictures of docs/studies/gripper_codesign.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from benchmarks.studies.bars import bar_rows
from benchmarks.studies.gripper_bars import of_seeds
from benchmarks.studies.gripper_check import engines_of, rise_m, stable
from benchmarks.studies.gripper_pictures import grasps as grasps_picture
from benchmarks.studies.gripper_pictures import policy as policy_picture
from benchmarks.studies.gripper_pictures import seeds as seeds_picture
from benchmarks.studies.machine import state_words
from benchmarks.studies.published import SOURCE
from benchmarks.studies.spoken import clock, millimetres, number, percent

from pliant.formatting import quantity

Result = dict[str, Any]


def state(result: Result) -> Iterator[str]:
    """When a study has run: on what."""
    yield state_words(result)


def reached(result: Result) -> Iterable[str]:
    """What was to be reached."""
    return bar_rows(result["bars"])


def searches(result: Result) -> Iterator[str]:
    """The three searches, and the published one below."""
    yield (
        "| search | runs | failed candidates | wall time, search only | in kernels | score when found | score | "
        "stable tasks |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for name, run in result["runs"].items():
        stored = " (searched before; kernel timed later)" if run["from_store"] else ""
        yield (
            f"| `{name}`: {run['words']} | {run['simulations']} | {sum(run['failed'].values())} | "
            f"{clock(run['wall_s'])} | {run['wall_in_kernels']:.0f}{stored} | {_when_found(run)} | "
            f"{run['score']:.3f} | {run['stable_tasks']} of {len(run['tasks'])} |"
        )
    given = result["published"]
    estimate = f"about {clock(given['our_estimates']['wall_s'])}: an estimate of ours"
    yield f"| published ({SOURCE}), PPO | {given['grasps']} | | {estimate} | | – | – | – |"


def grasps(result: Result) -> Iterator[str]:
    """Stable grasps of the check, baseline first."""
    yield "| gripper | engine | stable grasps | z_max, mean | laws |"
    yield "|---|---|---|---|---|"
    for name, part in {"baseline": result["baseline"], **result["runs"]}.items():
        for engine, tasks in engines_of(part).items() if part else ():
            held, trials = stable(tasks)
            laws = part.get("laws", "direct FEM")
            yield f"| `{name}` | {engine} | {held}/{trials} | {millimetres(rise_m(tasks), 1)} | {laws} |"
    given = result["published"]
    yield f"| published ({SOURCE}), optimised | one | {given['stable']}/{given['trials']} | – | – |"


def robust(result: Result) -> Iterator[str]:
    """What it costs to be robust, where such a search has run."""
    found = (result["runs"].get("robust") or {}).get("robustness")
    if not found:
        return
    yield f"| design | reward where nothing deviates | {found['measure']} over {found['samples']} scenarios |"
    yield "|---|---|---|"
    for design in ("nominal", "robust"):
        cells = (found[f"{kind}_of_{design}"] for kind in ("nominal", "robust"))
        yield f"| of the {design} search | {' | '.join(f'{cell:.3f}' for cell in cells)} |"


def by_task(result: Result) -> Iterator[str]:
    """Stable grasps of every task."""
    found = {"baseline": result["baseline"], **result["runs"]}
    columns = [(n, e, tasks) for n, part in found.items() if part for e, tasks in engines_of(part).items()]
    if not columns:
        return
    yield f"| task | {' | '.join(f'`{name}`, {engine}' for name, engine, _ in columns)} |"
    yield f"|---|{'---|' * len(columns)}"
    for task in dict.fromkeys(task for *_, tasks in columns for task in tasks):
        cells = (_of_task(tasks.get(task)) for *_, tasks in columns)
        yield f"| {task} | {' | '.join(cells)} |"


def laws(result: Result) -> Iterator[str]:
    """What the laws of the searches missed of direct FEM of the winners."""
    yield "| search | design | FEM states | RMS, of the largest torque | at worst | RMS, of the range |"
    yield "|---|---|---|---|---|---|"
    for name, run in result["runs"].items():
        for law in (run["verified"] or {}).get("laws", ()):
            cells = (law.get(key) for key in ("rmse_of_largest", "worst_of_largest", "rmse_of_range"))
            yield f"| `{name}` | {law['name']} | {law['n_states']} | {' | '.join(percent(c) for c in cells)} |"
    yield f"| published ({SOURCE}) | | | {percent(result['published']['law_rmse_of_largest'], 3)} | – | – |"


def designs(result: Result) -> Iterator[str]:
    """The winners' values; of a policy one column per task."""
    units = {variable["name"]: variable["unit"] for variable in result["variables"]}
    base = (result["baseline"] or {}).get("design", {})
    columns = {"baseline": base}
    for name, run in result["runs"].items():
        for one in run["designs"]:
            label = f"{name}, {run['tasks'][one['context']]}" if one["context"] >= 0 else name
            columns[label] = {k: v for k, v in one["values"].items() if k in _acting(run, one)}
    names = list(dict.fromkeys(name for values in columns.values() for name in values))
    yield f"| variable | {' | '.join(columns)} |"
    yield f"|---|{'---|' * len(columns)}"
    for name in names:
        cells = (_value(values.get(name), units.get(name, "")) for values in columns.values())
        yield f"| {name} | {' | '.join(cells)} |"


def seeds(result: Result) -> Iterator[str]:
    """The optimizers at equal numbers of grasps."""
    if not any(result["seeds"].values()):
        return
    yield "| optimizer | seeds | runs of each | score, mean ± sd | lowest to highest | stable tasks | wall time |"
    yield "|---|---|---|---|---|---|---|"
    for name, parts in result["seeds"].items():
        if not parts:
            continue
        found, grasped = of_seeds(parts), [one["simulations"] for one in parts]
        counts = str(grasped[0]) if len(set(grasped)) == 1 else f"{min(grasped)} to {max(grasped)}"
        tasks = sum(one["stable_tasks"] for one in parts) / len(parts)
        wall_s = sum(one["wall_s"] for one in parts) / len(parts)
        yield (
            f"| `{name}` | {len(parts)} | {counts} | {found['mean']:.3f} ± {number(found['sd'])} | "
            f"{found['low']:.3f} to {found['high']:.3f} | {tasks:.1f} | {clock(wall_s)} |"
        )


def picture(
    label: str, words: str, drawn: Callable[[Result], bytes | None]
) -> Callable[[Result], Iterator[str]]:
    """A mark that shows a picture where there is one."""

    def lines(result: Result) -> Iterator[str]:
        if drawn(result) is not None:
            yield f"![{words}](gripper_codesign_{label}.png)"

    return lines


PICTURES: Mapping[str, Callable[[Result], bytes | None]] = {
    "grasps": grasps_picture,
    "policy": policy_picture,
    "seeds": seeds_picture,
}
TABLES: Mapping[str, Callable[[Result], Iterable[str]]] = {
    "state": state,
    "reached": reached,
    "searches": searches,
    "grasps": grasps,
    "robust": robust,
    "by_task": by_task,
    "laws": laws,
    "designs": designs,
    "seeds": seeds,
    "grasps_picture": picture(
        "grasps", "Stable grasps and rise of every gripper, task and engine", grasps_picture
    ),
    "policy_picture": picture("policy", "What the policy proposes for every task", policy_picture),
    "seeds_picture": picture("seeds", "Score against grasps of every optimizer and seed", seeds_picture),
}


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


def _value(value: Any, unit: str) -> str:
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) and not unit else quantity(value, unit, 4)
