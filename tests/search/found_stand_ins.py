"""A search problem of formulas that follows the signatures of `SearchProblem` and `Evaluator`."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from pliant_search.optimizer import Space, Variable
from pliant_search.records import FoundDesign, SearchHistory, VariableRecord

WIDTH = VariableRecord("width", ("family.width",), "real", 2e-3, 4e-3, unit="m")
COUNT = VariableRecord("count", ("chain.modules",), "integer", 2, 8)
SIDE = VariableRecord("side", ("chain.side",), "categorical", choices=("left", "right"))


@dataclass
class Problem:
    """Variables by their records; constraints as text → function of the values, positive where broken."""

    listed: tuple = (WIDTH, COUNT, SIDE)
    rules: dict = field(default_factory=dict)
    metric_rules: dict = field(default_factory=dict)
    structures: tuple = ({},)
    goal: float = -np.inf
    objective_names: tuple = ("rmse",)
    maximised: tuple = (False,)
    conditions: tuple = (SimpleNamespace(name="all"),)
    structural: frozenset = frozenset()

    @property
    def variables(self):
        return tuple(
            SimpleNamespace(
                name=r.name,
                variable=Variable(r.name, r.type, r.low, r.high, r.choices),
                conditions=(0, 1, 2),
                each=r.each,
            )
            for r in self.listed
        )

    def records(self):
        return self.listed

    def space(self, contextual=False):
        return Space(tuple(one.variable for one in self.variables))

    def branches(self):
        return self.structures

    def violated(self, values, condition=-1):
        return {text: amount for text, rule in self.rules.items() if (amount := rule(values)) > 0}

    def metric_violations(self, values, metrics):
        return {text: amount for text, rule in self.metric_rules.items() if (amount := rule(metrics)) > 0}

    def objective_values(self, values, metrics):
        return (-metrics["rmse_m"] if self.maximised[0] else metrics["rmse_m"],)

    def reached(self, values, metrics):
        return metrics["rmse_m"] <= self.goal


@dataclass
class Evaluator:
    """An evaluator of a formula that refuses violations of the problem's constraints and records its calls."""

    problem: Problem
    formula: object
    asked: list = field(default_factory=list)

    def evaluate(self, values, context=-1):
        self.asked.append((dict(values), context))
        if self.problem.violated(values):
            return SimpleNamespace(state="refused", objectives=(), violation=1.0)
        found = self.formula(values)
        return SimpleNamespace(
            state="ok" if np.isfinite(found) else "not_a_number", objectives=(found,), violation=0.0
        )


def many(evaluator):
    """Evaluate trials one after another."""
    return lambda trials: [evaluator.evaluate(trial.values, trial.context) for trial in trials]


def found(values, rmse_m=1e-3, conditions=None, **others):
    """Return a design with one metric."""
    metrics = {"rmse_m": rmse_m, "outside_domain": 0.0}
    return FoundDesign(values, {}, {"rmse": rmse_m}, metrics, conditions or {"all": metrics}, **others)


def history(objective, branch=None, status=None, context=-1):
    """Return one row for each objective."""
    objective = np.asarray(objective, float)
    n = len(objective)
    return SearchHistory(
        np.zeros(n) if branch is None else np.asarray(branch),
        np.full(n, context) if np.ndim(context) == 0 else context,
        {"width": np.full(n, 3e-3)},
        np.zeros(n) if status is None else np.asarray(status),
        objective[:, None],
        {"rmse_m": objective},
        np.zeros(n),
    )
