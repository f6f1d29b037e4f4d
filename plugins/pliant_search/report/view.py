"""The data of a search's page: variables and objectives with labels, display units and positions on axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import NamedUnit, named_unit, number, plural, unbroken
from pliant.records.design import Array
from pliant.units import split_unit, strip_unit_suffix
from pliant_search.problem.names import acts, objective_unit
from pliant_search.records import STATUSES, FoundDesign, Robustness, SearchResult, Slope, VariableRecord


@dataclass(frozen=True, eq=False)
class Axis:
    """A variable for display.

    Attributes:
        variable: that of the record.
        unit: its display unit, with its short label.
        values: (n,) of every candidate in that unit, choices by their index; NaN without one.
    """

    variable: VariableRecord
    unit: NamedUnit
    values: Array

    @property
    def name(self) -> str:
        """The variable's name in the study."""
        return self.variable.name

    @cached_property
    def choices(self) -> tuple[str, ...]:
        """The choices as texts; empty for a range."""
        return tuple(self.text(choice) for choice in self.variable.choices)

    @property
    def low(self) -> float:
        """Lower end of the range in the shown unit, or the first index of choices."""
        return 0.0 if self.choices else self.variable.low * self.unit.factor

    @property
    def high(self) -> float:
        """Upper end of the range in the shown unit, or the last index of choices."""
        return len(self.choices) - 1.0 if self.choices else self.variable.high * self.unit.factor

    @property
    def title(self) -> str:
        """Label and unit: ``radius (mm)``."""
        return self.unit.label if self.choices else self.unit.axis

    def place(self, value: Any) -> float:
        """Return a value of a `FoundDesign` in the shown unit, or the index of a choice; NaN if it is unknown."""
        if value is None:
            return float("nan")
        if self.choices:
            numeric = isinstance(value, int | float)
            alike = (
                np.isclose(c, value, rtol=1e-9, atol=1e-12)
                if numeric and isinstance(c, int | float)
                else c == value
                for c in self.variable.choices
            )
            return float(next((k for k, same in enumerate(alike) if same), np.nan))
        return float(value) * self.unit.factor

    def text(self, value: Any) -> str:
        """Return a value of a `FoundDesign` with its unit."""
        if value is None or isinstance(value, bool | str):
            return value if isinstance(value, str) else number(value)
        return self.unit.text(round(value) if self.variable.type == "integer" else value)

    def tick(self, shown: float) -> str:
        """Return a value on the axis, without unit."""
        if self.choices:
            return self.choices[min(max(round(shown), 0), len(self.choices) - 1)]
        return number(round(shown) if self.variable.type == "integer" and not self.unit.symbol else shown, 4)

    def share(self, shown: Array | float) -> Array:
        """Return values as shares of the range, 0…1; the middle of a range without width."""
        width, above = self.high - self.low, np.asarray(shown, float) - self.low
        return above / width if width > 0 else 0.5 + 0 * above


@dataclass(frozen=True)
class Objective:
    """An objective: its text in the study, its label and unit, its direction, and its metric, if it is one."""

    name: str
    unit: NamedUnit
    maximised: bool
    column: int = 0
    metric: str = ""

    @property
    def best_word(self) -> str:
        """The word for better values: low or high."""
        return "higher is better" if self.maximised else "lower is better"

    def stated(self, minimised: Array | float) -> Array:
        """Return values as the study states them, in the shown unit, from minimised values (SI)."""
        return np.asarray(minimised, float) * self.unit.factor * (-1.0 if self.maximised else 1.0)


def labelled_metric_unit(metric: str) -> NamedUnit:
    """Return a metric's label and display unit: ``rmse (mm)``."""
    stem, si = split_unit(metric)
    return named_unit(stem.replace("_", " "), si)


def short_labels(names: Sequence[str]) -> list[str]:
    """Return the last parts of dotted names as words, with as many parts as distinguish them."""
    words = [[strip_unit_suffix(part) for part in name.split(".")] for name in names]
    found = []
    for parts in words:
        for count in range(1, len(parts) + 1):
            if sum(other[-count:] == parts[-count:] for other in words) == 1:
                break
        found.append(" ".join(parts[-count:]).replace("_", " "))
    return found


OK = STATUSES.index("ok")
SHOWN_SHARE = 97.0  # percent of the candidates that a linear axis shows; the rest is drawn at its edge
LONGEST = 40  # characters of an objective in a label
NO_RESULT = ("trials", "outside_domain")  # of the check, but not metrics

Shape = Literal["one", "contextual", "front", "none"]


