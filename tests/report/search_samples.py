"""Search records computed from formulas: one branch, many, contexts, two objectives, robust, verified, all failed."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.rollout import Equilibrium, TaskResult
from pliant.records.scene import SceneStill
from pliant.records.shape import Shape
from pliant.testing.samples import sample_chain
from pliant_search.records import (
    FoundDesign,
    Robustness,
    SearchHistory,
    SearchResult,
    Slope,
    VariableRecord,
    Verification,
)
from pliant_search.report.folder import DrawnDesign

RADIUS = VariableRecord("family.average_radius", ("family.average_radius",), "real", 6e-3, 8e-3, (), "m")
PRESSURE = VariableRecord("task.pressure", ("task.pressure",), "real", 2e3, 15e3, (), "Pa")
ROLL = VariableRecord("chain.base.roll", ("chain.base.roll",), "real", -np.pi, np.pi, (), "rad")
FINGERS = VariableRecord("fingers", ("task.fingers",), "integer", 2, 4)
SIDE = VariableRecord(
    "side", ("chain.base.side",), "categorical", choices=(0.0, float(np.pi / 2)), unit="rad"
)
PLAIN = (RADIUS, PRESSURE, ROLL, FINGERS, SIDE)
CONDITIONS = ("egg-0", "egg-5", "egg-10", "sphere-0", "sphere-5", "a very long name of a condition")


def wide_variables(count: int = 16) -> tuple[VariableRecord, ...]:
    """Return lengths with long names."""
    return tuple(
        VariableRecord(f"chain.segments.{k // 4}.family.outer_convolution_{'abcd'[k % 4]}_radius_of_curvature",
                       (f"k{k}",), "real", 1e-3 * (k + 1), 2e-3 * (k + 2), (), "m")
        for k in range(count)
    )  # fmt: skip


def drawn_values(variables: Sequence[VariableRecord], n: int) -> dict[str, np.ndarray]:
    """Return values that approach the upper third of every range, as a search does."""
    random = np.random.default_rng(0)
    narrow = np.linspace(1.0, 0.12, n)
    values = {}
    for k, v in enumerate(variables):
        centre = 0.35 + 0.5 * ((k * 0.37) % 1.0)
        share = np.clip(centre + narrow * (random.random(n) - 0.5), 0, 1)
        if v.choices:
            values[v.name] = np.floor(share * (len(v.choices) - 1e-9))
        elif v.type == "integer":
            values[v.name] = np.round(v.low + share * (v.high - v.low))
        else:
            values[v.name] = v.low + share * (v.high - v.low)
    return values


def bowl_rmse(variables: Sequence[VariableRecord], values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return a bowl in shares of the ranges, m."""
    total = np.zeros(len(next(iter(values.values()))))
    for k, v in enumerate(variables):
        high = len(v.choices) - 1 if v.choices else v.high - v.low
        share = (values[v.name] - (0 if v.choices else v.low)) / high
        total = total + (1 + k % 3) * (share - 0.35 - 0.5 * ((k * 0.37) % 1.0)) ** 2
    return np.asarray(1.7e-3 + 20e-3 * np.sqrt(total / len(variables)))


def make_history(
    variables: Sequence[VariableRecord],
    n: int = 120,
    branch: np.ndarray | None = None,
    context: np.ndarray | None = None,
    further: bool = False,
    failing: bool = True,
) -> SearchHistory:
    """Return a search history in which every ninth candidate is refused and every 13th fails."""
    values = drawn_values(variables, n)
    rmse = bowl_rmse(variables, values)
    if branch is not None:
        rmse = rmse + 4e-4 * (branch * 7 % 81)
    number = np.arange(n)
    status = np.where(number % 9 == 4, 1, np.where(number % 13 == 5, 2, 0)) if failing else np.zeros(n, int)
    first = np.where(status == 0, rmse, np.nan)
    effort = np.where(status == 0, 30e3 / (1 + 300 * rmse) + 200 * np.cos(number), np.nan)
    return SearchHistory(
        branch=np.zeros(n, int) if branch is None else branch,
        context=np.full(n, -1) if context is None else context,
        values=values,
        status=status,
        objectives=np.column_stack([first, effort]) if further else first[:, None],
        metrics={"rmse_m": first, "e_max_m": 1.8 * first, "work_j": effort},
        wall_s=np.full(n, 0.02),
    )


def design_at(
    variables: Sequence[VariableRecord],
    history: SearchHistory,
    row: int,
    objectives: Mapping[str, float] | None = None,
) -> FoundDesign:
    values = {}
    for v in variables:
        if v.name in history.values:
            raw = history.values[v.name][row]
            values[v.name] = (
                v.choices[int(raw)] if v.choices else (int(raw) if v.type == "integer" else float(raw))
            )
    metrics = {name: float(column[row]) for name, column in history.metrics.items()}
    settings = {key: values[v.name] for v in variables if v.name in values for key in v.keys}
    return FoundDesign(
        values, settings, objectives or {"rmse": metrics["rmse_m"]}, metrics, {"": metrics},
        int(history.branch[row]), int(history.context[row]), row,
    )  # fmt: skip


