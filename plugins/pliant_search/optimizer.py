"""Optimizer: a search algorithm that proposes designs and uses their scores."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, Self

from pliant.interfaces.base import ComponentConfig, Configured

Value = float | int | str


class OptimizerConfig(ComponentConfig):
    """Base of an optimizer's config."""


@dataclass(frozen=True)
class Variable:
    """One axis of a search: `real` and `integer` have low and high, `categorical` has choices."""

    name: str
    type: Literal["real", "integer", "categorical"]
    low: float = 0.0
    high: float = 1.0
    choices: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Context:
    """A condition for which a contextual optimizer finds a separate design: features (k,) of order one."""

    name: str
    features: tuple[float, ...] = ()


@dataclass(frozen=True)
class Space:
    """Search space.

    Attributes:
        variables: the axes.
        objectives: number of objectives, all minimised; more than one only for optimizers that support several.
        contexts: conditions, in one of which each candidate is evaluated; empty unless the optimizer supports contexts.
        start: a value for each variable, from which the search may start; empty without prior knowledge.
        spread: expected distance of the best from `start`, as a share of each variable's range; None: anywhere.
    """

    variables: tuple[Variable, ...]
    objectives: int = 1
    contexts: tuple[Context, ...] = ()
    start: Mapping[str, Value] = field(default_factory=dict)
    spread: float | None = None

    def values(self, shares: Sequence[float]) -> dict[str, Value]:
        """Return the variables' values at shares of their ranges, each 0 to 1; choices are equal parts of theirs."""
        found: dict[str, Value] = {}
        for variable, share in zip(self.variables, shares, strict=True):
            low, high, choices = variable.low, variable.high, variable.choices
            if variable.type == "categorical":
                found[variable.name] = choices[min(int(share * len(choices)), len(choices) - 1)]
            else:
                value = min(max(low + share * (high - low), low), high)
                found[variable.name] = round(value) if variable.type == "integer" else value
        return found

    def as_json(self) -> dict[str, Any]:
        """Return the space as dicts, lists, numbers and texts, for the state of an optimizer."""
        return {
            "variables": [{**asdict(v), "choices": list(v.choices)} for v in self.variables],
            "objectives": self.objectives,
            "contexts": [{"name": c.name, "features": list(c.features)} for c in self.contexts],
            "start": dict(self.start),
            "spread": self.spread,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """Return the space from the output of `as_json`."""
        return cls(
            variables=tuple(Variable(**{**v, "choices": tuple(v["choices"])}) for v in values["variables"]),
            objectives=int(values["objectives"]),
            contexts=tuple(Context(c["name"], tuple(c["features"])) for c in values["contexts"]),
            start=dict(values["start"]),
            spread=values["spread"],
        )


@dataclass(frozen=True)
class OptimizerCapabilities:
    """Capabilities of an optimizer, which the search checks before it starts.

    Attributes:
        several_objectives: it returns a Pareto front instead of one best candidate.
        contexts: it learns the best design of each condition from candidates evaluated in different conditions.
    """

    several_objectives: bool = False
    contexts: bool = False


PROPOSED: Final = "proposed"
OK: Final = "ok"
REFUSED: Final = "refused"
FAILED: Final = "failed"
NOT_A_NUMBER: Final = "not_a_number"
POLISHED: Final = -2  # number of a trial of `search.polish`
State = Literal["proposed", "ok", "refused", "failed", "not_a_number"]


@dataclass(frozen=True)
class Trial:
    """One candidate of a search, from its proposal to its result.

    Attributes:
        number: identifies it to its optimizer, from 0; −1: a recommendation, or not proposed by an optimizer;
            −2: of a descent (`search.polish`).
        values: one per variable; outside the optimizer also those of the `each` variables.
        context: index of its single condition; −1: all conditions.
        state: `proposed`, then `ok`; `refused` breaks a constraint of variables or is an impossible design, and was not
            simulated; `failed` ended in an error or did not settle; `not_a_number` has a NaN objective.
        objectives: as minimised, over conditions and scenarios; empty or NaN unless the state is `ok`.
        violation: sum of the violations of constraints, including those on metrics; 0 if all are satisfied.
        cause: why the state is not `ok`; if it is, the violated constraints on metrics.
        metrics: numbers that the task measured, SI; mean over the conditions, without scenarios.
        conditions: condition → its metrics.
        scenarios: first objective in each scenario of a robust search.
        simulations: runs of the task.
        wall_s: time of the evaluation.
        first: objectives during the search, if the trial was re-evaluated (`search.confirm`).
    """

    number: int
    values: Mapping[str, Value]
    context: int = -1
    state: State = PROPOSED
    objectives: tuple[float, ...] = ()
    violation: float = 0.0
    cause: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)
    conditions: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    scenarios: tuple[float, ...] = ()
    simulations: int = 0
    wall_s: float = 0.0
    first: tuple[float, ...] = ()

    @property
    def objective(self) -> float:
        """The first objective, minimised; NaN without objectives."""
        return self.objectives[0] if self.objectives else math.nan

    @property
    def simulated(self) -> bool:
        """Return whether the trial counts as an evaluation."""
        return self.state not in (PROPOSED, REFUSED)

    @property
    def feasible(self) -> bool:
        """Return whether the trial may be the best."""
        return self.state == OK and self.violation <= 0.0 and all(map(math.isfinite, self.objectives))

    def scored(self, *objectives: float, violation: float = 0.0) -> Trial:
        """Return the trial with these objectives; failed if one is not finite, refused if it violates a constraint."""
        bad: State = REFUSED if violation > 0.0 else FAILED
        state: State = OK if all(map(math.isfinite, objectives)) else bad
        return replace(self, state=state, objectives=objectives, violation=violation)

    def failed(self, cause: str) -> Trial:
        """Return the trial with the state `failed` and its cause."""
        return replace(self, state=FAILED, cause=cause)

    def refused(self, broken: Mapping[str, float]) -> Trial:
        """Return the trial refused for violated constraints of variables (text → violation)."""
        return replace(self, state=REFUSED, violation=float(sum(broken.values())), cause="; ".join(broken))

    def told(self, objectives: int) -> Trial:
        """Return the trial for `tell`: with all objectives, NaN unless evaluated; a refused one has a violation."""
        scores = self.objectives if self.state == OK else (math.nan,) * objectives
        rule = self.state == REFUSED and not self.violation > 0.0
        return replace(self, objectives=scores, violation=1.0 if rule else self.violation)


