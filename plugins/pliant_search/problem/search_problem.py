"""Problem of a study's `search` block: variables, conditions, constraints and objectives, parsed once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.config.study_keys import KeyPath, study_key
from pliant.errors import UserError, closest
from pliant.formatting import quantity
from pliant.records.design import Array
from pliant.registry.discovery import Registry
from pliant.registry.files import with_files
from pliant.units import strip_unit_suffix
from pliant_search.config import SearchConfig
from pliant_search.expressions import Expression, parse
from pliant_search.optimizer import Context, Space, Trial, Value, Variable
from pliant_search.problem.names import FormulaNames, metric_name
from pliant_search.problem.study_setter import StudySetter, changed
from pliant_search.records import VariableRecord
from pliant_search.variables import Condition, SearchedVariable, search_conditions, search_variables

NO_NUMBER = 1.0  # violation of a constraint whose value is not a number
MOST_BRANCHES = 100_000
MOST_TRIED = 20_000_000  # partial combinations of `each` variables
NUMBERS = (int, float, np.number, np.bool_)


@dataclass(frozen=True)
class SharedVariable:
    """One axis of a contextual search, for several variables that set the same keys in different conditions.

    It is a share 0…1 of each variable's own range, so that one policy applies to an egg whose inset ranges from 0 to
    16 mm and to a cylinder whose inset ranges from −4 to 4 mm. Equal choices are merged.

    Attributes:
        variable: the axis, named like the key: real 0…1, or the choices that all have.
        of: the variables that it replaces.
    """

    variable: Variable
    of: tuple[SearchedVariable, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(one.name for one in self.of)

    def value_in(self, full: Mapping[str, Value], condition: int) -> Value:
        """Return the value of the key in a condition, from one value per variable; NaN if no variable sets it there."""
        return next((full[one.name] for one in self.of if condition in one.conditions), math.nan)

    def record(self) -> VariableRecord:
        """Return the record of the key's value over the ranges of all variables, which is shown instead of shares."""
        first, ranges = self.of[0], [one.variable for one in self.of]
        low, high = min(float(r.low) for r in ranges), max(float(r.high) for r in ranges)
        axis, name = first.variable, self.variable.name
        return VariableRecord(name, first.written, axis.type, low, high, axis.choices, first.unit)


