"""What the checks of an `Optimizer` share: spaces, scores, rounds of ask and tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pliant.interfaces.optimizer import Context, Optimizer, Space, Trial, Value, Variable
from pliant.records.design import Array
from pliant.testing.suite import Finding, Subject, require

MIXED = Space(
    (
        Variable("length", "real", -0.02, 0.05),
        Variable("modules", "integer", 5, 10),
        Variable("side", "categorical", choices=("left", "right", "both")),
    )
)
PLANE = Space((Variable("a", "real", -1.0, 2.0), Variable("b", "real", -2.0, 1.0)))
TWO_ENDS = Space(tuple(Variable(name, "real", -2.0, 2.0) for name in "abcd"), objectives=2)
TWO_PLACES = Space(
    (Variable("a", "real", -1.0, 1.0), Variable("b", "real", -1.0, 1.0)),
    contexts=(Context("left", (-1.0,)), Context("right", (1.0,))),
)
BATCH = 8
Score = Callable[[Trial], Trial]


def started(subject: Subject, space: Space = MIXED, seed: int = 3) -> Optimizer:
    """A new optimizer that has begun to search."""
    optimizer: Optimizer = subject.build()
    optimizer.start(space, seed)
    return optimizer


def squares(trial: Trial) -> float:
    """Sum of the squares of all numbers."""
    return sum(float(v) ** 2 for v in trial.values.values() if not isinstance(v, str))


def sphere(trial: Trial) -> Trial:
    """Its minimum is where every number is 0."""
    return trial.scored(squares(trial))


def two_ends(trial: Trial) -> Trial:
    """Squared distances to two points: the best compromises lie between them, f₁ = 4 t², f₂ = 4 (1 − t)²."""
    x = np.array([float(v) for v in trial.values.values()])
    return trial.scored(float(np.sum((x - 0.5) ** 2)), float(np.sum((x + 0.5) ** 2)))


def two_places(trial: Trial) -> Trial:
    """A paraboloid whose minimum is at a = −0.5 in the first context and at a = +0.5 in the second."""
    minimum = 0.5 if trial.context else -0.5
    a, b = float(trial.values["a"]), float(trial.values["b"])
    return trial.scored((a - minimum) ** 2 + b**2)


def half_plane(trial: Trial) -> Trial:
    """A paraboloid in the corner of the plane where a + b ≤ −1; the other 78 % are refused, half of them after they
    were evaluated, as where a metric breaks the constraint: to an objective below all that are allowed.
    """
    a, b = float(trial.values["a"]), float(trial.values["b"])
    if a + b > -1:
        return trial.scored(-1.0 if trial.number % 2 else math.nan, violation=a + b + 1)
    return trial.scored((a + 0.7) ** 2 + (b + 1.3) ** 2)


def generation(optimizer: Optimizer, score: Score = sphere, count: int = BATCH) -> Sequence[Trial]:
    """Ask, score, tell; the candidates."""
    asked = optimizer.ask(count)
    optimizer.tell([score(c) for c in asked])
    return asked


def proposals(optimizer: Optimizer, rounds: int = 3) -> list[tuple[int, int, dict[str, Value]]]:
    """What it proposes on a sphere."""
    return [(c.number, c.context, dict(c.values)) for _ in range(rounds) for c in generation(optimizer)]


def require_within(space: Space, values: Mapping[str, Value]) -> None:
    """Raise `Finding` unless there is a fitting value for every variable and no other."""
    names = [v.name for v in space.variables]
    require(set(values) == set(names), f"a candidate has values for {sorted(values)}, the search for {names}")
    for variable in space.variables:
        _require_value(variable, values[variable.name])


def _require_value(variable: Variable, value: Value) -> None:
    name = f"variable '{variable.name}'"
    if variable.type == "categorical":
        require(value in variable.choices, f"{name} is {value!r}, not one of {variable.choices}")
        return
    if isinstance(value, str) or not np.isfinite(value):
        raise Finding(f"{name} is {value!r}, not a finite number")
    require(
        variable.low <= value <= variable.high,
        f"{name} is {value!r}, not in [{variable.low}, {variable.high}]",
    )
    if variable.type == "integer":
        require(isinstance(value, int) and not isinstance(value, bool), f"{name} is {value!r}, not an int")


def hypervolume(points: Array, corner: float) -> float:
    """Area that points (n, 2) dominate within [0, corner]²."""
    area, height = 0.0, corner
    for first, second in sorted(points.tolist()):
        if first < corner and second < height:
            area += (corner - first) * (height - second)
            height = second
    return area