class Optimizer(Configured[OptimizerConfig]):
    """Ask-and-tell interface. The search calls `ask` for a batch, evaluates it in any order, and passes it to `tell`.

    The same seed, space and results give the same proposals. `state` and `restore` resume a search after an
    interruption.
    """

    capabilities: ClassVar[OptimizerCapabilities] = OptimizerCapabilities()

    @property
    def batch(self) -> int:
        """Return the number of candidates of one generation of a started search."""
        return 8

    def remarks(self, candidates: int | None) -> Sequence[str]:
        """Return sentences on keys of its config that have no effect in a search of this many candidates.

        A key is written `optimizer.key`. `candidates` is None if the search consists of whole batches.
        """
        return ()

    def space_remarks(self, space: Space) -> Sequence[str]:
        """Return sentences on variables of the space that the optimizer does not learn."""
        return ()

    @abstractmethod
    def start(self, space: Space, seed: int) -> None:
        """Start a search of this space; the same seed gives the same trials."""

    @abstractmethod
    def ask(self, count: int) -> Sequence[Trial]:
        """Return one to `count` new trials, every value within its variable's bounds."""

    @abstractmethod
    def tell(self, trials: Sequence[Trial]) -> None:
        """Learn from evaluated trials; NaN objectives (failed, refused) and violations above 0 must be accepted.

        A trial that violates a constraint of variables was not evaluated, and its objectives are NaN; one that violates
        a constraint on metrics was evaluated and has both objectives and a violation.
        """

    @abstractmethod
    def state(self) -> Mapping[str, Any]:
        """Return the search as JSON values."""

    @abstractmethod
    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue a search exactly from a saved `state`; replaces `start`."""

    def recommend(self) -> Sequence[Trial]:
        """Return the learned optimum, one trial per context: the mean of a policy. Empty: the best evaluated trial."""
        return ()

    def export(self, folder: Path) -> Sequence[Path]:
        """Write files for other programs (a policy, a database of trials, logs); return the written files."""
        return ()