@dataclass(frozen=True, eq=False)
class SearchView:
    """A search's record with its study (all defaults, SI)."""

    result: SearchResult
    study: Mapping[str, Any]

    @cached_property
    def shape(self) -> Shape:
        """Return the kind of outcome: one best design, one per condition, a front, or nothing."""
        if not self.result.best:
            return "none"
        if len(self.result.objectives) > 1:
            return "front"
        return "contextual" if self.contextual else "one"

    @property
    def contextual(self) -> bool:
        """Return whether each candidate was tried in one of the conditions."""
        return bool((np.asarray(self.result.history.context) >= 0).any()) and len(self.result.conditions) > 1

    @cached_property
    def ok(self) -> NDArray[np.bool_]:
        """(n,) candidates with a number for each objective."""
        history = self.result.history
        objectives = np.asarray(history.objectives, float).reshape(len(history), -1)
        return np.asarray((np.asarray(history.status) == OK) & np.isfinite(objectives).all(axis=1))

    @property
    def broken(self) -> NDArray[np.bool_]:
        """(n,) candidates that were evaluated and break a constraint on metrics."""
        return np.asarray((np.asarray(self.result.history.status) == OK) & ~self.ok)

    @property
    def best(self) -> FoundDesign | None:
        """The design that the page describes first."""
        return self.result.best[0] if self.result.best else None

    @cached_property
    def objectives(self) -> tuple[Objective, ...]:
        """The objectives in the study's order."""
        names = dict.fromkeys(
            [*self.result.history.metrics, *(n for d in self.result.best for n in d.metrics)]
        )
        metrics = {strip_unit_suffix(name): name for name in names}
        found: list[Objective] = []
        for name, maximised in zip(self.result.objectives, self.result.maximised, strict=True):
            if metric := metrics.get(strip_unit_suffix(name), ""):
                unit = labelled_metric_unit(metric)
            else:
                unit = named_unit(name, objective_unit(name, self.result.variables, {}))
            if len(unit.label) > LONGEST:
                unit = replace(unit, label=f"{unit.label[: LONGEST - 1]}…")
            found.append(Objective(name, unit, maximised, len(found), metric))
        return tuple(found)

    @property
    def objective(self) -> Objective:
        """The first objective, which orders the designs."""
        return self.objectives[0]

    def scores(self, column: int = 0) -> Array:
        """Return (n,) an objective of every candidate as stated, in its unit; NaN without one."""
        history = self.result.history
        column_of = np.asarray(history.objectives, float).reshape(len(history), -1)[:, column]
        return np.where(self.ok, self.objectives[column].stated(column_of), np.nan)

    def order(self) -> NDArray[np.int64]:
        """Return the rows of the evaluated candidates, best first by the first objective."""
        rows = np.flatnonzero(self.ok)
        minimised = np.asarray(self.result.history.objectives, float).reshape(len(self.ok), -1)[rows, 0]
        return np.asarray(rows[np.argsort(minimised, kind="stable")])

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """The variables; those merged by an optimizer with contexts come last, as shares of their range."""
        history, variables = self.result.history, self.result.variables
        labels = short_labels([v.name for v in variables])
        found = [self._axis(v, label) for v, label in zip(variables, labels, strict=True)]
        known = {v.name for v in variables}
        for name in history.values:
            if name not in known:
                values = np.asarray(history.values[name], float)
                found.append(
                    Axis(VariableRecord(name, (), "real"), named_unit(short_labels([name])[0]), values)
                )
        return tuple(found)

    def varied(self) -> list[Axis]:
        """Return the axes on which at least one candidate has a value."""
        return [axis for axis in self.axes if np.isfinite(axis.values).any()]

    def branch_names(self) -> list[str]:
        """Return every branch by its values: ``5 · 6 · 7``."""
        text = {axis.name: axis.text for axis in self.axes}
        return [" · ".join(text.get(n, str)(v) for n, v in branch.items()) for branch in self.result.branches]

    def branch_title(self) -> str:
        """Return the meaning of the parts of a branch's name."""
        labels, branches = {axis.name: axis.unit.label for axis in self.axes}, self.result.branches
        return " · ".join(labels.get(name, name) for name in (branches[0] if branches else ()))

    def branch_winners(self) -> list[tuple[int, int]]:
        """Return (branch, row of its best candidate), best first, without branches that have none."""
        found: dict[int, int] = {}
        for row in self.order().tolist():
            found.setdefault(int(self.result.history.branch[row]), row)
        return list(found.items())

    def design_names(self) -> list[str]:
        """Return the names of the best designs."""
        best = self.result.best
        if self.shape == "contextual":
            return [self.condition(design.context) for design in best]
        if len(best) == 1:
            return ["best design"]
        return [f"design {index + 1}" for index in range(len(best))]

    def value(self, design: FoundDesign, name: str) -> Any:
        """Return a variable's value in a design; None if another one sets its key in the design's condition."""
        variable = next((v for v in self.result.variables if v.name == name), None)
        if variable is not None and name in design.values and not acts(variable, design):
            return None
        return design.values.get(name)

    def condition(self, context: int) -> str:
        """Return the name of a condition."""
        names = self.result.conditions
        return names[context] if 0 <= context < len(names) else "all conditions"

    def by_influence(self) -> list[Slope]:
        """Return slopes of known variables, those whose range changes the objective most first."""
        known = {axis.name for axis in self.axes}
        return sorted((s for s in self.result.slopes if s.name in known), key=lambda s: -self.influence(s))

    @staticmethod
    def influence(slope: Slope) -> float:
        """Return the largest change of the objective over the range that could be evaluated."""
        finite = np.asarray(slope.objective, float)[np.isfinite(slope.objective)]
        return float(np.ptp(finite)) if len(finite) else 0.0

    def checked_metrics(self) -> list[str]:
        """Return metrics with a prediction and a check in one engine, that of the objective first."""
        found = self.result.verification
        both = dict.fromkeys(
            name
            for engine, metrics in (found.verified if found is not None else {}).items()
            for name in metrics
            if name in found.predicted.get(engine, {}) and name not in NO_RESULT  # type: ignore[union-attr]
        )
        return sorted(both, key=lambda name: name != self.objective.metric)

    def success_counts(self) -> dict[str, dict[str, tuple[int, int]]]:
        """Return engine → condition → (stable grasps, trials); empty if a share is not a whole number of trials."""
        counts: dict[str, dict[str, tuple[int, int]]] = {}
        found = self.result.verification
        for engine, conditions in (found.conditions if found is not None else {}).items():
            for name, metrics in conditions.items():
                share, trials = metrics.get("success_share"), self.trials(metrics)
                if share is None or not trials or abs(share * trials - round(share * trials)) > 1e-6:
                    return {}
                counts.setdefault(engine, {})[name or "all trials"] = (round(share * trials), trials)
        return counts

    def trials(self, metrics: Mapping[str, float]) -> int | None:
        """Return the trials behind these metrics of the check: their own count, else the study's; None without any."""
        if metrics.get("trials"):
            return round(metrics["trials"])
        check = (self.study.get("search") or {}).get("verify") or {}
        changed = (check.get("change") or {}).get("task.trials")
        stated = changed if changed is not None else (self.study.get("task") or {}).get("trials")
        return int(stated) if stated is not None else None

    def _axis(self, variable: VariableRecord, label: str) -> Axis:
        history, unit = self.result.history, named_unit(label, variable.unit)
        values = np.full(len(history), np.nan)
        axis = Axis(variable, unit, values)
        if variable.name in history.values:
            factor = 1.0 if variable.choices else unit.factor
            values[:] = np.asarray(history.values[variable.name], float) * factor
        elif variable.each and len(history):
            placed = np.array([axis.place(b.get(variable.name)) for b in self.result.branches])
            values[:] = placed[np.asarray(history.branch, int)]
        return axis


