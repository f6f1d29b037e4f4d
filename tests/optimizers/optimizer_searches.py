"""Spaces, objectives and loops that the tests of optimizers share."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pliant_search.optimizer import Optimizer, Space, Trial, Value, Variable

NAN = float("nan")
MIXED = Space(
    (
        Variable("a", "real", -1.0, 1.0),
        Variable("n", "integer", 4, 40),
        Variable("c", "categorical", choices=("u", "v", "w", "z")),
        Variable("d", "categorical", choices=(0, 1)),
    )
)


def box(n: int, low: float = -2.0, high: float = 3.0) -> Space:
    """Return n real variables."""
    return Space(tuple(Variable(f"x{i}", "real", low, high) for i in range(n)))


def sphere(values: Mapping[str, Any]) -> float:
    """Return a sum of squares with minimum 0 at 0.7 in every variable."""
    return float(sum((v - 0.7) ** 2 for v in values.values()))


def rosenbrock(values: Mapping[str, Any]) -> float:
    """Return Rosenbrock's function, minimum 0 at 1 in every variable."""
    x = np.array(list(values.values()))
    return float(np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2))


def mixed(values: Mapping[str, Any]) -> float:
    """Return an objective with minimum 0 at a = 0.3, n = 31, c = v, d = 0."""
    by_choice = {"u": 1.0, "v": 0.0, "w": 2.0, "z": 1.5}[values["c"]]
    return float((values["a"] - 0.3) ** 2 + 0.01 * (values["n"] - 31) ** 2 + by_choice + values["d"])


def line(values: Mapping[str, Any]) -> tuple[float, float]:
    """Return the objective x₀ + x₁ and the violation of x₀² + x₁² ≤ 1: minimum −√2."""
    x = np.array(list(values.values()))
    excess = float(x @ x - 1)
    return (float(x.sum()), 0.0) if excess <= 0 else (NAN, excess)


def scored(trial: Trial, objective: Callable[[Mapping[str, Value]], Any]) -> Trial:
    """Return the candidate's result; the objective may give a number, or a number and a violation."""
    given = objective(trial.values)
    value, violation = given if isinstance(given, tuple) else (given, 0.0)
    return trial.scored(value, violation=violation)


def search(
    optimizer: Optimizer, objective: Callable[[Mapping[str, Value]], Any], candidates: int
) -> list[tuple[Trial, Trial]]:
    """Call ask and tell, in batches, until at least `candidates` results are reported."""
    done: list[tuple[Trial, Trial]] = []
    while len(done) < candidates:
        asked = optimizer.ask(optimizer.batch)
        outcomes = [scored(c, objective) for c in asked]
        optimizer.tell(outcomes[::-1])
        done += zip(asked, outcomes, strict=True)
    return done


def best(done: list[tuple[Trial, Trial]]) -> tuple[Trial, Trial]:
    """Return the lowest objective."""
    return min(
        (pair for pair in done if pair[1].objective == pair[1].objective), key=lambda p: p[1].objective
    )


def resumed(optimizer: Any) -> Any:
    """Return another optimizer restored from the state, as JSON."""
    again = type(optimizer)(optimizer.config)
    again.restore(json.loads(json.dumps(optimizer.state(), allow_nan=False)))
    return again


def require_goes_on(
    optimizer: Optimizer, late: Sequence[Trial], objective: Callable[[Mapping[str, Value]], Any], more: int
) -> None:
    """Check that the optimizer and a resumed one propose the same after the late results are reported to both."""
    traces = []
    for one in (optimizer, resumed(optimizer)):
        one.tell(late)
        traces.append([(c.number, dict(c.values)) for c, _ in search(one, objective, more)])
    assert traces[0] == traces[1]
