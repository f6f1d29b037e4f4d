"""What a search leaves behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pliant.records.design import Array

# What became of a candidate: evaluated; breaks a constraint or is no possible design, so that it was not evaluated;
# its simulation ended in an error or did not settle; it was evaluated and its objective is not a number.
STATUSES = ("ok", "refused", "failed", "not_a_number")


@dataclass(frozen=True)
class VariableRecord:
    """A variable of a search: the keys of the study that it sets, its type, range or choices, and its unit ("m")."""

    name: str
    keys: tuple[str, ...]
    type: str
    low: float = 0.0
    high: float = 1.0
    choices: tuple[Any, ...] = ()
    unit: str = ""
    each: bool = False


@dataclass(frozen=True, eq=False)
class SearchHistory:
    """Every candidate in the order in which it was told, one row each.

    Attributes:
        branch: (n,) index of the search that it belongs to, where a search is made for each structure; else 0.
        context: (n,) index of the one condition in which it was tried; −1 where it was tried in all.
        values: variable → (n,) values; choices by their index.
        status: (n,) index into `STATUSES`.
        objectives: (n, k), as they are minimised; NaN unless the status is ok.
        metrics: name → (n,) what the task measured, the mean over conditions; NaN unless the status is ok.
        wall_s: (n,) time of its evaluation.
    """

    branch: Array
    context: Array
    values: Mapping[str, Array]
    status: Array
    objectives: Array
    metrics: Mapping[str, Array]
    wall_s: Array

    def __len__(self) -> int:
        return len(self.branch)

    def best_so_far(self, column: int = 0) -> Array:
        """(n,) the lowest objective up to each candidate; NaN before the first."""
        return np.asarray(np.fmin.accumulate(self.objectives[:, column]))


@dataclass(frozen=True, eq=False)
class FoundDesign:
    """A design that a search has found.

    Attributes:
        values: variable → value, choices written out.
        settings: key of the study → value, SI: what the design is, written into a study.
        objectives: as they were stated (a maximised one is not negated).
        metrics: what the task measured; mean over conditions.
        conditions: condition → its metrics; one entry where the search has no conditions.
        branch, context, number: where it stands in the history; number −1: a recommendation.
        first: of one that was tried again (`search.confirm`): objectives as the search had seen them.
    """

    values: Mapping[str, Any]
    settings: Mapping[str, Any]
    objectives: Mapping[str, float]
    metrics: Mapping[str, float]
    conditions: Mapping[str, Mapping[str, float]]
    branch: int = 0
    context: int = -1
    number: int = -1
    first: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Slope:
    """How the objective changes about the best design along one variable, everything else held.

    Attributes:
        name: the variable.
        shares: (m,) values tried, as shares of its range 0…1; choices by their index.
        objective: (m,) there, NaN where the design is refused or fails.
        change: objective's change for 1 % of the range, the mean of both sides; NaN for choices.
        at_bound: "low" or "high" where the best design stands on that bound, else "".
    """

    name: str
    shares: Array
    objective: Array
    change: float
    at_bound: str = ""


@dataclass(frozen=True, eq=False)
class Verification:
    """The best design once more, its laws fitted to direct FEM.

    Attributes:
        predicted: engine → metrics by the laws that the search used.
        verified: engine → metrics by laws fitted to FEM of the design itself.
        conditions: engine → condition → verified metrics.
        laws: per distinct design of the chain, what the search's law missed of the direct one: `rmse_of_range`,
            `worst_of_range`, `n_states`, `name`.
        fem_wall_s, wall_s: time.
        notes: what could not be done, in sentences.
    """

    predicted: Mapping[str, Mapping[str, float]]
    verified: Mapping[str, Mapping[str, float]]
    conditions: Mapping[str, Mapping[str, Mapping[str, float]]]
    laws: tuple[Mapping[str, Any], ...]
    fem_wall_s: float
    wall_s: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Robustness:
    """What it costs to be robust.

    Attributes:
        measure: mean, worst or cvar.
        level: of the CVaR: the mean of the worst 1 − level.
        samples: scenarios.
        sources: what was varied, in words.
        nominal_of_nominal, robust_of_nominal: objective of the best nominal design, nominal and by the measure.
        nominal_of_robust, robust_of_robust: the same of the robust design.
        spread: design ("nominal", "robust") → (samples,) objective in each scenario.
        nominal: the best nominal design.
    """

    measure: str
    level: float
    samples: int
    sources: tuple[str, ...]
    nominal_of_nominal: float
    robust_of_nominal: float
    nominal_of_robust: float
    robust_of_robust: float
    spread: Mapping[str, Array]
    nominal: FoundDesign


@dataclass(frozen=True, eq=False)
class SearchResult:
    """A finished search.

    Attributes:
        optimizer, seed: what proposed.
        variables: what was searched.
        objectives: names as the study states them; `maximised` says which are.
        conditions: names; empty where there is one unnamed condition.
        branches: the values of the `each` variables of every search; one empty mapping where there are none.
        history: every candidate.
        best: the best design; one per condition of an optimizer with contexts; the front of several objectives.
        evaluations: candidates that were simulated; `simulations` counts the runs of the task in them.
        refused: cause → how often a candidate was turned away without simulation.
        failed: cause → how often a simulation failed or an objective was not a number.
        stopped: why it ended: "budget", "until", "exhausted".
        wall_s: of the search, all sessions together.
        slopes: the objective about the best design.
        limits: what keeps the best design from being better, in sentences.
    """

    optimizer: str
    seed: int
    variables: tuple[VariableRecord, ...]
    objectives: tuple[str, ...]
    maximised: tuple[bool, ...]
    conditions: tuple[str, ...]
    branches: tuple[Mapping[str, Any], ...]
    history: SearchHistory
    best: tuple[FoundDesign, ...]
    evaluations: int
    simulations: int
    refused: Mapping[str, int]
    failed: Mapping[str, int]
    stopped: str
    wall_s: float
    slopes: tuple[Slope, ...] = ()
    limits: tuple[str, ...] = ()
    verification: Verification | None = None
    robustness: Robustness | None = None
    files: tuple[str, ...] = field(default_factory=tuple)

    @property
    def nominal_is_robust(self) -> bool:
        """Whether a robust search has found nothing better than the best design of the nominal one."""
        beside = self.robustness
        return beside is not None and dict(beside.nominal.values) == dict(self.best[0].values)
