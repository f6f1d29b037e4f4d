"""Learning curves: error of a fit against the number of states, or of other items, that it is given."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.execution.progress import Progress, Silent
from pliant.interfaces.surrogate import Surrogate, SurrogateConfig
from pliant.pipeline.residuals import Residuals, fitted_box
from pliant.pipeline.surrogate import without_tables
from pliant.pipeline.workbench import RunContext, content
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.store.store import Artifact, write_atomically

FEWEST = 4
STEP = np.sqrt(2.0)
# In every order of states but the first, distances are scaled by a random factor; this deviation is of its logarithm.
SHUFFLE = 0.5
HELD_OUT_SHARE = 0.2
SEED = 0  # of the held-out states
WITH, WITHOUT = "with slopes", "without slopes"


def learning_stage(
    context: RunContext, config: SurrogateConfig, data: ModuleData, inputs: Mapping[str, str], orders: int = 1
) -> Artifact:
    """Return the learning curve through the store; `inputs` key the data. The value is the dict of `learning_curve`."""
    surrogate: Surrogate = context.build("surrogate", config)
    return context.make(
        "learning",
        lambda partial: learning_curve(surrogate, data, orders, context.progress, partial / "points.json"),
        components=[context.component("surrogate", config)],
        modules=["pliant.pipeline.learning"],
        config={"surrogate": without_tables(content(config)), "orders": orders},
        inputs=inputs,
    )


def learning_curve(
    surrogate: Surrogate,
    data: ModuleData,
    orders: int = 1,
    progress: Progress | None = None,
    kept: Path | None = None,
) -> dict[str, Any]:
    """Refit on nested subsets of the states and score on the check states.

    Args:
        surrogate: to be fitted.
        data: states of one design; without any of role "check" a fifth is held out (`with_checks`).
        orders: seeds of the order in which states are added (`spread_order`).
        progress: notified of each fit.
        kept: file of finished points, from which an interrupted run resumes.

    Returns:
        `points`: each with `slopes` ("with slopes", "without slopes"), `order`, `n`, `rms` and `worst` as shares of
        the range of each axis' effort, `wall_s` of the fit; `left_out`: sizes for which the fit is impossible, each
        with its cause; `n_check` scoring states; `sizes`; `untrusted` states that are not used.
    """
    data = with_checks(data)
    usable = np.isin(data.status, TRUSTED)
    fit = np.flatnonzero(usable & (data.role == "fit"))
    checks = np.flatnonzero(data.role == "check")
    sizes = subset_sizes(len(fit))
    sloped = np.isfinite(data.dtau_dp).any() or np.isfinite(data.dtau_du).any()
    places = np.column_stack([data.actuation, data.deformation])[fit]
    ordered = [fit[spread_order(places, data.explored[fit], seed)] for seed in range(orders)]
    box = fitted_box(data, data.axes)

    def point(slopes: str, order: int, n: int) -> dict[str, Any]:
        """Return the scores of the law of a subset on the check states inside the box of all states."""
        subset = data.rows(np.sort(np.concatenate([ordered[order][:n], checks])))
        if slopes == WITHOUT:
            unknown = {name: np.full_like(getattr(subset, name), np.nan) for name in ("dtau_dp", "dtau_du")}
            subset = replace(subset, **unknown)
        started = time.perf_counter()
        law = surrogate.fit_module(subset).law
        wall_s = time.perf_counter() - started
        columns = [0, *(1 + data.axes.index(axis) for axis in law.axes)]
        missed = Residuals.from_law(data, law, inside=box[columns])
        missed = missed.rows(missed.check)
        return {"rms": missed.rms, "worst": missed.worst, "wall_s": wall_s}

    jobs = [
        {"slopes": s, "order": o, "n": n}
        for s in ((WITH, WITHOUT) if sloped else (WITHOUT,))
        for o in range(orders)
        for n in sizes
    ]
    return {
        **curve_points(jobs, point, progress or Silent(), "learning curve", kept),
        "n_check": int((usable & (data.role == "check")).sum()),
        "sizes": sizes,
        "untrusted": int(np.sum(~usable)),
    }


def curve_points(
    jobs: Sequence[dict[str, Any]],
    point: Callable[..., dict[str, Any]],
    progress: Progress,
    title: str,
    kept: Path | None,
) -> dict[str, Any]:
    """Return `points` of the jobs, and those `left_out` with their cause; points in the file `kept` are reused."""
    try:
        found = json.loads(kept.read_text()) if kept is not None else {}
    except (OSError, ValueError):
        found = {}
    found = found if isinstance(found, dict) else {}
    bar = progress.begin(title, len(jobs))
    try:
        for job in jobs:
            name = ", ".join(map(str, job.values()))
            if name not in found:
                try:
                    found[name] = {**job, **point(**job)}
                except UserError as error:
                    found[name] = {**job, "cause": str(error)}
                if kept is not None:
                    write_atomically(kept, json.dumps(found))
            bar.advance()
    finally:
        bar.finish()
    points = [found[", ".join(map(str, job.values()))] for job in jobs]
    return {
        "points": [p for p in points if "cause" not in p],
        "left_out": [p for p in points if "cause" in p],
    }


def states_needed(
    curve: Mapping[str, Any], share: float, slopes: str = WITH, score: str = "rms"
) -> int | None:
    """Return the fewest states from which on all larger subsets of the first order are below `share`, or None."""
    points = (p for p in curve["points"] if p["slopes"] == slopes and p["order"] == 0)
    needed = None
    for point in sorted(points, key=lambda p: -p["n"]):
        if not point[score] <= share:
            break
        needed = int(point["n"])
    return needed


def subset_sizes(n: int, fewest: int = FEWEST) -> list[int]:
    """Return 4, 6, 8, 11, 16, … in steps of √2 from the fewest, and n."""
    sizes, size = [], float(fewest)
    while round(size) < n:
        sizes.append(round(size))
        size *= STEP
    return [*sizes, n]


def spread_order(places: Array, groups: NDArray[np.str_], seed: int) -> NDArray[np.int64]:
    """Return an order of m points (m, d) in which every leading subset is spread well, cycling through the groups.

    Each group starts with the corners of its box in its two widest coordinates, so that a law of a leading subset has
    nearly the whole domain, and continues with the farthest point from those before it (greedy). This is order 0;
    other orders scale the distances by seeded random factors.
    """
    low, width = places.min(axis=0), np.ptp(places, axis=0)
    x = (places - low) / np.where(width > 0, width, 1.0)
    stretch = np.ones(len(x))
    if seed:
        stretch = np.exp(SHUFFLE * np.random.default_rng(seed).standard_normal(len(x)))
    turns, members = np.empty(len(x), np.int64), np.empty(len(x), np.int64)
    for number, group in enumerate(dict.fromkeys(groups.tolist())):
        rows = np.flatnonzero(groups == group)
        order = rows[_farthest_first(x[rows], stretch[rows])]
        turns[order], members[order] = np.arange(len(order)), number
    return np.lexsort((members, turns))


def with_checks(data: ModuleData) -> ModuleData:
    """Return the data with a check set; by default a seeded fifth of the trusted states that are not extreme."""
    usable = np.isin(data.status, TRUSTED)
    if np.any(usable & (data.role == "check")):
        return data
    values = np.column_stack([data.actuation, data.deformation])
    border = np.zeros(len(data), bool)
    for kind in np.unique(data.explored):
        rows = np.flatnonzero(usable & (data.explored == kind))
        if len(rows):
            ends = values[rows] == values[rows].min(axis=0), values[rows] == values[rows].max(axis=0)
            varies = np.ptp(values[rows], axis=0) > 0
            border[rows] |= np.any((ends[0] | ends[1]) & varies, axis=1)
    inner = np.flatnonzero(usable & ~border)
    wanted = min(len(inner), max(1, round(HELD_OUT_SHARE * int(usable.sum()))))
    held_out = np.zeros(len(data), bool)
    held_out[np.random.default_rng(SEED).choice(inner, wanted, replace=False)] = True
    return replace(data, role=np.where(held_out, "check", data.role))


def _farthest_first(x: Array, stretch: Array) -> list[int]:
    """Return the corners of the box of x (m, d), then the farthest point from those chosen, times `stretch` (m,)."""
    chosen = list(dict.fromkeys(_corners(x)))
    nearest = np.min([np.linalg.norm(x - x[i], axis=1) for i in chosen], axis=0)
    while len(chosen) < len(x):
        score = nearest * stretch
        score[chosen] = -1.0
        best = int(np.argmax(score))
        chosen.append(best)
        nearest = np.minimum(nearest, np.linalg.norm(x - x[best], axis=1))
    return chosen


def _corners(x: Array) -> Iterator[int]:
    """Yield the points nearest to the four corners in the two widest coordinates."""
    widest = np.sort(np.argsort(-np.ptp(x, axis=0), kind="stable")[:2])
    y = x[:, widest]
    box = np.stack([y.min(axis=0), y.max(axis=0)])
    for sides in ((0, 0), (1, 1), (0, 1), (1, 0)):
        yield int(np.argmin(np.linalg.norm(y - box[sides, (0, 1)], axis=1)))