def evenly_spaced(count: int, most: int) -> list[int]:
    """Return at most `most` of the numbers below `count`, evenly spread, both ends among them."""
    if count <= most:
        return list(range(count))
    return [int(k) for k in np.unique(np.linspace(0, count - 1, most).round())]


def shown_range(scores: Array, maximised: bool) -> tuple[float, float]:
    """Return the range, without the worst few where these would take most of it."""
    finite = scores[np.isfinite(scores)]
    low, high = float(finite.min()), float(finite.max())
    cut = float(np.percentile(finite, 100 - SHOWN_SHARE if maximised else SHOWN_SHARE))
    if maximised:
        return (cut, high) if high - low > 2.5 * (high - cut) > 0 else (low, high)
    return (low, cut) if high - low > 2.5 * (cut - low) > 0 else (low, high)


def log_suits(values: Array) -> bool:
    """Return whether positive values spread so widely that a log axis shows more."""
    finite = values[np.isfinite(values)]
    if not len(finite) or finite.min() <= 0:
        return False
    return bool(np.percentile(finite, 90) > 8 * finite.min())


def measure_words(robustness: Robustness) -> str:
    """Return the measure in words."""
    return (
        f"mean of the worst {100 * (1 - robustness.level):.3g} %"
        if robustness.measure == "cvar"
        else robustness.measure
    )


def price(read: SearchView) -> str:
    """Return the cost of robustness without deviations, and its gain with them."""
    found, objective = read.result.robustness, read.objective
    assert found is not None
    a, b, c, d = (
        objective.unit.text(value)
        for value in (
            found.nominal_of_nominal, found.nominal_of_robust, found.robust_of_nominal, found.robust_of_robust,
        )
    )  # fmt: skip
    over = f"the {measure_words(found)} over {plural(found.samples, 'scenario')}"
    if read.result.nominal_is_robust:
        return unbroken(
            f"The best nominal design is the most robust one that was found: {d} as {over}, {b} where nothing deviates."
        )
    worse = -objective.unit.factor if objective.maximised else objective.unit.factor
    cost = worse * (found.nominal_of_robust - found.nominal_of_nominal)
    gain = worse * (found.robust_of_nominal - found.robust_of_robust)
    size, by = (objective.unit.attached(number(abs(v), 3)) for v in (cost, gain))
    of = f"{size} of {objective.unit.label}" if cost > 0 else "nothing"
    return unbroken(
        f"Being robust costs {of} where nothing deviates ({a} of the nominal design, {b} of the robust one) and "
        f"{'improves' if gain > 0 else 'does not improve'} {over}{f' by {by}' if gain > 0 else ''} ({c} against {d})."
    )