def make_slopes(variables: Sequence[VariableRecord], best: FoundDesign) -> tuple[Slope, ...]:
    found = []
    own = float(best.objectives["rmse"])
    for k, v in enumerate(variables):
        if v.each:
            continue
        if v.choices:
            shares = np.arange(len(v.choices), dtype=float)
            found.append(Slope(v.name, shares, own * (1 + 0.2 * shares), float("nan")))
            continue
        shares = np.linspace(0, 1, 11)
        at = (best.values[v.name] - v.low) / (v.high - v.low)
        objective = own + (k % 4 + 1) * 2e-3 * (shares - at) ** 2 + (1e-3 * (at - shares) if k == 1 else 0)
        objective = np.where(shares > 0.95, np.nan, objective) if k == 2 else objective
        found.append(Slope(v.name, shares, objective, 2e-5 * (k % 4), "high" if k == 1 else ""))
    return tuple(found)


def one_branch(n: int = 120, variables: Sequence[VariableRecord] = PLAIN, **changes: Any) -> SearchResult:
    history = make_history(variables, n)
    best = design_at(variables, history, int(np.nanargmin(history.objectives[:, 0])))
    made = SearchResult(
        "cmaes", 3, tuple(variables), ("rmse",), (False,), (), ({},), history, (best,),
        int((history.status == 0).sum()), n,
        {"average_radius - inner_radius >= 1 mm": int((history.status == 1).sum())},
        {"the chain did not settle": int((history.status == 2).sum())}, "budget", 42.0, make_slopes(variables, best),
        ("pressure stands at its upper bound, 15 kPa; a wider range would help by about 0.04 mm for 1 %.",),
    )  # fmt: skip
    return replace(made, **changes)


