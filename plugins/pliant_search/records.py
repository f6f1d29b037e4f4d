"""Records of a finished search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pliant.records.design import Array

# States of a candidate: evaluated; not evaluated, since it breaks a constraint or is an impossible design;
# its simulation ended in an error or did not settle; evaluated with an objective that is not a number.
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
    """All candidates in the order of `tell`, one row each.

    Attributes:
        branch: (n,) index of its search, if there is a search for each structure; else 0.
        context: (n,) index of the single condition in which it was evaluated; −1 for all conditions.
        values: variable → (n,) values; choices by their index.
        status: (n,) index into `STATUSES`.
        objectives: (n, k), as minimised; NaN unless the status is ok.
        metrics: name → (n,) metric of the task, mean over conditions; NaN unless the status is ok.
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
        """Return (n,) the lowest objective up to each candidate; NaN before the first."""
        return np.asarray(np.fmin.accumulate(self.objectives[:, column]))


@dataclass(frozen=True, eq=False)
class FoundDesign:
    """A design found by a search.

    Attributes:
        values: variable → value, choices written out.
        settings: key of the study → value, SI: the design as settings of a study.
        objectives: as stated (a maximised one is not negated).
        metrics: of the task; mean over conditions.
        conditions: condition → its metrics; one entry if the search has no conditions.
        branch, context, number: its position in the history; number −1: a recommendation,
            −2: of a descent.
        first: objectives during the search, if it was re-evaluated (`search.confirm`).
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
    """Change of the objective around the best design along one variable, with all others fixed.

    Attributes:
        name: the variable.
        shares: (m,) evaluated values, as shares of its range 0…1; choices by their index.
        objective: (m,) at these values, NaN if the design is refused or fails.
        change: objective's change for 1 % of the range, the mean of both sides; NaN for choices.
        at_bound: "low" or "high" if the best design is on that bound, else "".
    """

    name: str
    shares: Array
    objective: Array
    change: float
    at_bound: str = ""


@dataclass(frozen=True, eq=False)
class Verification:
    """Verification of the best design with laws fitted to direct FEM.

    Attributes:
        predicted: engine → metrics by the laws that the search used.
        verified: engine → metrics by laws fitted to FEM of the design itself.
        conditions: engine → condition → verified metrics.
        laws: per distinct design of the chain, errors of the search's law against the direct one: `rmse_of_range`,
            `worst_of_range`, `n_states`, `name`.
        fem_wall_s, wall_s: time.
        notes: parts of the check that failed, in sentences.
        broken: engine → constraints on metrics that the verified metrics violate → violation (of order 0…1).
    """

    predicted: Mapping[str, Mapping[str, float]]
    verified: Mapping[str, Mapping[str, float]]
    conditions: Mapping[str, Mapping[str, Mapping[str, float]]]
    laws: tuple[Mapping[str, Any], ...]
    fem_wall_s: float
    wall_s: float
    notes: tuple[str, ...] = ()
    broken: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Robustness:
    """Cost of robustness.

    Attributes:
        measure: mean, worst or cvar.
        level: of the CVaR: the mean of the worst 1 − level.
        samples: scenarios.
        sources: the varied quantities, in words.
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


@dataclass(frozen=True)
class PolishedCandidate:
    """A descent of `search.polish` from one of the best candidates.

    Attributes:
        branch: of the candidate.
        before, after: objective as stated, of the candidate and of the best one on the way.
        evaluations: candidates that were simulated; the candidate itself is not counted again.
        steps: slopes that were found.
        converged: whether its steps had become small.
        obstacle: why it could not begin, as part of a sentence; "" where it could.
    """

    branch: int
    before: float
    after: float
    evaluations: int
    steps: int
    converged: bool
    obstacle: str = ""


@dataclass(frozen=True, eq=False)
class SearchRound:
    """A search whose best design violated a constraint by direct FEM or leant on extrapolation.

    The next search had its FEM among the meta-model's data.

    Attributes:
        best: the refused design.
        broken: constraints that it violates in the study's engine → violation (of order 0…1).
        worst_of_range: error of the search's law against FEM there, relative to its range; NaN if not known.
        evaluations: candidates that were simulated.
        table: the meta-model's data of the next search, a file in the store.
        leaning: why it leant on extrapolation, as parts of a sentence.
    """

    best: FoundDesign
    broken: Mapping[str, float]
    worst_of_range: float
    evaluations: int
    table: str
    leaning: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SearchResult:
    """A finished search.

    Attributes:
        optimizer, seed: of the proposals.
        variables: of the search.
        objectives: names as the study states them; `maximised` marks the maximised ones.
        conditions: names; empty for one unnamed condition.
        branches: the values of the `each` variables of every search; one empty mapping without such variables.
        history: every candidate.
        best: the best design; one per condition of an optimizer with contexts; the front of several objectives.
        evaluations: candidates that were simulated; `simulations` counts the runs of the task in them.
        refused: cause → number of candidates refused without simulation.
        failed: cause → number of failed simulations and of objectives that were not a number.
        stopped: why it ended: "budget", "until", "exhausted".
        wall_s: of the search, summed over sessions.
        slopes: of the objective around the best design.
        limits: sentences on what limits the best design.
        refused_by_check: designs that the search ranked higher and that violate a constraint by direct FEM.
        rounds: earlier searches, the FEM of whose best designs this one used.
        polished: descents from the best candidates, in their order.
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
    refused_by_check: tuple[FoundDesign, ...] = ()
    rounds: tuple[SearchRound, ...] = ()
    polished: tuple[PolishedCandidate, ...] = ()

    @property
    def nominal_is_robust(self) -> bool:
        """Return whether a robust search found nothing better than the best nominal design."""
        beside = self.robustness
        return beside is not None and dict(beside.nominal.values) == dict(self.best[0].values)