@dataclass(frozen=True, eq=False)
class SearchProblem:
    """Search problem as the study states it.

    Values are one per variable, SI, choices as in `Variable.choices`. Those of a contextual candidate have a merged
    variable instead of the variables that share its key (`SharedVariable`). All methods accept both.

    Attributes:
        study, config: the searched study, and its `search` block.
        variables, constraints, conditions, until: as the block states them.
        objectives: minimised, or maximised where `maximised` is true.
        registry: the plugins, including those of the study's own files.
        names: resolver of the formulas' names.
    """

    study: Study
    variables: tuple[SearchedVariable, ...]
    constraints: tuple[Expression, ...]
    objectives: tuple[Expression, ...]
    maximised: tuple[bool, ...]
    conditions: tuple[Condition, ...]
    until: Expression | None
    config: SearchConfig
    registry: Registry = field(repr=False)
    names: FormulaNames = field(repr=False)

    @classmethod
    def from_study(cls, study: Study, registry: Registry) -> SearchProblem:
        """Return the study's search problem.

        Raises:
            UserError: the study has no search, or one of its keys, ranges, formulas or conditions is wrong.
        """
        config: SearchConfig = study.need("search", "'pliant optimize'")
        registry = with_files(registry, study.plugins)
        variables = search_variables(study, registry)
        conditions = search_conditions(study, registry)
        names = FormulaNames(study, registry, variables, conditions)
        constraints = tuple(
            parse(text, names.symbol, f"search.constraints.{number}", truth=True)
            for number, text in enumerate(config.constraints)
        )
        objectives = tuple(
            parse(o.expression, names.symbol, "search.objective", truth=False) for o in config.objectives
        )
        if not objectives:
            raise UserError("'search.objective' is an empty list; name a metric of the task, such as rmse.")
        for label, listed in (("search.objective", objectives), ("search.constraints", constraints)):
            texts = [one.text for one in listed]
            double = next((text for text in texts if texts.count(text) > 1), None)
            if double is not None:
                raise UserError(f"'{label}' has '{double}' twice; keep one.")
        until = parse(config.until, names.symbol, "search.until", truth=True) if config.until else None
        maximised = tuple(bool(o.maximize) for o in config.objectives)
        return cls(
            study, variables, constraints, objectives, maximised, conditions, until, config, registry, names
        )

    @property
    def objective_names(self) -> tuple[str, ...]:
        """The objectives as the study states them."""
        return tuple(objective.text for objective in self.objectives)

    def branches(self) -> tuple[Mapping[str, Value], ...]:
        """Return the values of the `each` variables, one mapping per search, the first variable varying slowest.

        Without `each` variables there is one empty mapping.

        Raises:
            UserError: no combination passes the constraints, or more than `MOST_BRANCHES` do.
        """
        return self._branches

    @cached_property
    def _branches(self) -> tuple[Mapping[str, Value], ...]:
        """Combine the variables one after another, applying a constraint as soon as all its names have values."""
        axes = [one for one in self.variables if one.each]
        if not axes:
            return ({},)
        left = self._structure_constraints
        columns: dict[str, Any] = {}
        count = 1
        for one in axes:
            axis = one.variable
            choices = list(axis.choices or range(int(axis.low), int(axis.high) + 1))
            if count * len(choices) > MOST_TRIED:
                raise UserError(
                    f"'search' combines {count} × {len(choices)} values of its 'each' variables, more than "
                    f"{MOST_TRIED}; narrow their ranges, or search them jointly without 'each'."
                )
            columns = {name: np.repeat(column, len(choices)) for name, column in columns.items()}
            columns[one.name] = np.tile(np.array(choices, dtype=object), count)
            for constraint in [c for c in left if c.variables <= set(columns)]:
                left.remove(constraint)
                amount = constraint.amount({**self.names.constants, **columns})
                passed = np.broadcast_to(amount == 0, len(columns[one.name]))
                columns = {name: column[passed] for name, column in columns.items()}
                if not passed.any():
                    raise UserError(
                        "no combination of the 'each' variables passes the search's constraint "
                        f"'{constraint.text}'."
                    )
            count = len(columns[one.name])
        if count > MOST_BRANCHES:
            raise UserError(
                f"'search' has {count} combinations of its 'each' variables, more than {MOST_BRANCHES}; add "
                "constraints, or search them jointly without 'each'."
            )
        return tuple(dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))

    @property
    def _structure_constraints(self) -> list[Expression]:
        """The constraints that name only `each` variables."""
        each = {one.name for one in self.variables if one.each}
        return [c for c in self.constraints if c.variables and c.variables <= each and not c.uses("metric")]

    @cached_property
    def structural(self) -> frozenset[str]:
        """Texts of the constraints that only select the searches and reject no candidate."""
        return frozenset(c.text for c in self._structure_constraints)

    def space(self, contextual: bool = False) -> Space:
        """Return the space that an optimizer searches: all variables except the `each` variables.

        Args:
            contextual: each candidate is for one condition. The conditions are the contexts, and variables that
                set one key in different conditions are merged into a share 0…1 of each condition's own range.
        """
        shared = self.shared if contextual else ()
        merged = {name for one in shared for name in one.names}
        own = [v for v in self.variables if not v.each and v.name not in merged]
        start = {v.name: _start(v) for v in own} if self.config.start == "study" else {}
        if start:
            start |= {s.variable.name: s.variable.choices[0] if s.variable.choices else 0.5 for s in shared}
        axes = (*(v.variable for v in own), *(one.variable for one in shared))
        contexts = tuple(Context(c.name, c.features) for c in self.conditions) if contextual else ()
        return Space(axes, len(self.objectives), contexts, start)

    @cached_property
    def shared(self) -> tuple[SharedVariable, ...]:
        """The merged variables of a contextual search: each replaces two or more variables of the same keys."""
        groups: dict[tuple[KeyPath, ...], list[SearchedVariable]] = {}
        for one in self.variables:
            if not one.each:
                groups.setdefault(one.keys, []).append(one)
        found = []
        for group in groups.values():
            choices = {one.variable.choices for one in group}
            if len(group) > 1 and len(choices) == 1:
                type_ = "categorical" if group[0].variable.choices else "real"
                axis = Variable(group[0].written[0], type_, 0.0, 1.0, choices.pop())  # type: ignore[arg-type]
                found.append(SharedVariable(axis, tuple(group)))
        return tuple(found)

    def start_notes(self) -> tuple[str, ...]:
        """Return notes on the variables that do not start at the study's own value; empty if `start` is anywhere."""
        notes = []
        for one in self.variables if self.config.start == "study" else ():
            axis, categorical = one.variable, one.variable.type == "categorical"
            if one.each:
                continue
            if one.stated is None:
                why = "the study's is no choice" if categorical else "the study does not give it"
                notes.append(f"'{one.name}' begins elsewhere: {why}.")
            elif not (categorical or axis.low <= float(one.stated) <= axis.high):
                stated, low, high = (quantity(v, one.unit, 6) for v in (one.stated, axis.low, axis.high))
                notes.append(
                    f"'{one.name}' begins in the middle of its range: the study's {stated} lies outside {low} to "
                    f"{high}."
                )
        return tuple(notes)

    def full(self, values: Mapping[str, Value]) -> Mapping[str, Value]:
        """Return one value per variable; a merged axis sets its variables to its share of each one's range."""
        found = dict(values)
        for group in self.shared:
            if group.variable.name in found and not set(group.names) <= set(found):
                share = found.pop(group.variable.name)
                found.update({one.name: _at_share(one.variable, share) for one in group.of})
        return found

    def changes(self, values: Mapping[str, Value], condition: int) -> dict[KeyPath, Any]:
        """Return path → JSON value, SI, as set by variables and condition; `values` includes those of the branch."""
        values = self.full(values)
        found = dict(self.conditions[condition].changes)
        for one in self.variables:
            if condition in one.conditions:
                setting = one.settings[values[one.name]] if one.settings else values[one.name]
                if not one.settings and not isinstance(setting, str):  # converts NumPy numbers to Python's
                    setting = round(float(setting)) if one.variable.type == "integer" else float(setting)
                found.update(dict.fromkeys(one.keys, setting))
        return found

    def apply(self, values: Mapping[str, Value], condition: int) -> Study:
        """Return the study with all variables and the condition set, validated.

        Raises:
            UserError: the study's models refuse a value, or the family the design (`InvalidDesignError`).
        """
        return self._setter.study(self.changes(values, condition))

    @cached_property
    def _setter(self) -> StudySetter:
        return StudySetter(self.study, self.registry)

    def violated(self, values: Mapping[str, Value], condition: int = -1) -> dict[str, float]:
        """Return violated constraint → violation, of order 0…1, for constraints that name only variables.

        Args:
            values: of the candidate.
            condition: that of the candidate; constraints that name variables of other conditions are ignored.
                −1: all conditions.
        """
        return self._broken(self._counting(condition), values, {})

    def violated_each(self, trials: Sequence[Trial]) -> list[dict[str, float]]:
        """Return `violated` of every trial, computed for all trials of a condition at once."""
        found: list[dict[str, float]] = [{} for _ in trials]
        for condition in {trial.context for trial in trials}:
            rows = [k for k, trial in enumerate(trials) if trial.context == condition]
            full = [self.full(trials[k].values) for k in rows]
            known = {
                **self.names.constants,
                **{name: _column([one[name] for one in full]) for name in full[0]},
            }
            for constraint in self._counting(condition):
                amounts = np.broadcast_to(constraint.amount(known), len(rows))
                for k in np.flatnonzero(~(amounts <= 0)):
                    found[rows[k]][constraint.text] = _finite(float(amounts[k]))
        return found

    def _counting(self, condition: int) -> list[Expression]:
        """Return the constraints that name only variables and apply in a condition."""
        others = {v.name for v in self.variables if condition >= 0 and condition not in v.conditions}
        return [c for c in self.constraints if not c.uses("metric") and not c.variables & others]

    def metric_violations(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> dict[str, float]:
        """Return violated constraint on metrics → violation; without its metric a constraint is violated."""
        return self._broken([c for c in self.constraints if c.uses("metric")], values, metrics)

    def _broken(
        self, constraints: Sequence[Expression], values: Mapping[str, Value], metrics: Mapping[str, Any]
    ) -> dict[str, float]:
        known = self._known(values, metrics, constraints)
        amounts = {constraint.text: float(constraint.amount(known)) for constraint in constraints}
        return {text: _finite(amount) for text, amount in amounts.items() if not amount <= 0}

    def margins(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> Array:
        """Return how far every comparison of the constraints is from being violated: signed, of order 0…1."""
        known = self._known(values, metrics, self.constraints)
        return np.array([one for constraint in self.constraints for one in constraint.margins(known)], float)

    def require_metrics(self, metrics: Mapping[str, Any]) -> None:
        """Check that objectives, constraints and `until` name numeric metrics of a task; None: not measured.

        Raises:
            UserError: a name is not a metric, or a metric is not a number.
        """
        until = [self.until] if self.until is not None else []
        numbers = [strip_unit_suffix(key) for key, value in metrics.items() if isinstance(value, NUMBERS)]
        there = f" Numbers that the task gives: {', '.join(numbers) or 'none'}."
        for name, text in _named_metrics((*self.objectives, *self.constraints, *until)):
            full = metric_name(name, metrics)
            if full is None:
                hint = closest(name, [*numbers, *(v.name for v in self.variables)])
                raise UserError(
                    f"the search's '{text}' names '{name}', which is no variable, no key of the study and no metric "
                    f"of its task{hint}{there}"
                )
            if metrics[full] is not None and not isinstance(metrics[full], NUMBERS):
                raise UserError(
                    f"the search's '{text}' names '{name}', which the task gives, but not as a number.{there}"
                )

    def names_metric(self, name: str) -> bool:
        """Return whether a formula names this metric, with or without its unit."""
        until = [self.until] if self.until is not None else []
        named = _named_metrics((*self.objectives, *self.constraints, *until))
        return any(strip_unit_suffix(one) == name for one, _ in named)

    def objective_values(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> tuple[float, ...]:
        """Return the objectives as minimised, a maximised objective negated; NaN if one is not a number."""
        known = self._known(values, metrics, self.objectives)
        found = [float(expression.value(known)) for expression in self.objectives]
        return tuple(-v if up else v for v, up in zip(found, self.maximised, strict=True))

    def reached(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> bool:
        """Return whether `until` is satisfied; False if a metric was not measured."""
        if self.until is None:
            return False
        return float(self.until.amount(self._known(values, metrics, [self.until]))) == 0.0

    def _known(
        self, values: Mapping[str, Value], metrics: Mapping[str, Any], expressions: Sequence[Expression]
    ) -> dict[str, Any]:
        """Return symbol → value of variables, the study's constants and the metrics that the expressions name.

        A metric that was not measured, or is not a number, is NaN. `rmse` also denotes `rmse_m`.
        """
        known: dict[str, Any] = {**self.names.constants, **self.full(values)}
        for name, _ in _named_metrics(expressions):
            value = metrics.get(metric_name(name, metrics) or "")
            known[name] = float(value) if isinstance(value, NUMBERS) else math.nan
        return known

    def stated(self, values: Mapping[str, Value], condition: int) -> Mapping[str, Value]:
        """Return one value per variable, with the condition's value of each merged variable under its name."""
        full = self.full(values)
        return {**full, **{one.variable.name: one.value_in(full, condition) for one in self.shared}}

    def records(self, contextual: bool = False) -> tuple[VariableRecord, ...]:
        """Return the records of the variables; of a contextual search also those of the merged variables."""
        found = {}
        for v in self.variables:
            axis, ends = v.variable, (float(v.variable.low), float(v.variable.high))
            found[v.name] = VariableRecord(v.name, v.written, axis.type, *ends, axis.choices, v.unit, v.each)
        found.update({one.variable.name: one.record() for one in (self.shared if contextual else ())})
        return tuple(found.values())


def reevaluation_problem(problem: SearchProblem) -> SearchProblem:
    """Return the problem in which the best trials are re-evaluated; `confirm.change` overrides the conditions.

    Raises:
        UserError: the study lacks a key or the search varies it, or a value is not allowed.
    """
    config, place = problem.config.confirm, "search.confirm.change"
    assert config is not None
    paths = {study_key(problem.study, problem.registry, key, place).path for key in config.change}
    study = changed(problem.registry, problem.study, config.change, place)
    set_twice = {path for one in problem.variables for path in one.keys} & paths
    if set_twice:
        names = ", ".join(".".join(map(str, path)) for path in sorted(set_twice, key=str))
        raise UserError(f"search.confirm.change sets {names}, which the search varies; leave it out there.")
    conditions = tuple(
        replace(one, changes={path: value for path, value in one.changes.items() if path not in paths})
        for one in problem.conditions
    )
    return replace(problem, study=study, conditions=conditions)


def _named_metrics(expressions: Sequence[Expression]) -> Iterator[tuple[str, str]]:
    """Yield pairs (name of a metric, text of the expression that names it)."""
    for expression in expressions:
        yield from ((one.name, expression.text) for one in expression.names if one.role == "metric")


def _finite(amount: float) -> float:
    return amount if math.isfinite(amount) else NO_NUMBER


def _column(values: Sequence[Value]) -> Array:
    """Return the values of a variable as an array for expressions; texts are kept."""
    return np.array(values, dtype=object if any(isinstance(one, str) for one in values) else None)


def _start(one: SearchedVariable) -> Value:
    """Return the study's own value if it is allowed, else the middle of the range."""
    axis = one.variable
    if axis.type == "categorical":
        return one.stated if one.stated is not None else axis.choices[0]
    if isinstance(one.stated, int | float) and axis.low <= one.stated <= axis.high:
        return one.stated
    middle = (axis.low + axis.high) / 2
    return round(middle) if axis.type == "integer" else middle


def _at_share(axis: Variable, share: Value) -> Value:
    if axis.type == "categorical" or isinstance(share, str):
        return share
    if axis.type == "real":
        return min(max(axis.low + float(share) * (axis.high - axis.low), axis.low), axis.high)
    count = int(axis.high - axis.low) + 1  # equal shares for all integers
    return int(axis.low) + min(int(float(share) * count), count - 1)