def many_branches(n: int = 81 * 60) -> SearchResult:
    """Return a search over 81 structures of four segments."""
    numbers = list(itertools.product((5, 6, 7), repeat=4))
    searched = tuple(
        VariableRecord(f"n{k + 1}", (f"chain.segments.{k}.modules",), "integer", 5, 7, each=True)
        for k in range(4)
    )
    pressures = tuple(
        VariableRecord(f"p{k + 1}", (f"task.pressure_{k + 1}",), "real", 0, 15e3, (), "Pa") for k in range(4)
    )
    branch = np.repeat(np.arange(81), -(-n // 81))[:n]
    history = make_history(pressures, n, branch=branch, failing=False)
    values = {
        **history.values,
        **{f"n{k + 1}": np.array([numbers[b][k] for b in branch], float) for k in range(4)},
    }
    history = replace(history, values=values)
    row = int(np.nanargmin(history.objectives[:, 0]))
    best = design_at((*searched, *pressures), history, row)
    branches = tuple({f"n{k + 1}": v for k, v in enumerate(one)} for one in numbers)
    base = one_branch(variables=PLAIN)
    return replace(
        base, variables=(*searched, *pressures), branches=branches, history=history, best=(best,), evaluations=n,
        refused={}, failed={}, slopes=make_slopes((*searched, *pressures), best), limits=(),
    )  # fmt: skip


def contextual(n: int = 2400) -> SearchResult:
    """Return PPO over six conditions: a maximised reward, a design for each condition."""
    context = np.arange(n) % len(CONDITIONS)
    history = make_history(PLAIN, n, context=context)
    narrow = np.linspace(0.0, 0.15, n) * (context - 2.5) / 2.5
    values = {**history.values, RADIUS.name: np.clip(history.values[RADIUS.name] + 2e-3 * narrow, 6e-3, 8e-3)}
    reward = 1.0 - 60 * history.objectives[:, 0] + 0.05 * context
    history = replace(
        history, values=values, objectives=-reward[:, None],
        metrics={"reward": reward, "success_share": np.clip(reward, 0, 1)},
    )  # fmt: skip
    best = []
    for k, name in enumerate(CONDITIONS):
        row = int(np.nanargmax(np.where(context == k, reward, np.nan)))
        metrics = {"reward": float(reward[row]), "success_share": 0.9}
        one = design_at(
            PLAIN, replace(history, metrics={"rmse_m": reward}), row, {"reward": metrics["reward"]}
        )
        best.append(replace(one, metrics=metrics, conditions={name: metrics}, context=k, number=-1))
    return one_branch(
        optimizer="ppo", objectives=("reward",), maximised=(True,), conditions=CONDITIONS, history=history,
        best=tuple(best), evaluations=int((history.status == 0).sum()), slopes=(), limits=(),
    )  # fmt: skip


def two_objectives(n: int = 400) -> SearchResult:
    history = make_history(PLAIN, n, further=True)
    a, b = history.objectives.T
    front = [
        i
        for i in range(n)
        if np.isfinite(a[i]) and not np.any((a <= a[i]) & (b <= b[i]) & ((a < a[i]) | (b < b[i])))
    ]
    best = tuple(
        design_at(PLAIN, history, i, {"rmse": float(a[i]), "work": float(b[i])})
        for i in sorted(front, key=lambda i: a[i])
    )
    return one_branch(
        objectives=("rmse", "work"), maximised=(False, False), history=history, best=best, slopes=()
    )


def verification() -> Verification:
    engines = {"mujoco": 1.0, "pybullet": 1.02}
    names = ("egg-0", "egg-5", "sphere-0")
    return Verification(
        predicted={e: {"rmse_m": 1.71e-3 * f, "e_max_m": 3.1e-3, "success_share": 1.0} for e, f in engines.items()},
        verified={e: {"rmse_m": 1.93e-3 * f, "e_max_m": 3.3e-3, "success_share": 0.9} for e, f in engines.items()},
        conditions={
            e: {c: {"success_share": 0.7 if c == "egg-5" else 1.0, "rmse_m": 2e-3} for c in names} for e in engines
        },
        laws=({"name": "design 1", "rmse_of_range": 0.0041, "worst_of_range": 0.0123, "n_states": 57},
              {"name": "design 2", "rmse_of_range": 0.0032, "worst_of_range": 0.009, "n_states": 61}),
        fem_wall_s=95.0, wall_s=110.0, notes=("PyBullet has no wheel for this Python.",),
    )  # fmt: skip


def robustness(best: FoundDesign) -> Robustness:
    random = np.random.default_rng(5)
    spread = {
        "nominal": 1.7e-3 + np.abs(random.normal(0, 1.5e-3, 32)),
        "robust": 2.2e-3 + np.abs(random.normal(0, 4e-4, 32)),
    }
    worst = {k: float(np.sort(v)[-6:].mean()) for k, v in spread.items()}
    sources = ("laws within their error bars", "family.wall ± 0.1 mm", "task.friction ± 5 %")
    nominal = replace(best, values={**best.values, RADIUS.name: 7.7e-3})
    return Robustness(
        "cvar", 0.8, 32, sources, 1.7e-3, worst["nominal"], 2.2e-3, worst["robust"], spread, nominal
    )


def everything_failed(n: int = 40) -> SearchResult:
    history = make_history(PLAIN, n)
    nothing = np.full(n, np.nan)
    history = replace(
        history, status=np.where(np.arange(n) % 2, 1, 2), objectives=nothing[:, None],
        metrics=dict.fromkeys(history.metrics, nothing),
    )  # fmt: skip
    return one_branch(
        history=history, best=(), evaluations=20, refused={"n1 + n2 <= 12": 20}, slopes=(), limits=(),
        failed={"the chain did not settle": 20},
    )  # fmt: skip


STUDY: dict[str, Any] = {
    "pliant": 1,
    "name": "a <search>",
    "search": {"objective": "rmse", "budget": 120, "verify": {"fem": True, "change": {"task.trials": 10}}},
    "optimizer": {"kind": "cmaes", "sigma": 0.3},
    "task": {"kind": "grasp", "trials": 1},
}


def curved(label: str, bend: float = 0.2, off: float = 1e-3) -> DrawnDesign:
    """Return a chain that settled near its target."""
    chain = sample_chain(modules=6)
    angles = np.full((6, 1), bend)
    markers = ChainGeometry.from_chain(chain).markers(angles)
    target = ChainGeometry.from_chain(chain).markers(angles * 1.1) + off
    metrics = {"rmse_m": off, "backbone_points_m": markers.tolist(), "target_points_m": target.tolist()}
    return DrawnDesign.from_result(
        label, chain, TaskResult(Equilibrium(angles, markers, 1e-9, True, True, 5, 0.1), metrics)
    )


def grasped(label: str, radius_m: float = 0.02) -> DrawnDesign:
    """Return a ball between two rods, above a floor."""
    rods = tuple(
        (Shape("capsule", (4e-3, 2e-2), np.array([x, 0.0, 0.06]), np.eye(3)),) for x in (-0.03, 0.03)
    )
    ball = (Shape("sphere", (radius_m,), np.array([0.0, 0.0, 0.05]), np.eye(3)),)
    stills = tuple(SceneStill(name, t, rods, (ball,), 0.0) for t, name in enumerate(("lowered", "lifted")))
    final = Equilibrium(np.zeros((1, 1)), np.zeros((3, 3)), 0.0, True, None, 1, 0.0)
    return DrawnDesign.from_result(label, None, TaskResult(final, {"success_share": 1.0}, stills=stills))
