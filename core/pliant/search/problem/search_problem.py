"""What a study's `search` block means: variables, conditions, constraints and objectives, read once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pliant.config.search import SearchConfig
from pliant.config.searched import Condition, SearchedVariable, search_conditions, search_variables
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.formatting import quantity
from pliant.interfaces.optimizer import Context, Space, Value, Variable
from pliant.records.search import VariableRecord
from pliant.registry.discovery import Registry
from pliant.registry.files import with_files
from pliant.search.expressions.parser import Expression, parse
from pliant.search.problem import structures
from pliant.search.problem.names import Names, require_metrics, with_metrics
from pliant.search.problem.shared_variables import SharedVariable, expanded, shared_variables
from pliant.search.problem.study_setter import KeyPath, StudySetter

__all__ = ["Condition", "Objective", "SearchProblem", "SearchedVariable"]

NO_NUMBER = 1.0  # by how much a constraint counts as broken that comes to no number


@dataclass(frozen=True)
class Objective:
    """What is minimised or maximised."""

    expression: Expression
    maximised: bool


@dataclass(frozen=True, eq=False)
class SearchProblem:
    """A search as the study states it.

    Values are one per variable, SI, choices as in `Variable.choices`; those of a contextual candidate have a merged
    variable instead of those that share its key (`pliant.search.problem.shared_variables`). All methods take either.
    """

    study: Study
    variables: tuple[SearchedVariable, ...]
    constraints: tuple[Expression, ...]
    objectives: tuple[Objective, ...]
    conditions: tuple[Condition, ...]
    until: Expression | None
    config: SearchConfig
    registry: Registry = field(repr=False)
    names: Names = field(repr=False)

    @classmethod
    def of(cls, study: Study, registry: Registry) -> SearchProblem:
        """The study's search.

        Raises:
            UserError: the study has none, or one of its keys, ranges, formulas or conditions is wrong.
        """
        config: SearchConfig = study.need("search", "'pliant optimize'")
        registry = with_files(registry, study.plugins)
        variables = search_variables(study, registry)
        conditions = search_conditions(study, registry)
        names = Names(study, registry, variables, conditions)
        constraints = tuple(
            parse(text, names.symbol, f"search.constraints.{number}", truth=True)
            for number, text in enumerate(config.constraints)
        )
        objectives = tuple(
            Objective(parse(o.expression, names.symbol, "search.objective", truth=False), bool(o.maximize))
            for o in config.objectives
        )
        if not objectives:
            raise UserError("'search.objective' is an empty list; name a metric of the task, such as rmse.")
        _once([o.expression.text for o in objectives], "search.objective")
        _once([c.text for c in constraints], "search.constraints")
        until = parse(config.until, names.symbol, "search.until", truth=True) if config.until else None
        return cls(study, variables, constraints, objectives, conditions, until, config, registry, names)

    @property
    def objective_names(self) -> tuple[str, ...]:
        """The objectives as the study states them."""
        return tuple(objective.expression.text for objective in self.objectives)

    @property
    def maximised(self) -> tuple[bool, ...]:
        """Which objectives are to be large."""
        return tuple(objective.maximised for objective in self.objectives)

    def branches(self) -> tuple[Mapping[str, Value], ...]:
        """Values of the `each` variables, one mapping per search; one empty mapping where there are none.

        Raises:
            UserError: no combination passes the constraints, or more than `branches.MOST` do.
        """
        return self._branches

    @cached_property
    def _branches(self) -> tuple[Mapping[str, Value], ...]:
        return structures.enumerate_branches(self.variables, self.constraints, self.names.resolved({}))

    @cached_property
    def structural(self) -> frozenset[str]:
        """Texts of the constraints that only choose which searches there are."""
        return frozenset(c.text for c in structures.of_structures(self.variables, self.constraints))

    def space(self, contextual: bool = False) -> Space:
        """What an optimizer searches: all variables but the `each` ones.

        Args:
            contextual: each candidate is for one condition: the conditions are the contexts, and variables that
                set one key in different conditions are one, as a share 0…1 of each condition's own range.
        """
        shared = self.shared if contextual else ()
        merged = {name for one in shared for name in one.names}
        axes = [v.variable for v in self.variables if not v.each and v.name not in merged]
        start = {axis.name: self._start(axis) for axis in axes} if self.config.start == "study" else {}
        axes += [one.variable for one in shared]
        if start:
            start.update({one.variable.name: one.middle for one in shared})
        contexts = tuple(Context(c.name, c.features) for c in self.conditions) if contextual else ()
        return Space(tuple(axes), len(self.objectives), contexts, start)

    @cached_property
    def shared(self) -> tuple[SharedVariable, ...]:
        """The variables that are one where each candidate is for one condition."""
        return shared_variables(self.variables)

    def _start(self, axis: Variable) -> Value:
        """The study's own value, or the middle of the range where that is none."""
        stated = next(v.stated for v in self.variables if v.name == axis.name)
        if axis.type == "categorical":
            return stated if stated is not None else axis.choices[0]
        if isinstance(stated, int | float) and axis.low <= stated <= axis.high:
            return stated
        middle = (axis.low + axis.high) / 2
        return round(middle) if axis.type == "integer" else middle

    def start_notes(self) -> tuple[str, ...]:
        """Which variables do not begin at the study's own value, and why; empty where `start` is anywhere."""
        notes = []
        for one in self.variables if self.config.start == "study" else ():
            axis = one.variable
            if one.each:
                continue
            if one.stated is None:
                why = (
                    "the study does not give it" if axis.type != "categorical" else "the study's is no choice"
                )
                notes.append(f"'{one.name}' begins elsewhere: {why}.")
            elif axis.type != "categorical" and not axis.low <= float(one.stated) <= axis.high:
                stated, low, high = (quantity(v, one.unit, 6) for v in (one.stated, axis.low, axis.high))
                notes.append(
                    f"'{one.name}' begins in the middle of its range: the study's {stated} lies outside {low} to "
                    f"{high}."
                )
        return tuple(notes)

    def full(self, values: Mapping[str, Value]) -> Mapping[str, Value]:
        """One value per variable, merged ones written out."""
        return expanded(values, self.shared) if self.shared else values

    def changes(self, values: Mapping[str, Value], condition: int) -> dict[KeyPath, Any]:
        """What variables and condition set: path → JSON value, SI; `values` has those of the branch too."""
        values = self.full(values)
        found = dict(self.conditions[condition].changes)
        for one in self.variables:
            if condition in one.conditions:
                chosen = values[one.name]
                setting = one.settings[chosen] if one.settings else _plain(chosen, one.variable)
                found.update(dict.fromkeys(one.keys, setting))
        return found

    def apply(self, values: Mapping[str, Value], condition: int) -> Study:
        """The study with everything set, validated.

        Raises:
            UserError: the study's models refuse a value, or the family the design (`InvalidDesignError`).
        """
        return self._setter.study(self.changes(values, condition))

    @cached_property
    def _setter(self) -> StudySetter:
        return StudySetter(self.study, self.registry)

    def violated(self, values: Mapping[str, Value], condition: int = -1) -> dict[str, float]:
        """Constraints of variables only that are broken → by how much, of order 0…1.

        Args:
            values: of the candidate.
            condition: the one that the candidate is for; then constraints that name variables of other conditions
                do not count. −1: all.
        """
        known = self.names.resolved(self.full(values))
        return _broken(
            [c for c in self.constraints if not c.uses("metric") and self._counts(c, condition)], known
        )

    def require_metrics(self, metrics: Mapping[str, Any]) -> None:
        """Raise `UserError` where objectives, constraints or `until` name what is no number among a task's metrics."""
        until = [self.until] if self.until is not None else []
        formulas = [*(one.expression for one in self.objectives), *self.constraints, *until]
        require_metrics(metrics, formulas, [v.name for v in self.variables])

    def metric_violations(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> dict[str, float]:
        """Constraints with metrics that are broken → by how much; one that was not measured does not hold."""
        constraints = [c for c in self.constraints if c.uses("metric")]
        return _broken(constraints, self._with_metrics(values, metrics, constraints))

    def objective_values(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> tuple[float, ...]:
        """The objectives as minimised, a maximised one negated; NaN where one is no number."""
        expressions = [objective.expression for objective in self.objectives]
        known = self._with_metrics(values, metrics, expressions)
        found = [float(expression.value(known)) for expression in expressions]
        return tuple(-v if up else v for v, up in zip(found, self.maximised, strict=True))

    def reached(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> bool:
        """Whether `until` holds; it does not where a metric was not measured."""
        if self.until is None:
            return False
        return float(self.until.amount(self._with_metrics(values, metrics, [self.until]))) == 0.0

    def stated(self, values: Mapping[str, Value], condition: int) -> Mapping[str, Value]:
        """One value per variable; of those that are one, under that one's name too, as they are in the condition."""
        full = self.full(values)
        return {**full, **{one.variable.name: one.value_in(full, condition) for one in self.shared}}

    def records(self, contextual: bool = False) -> tuple[VariableRecord, ...]:
        """The variables as a result keeps them; of a contextual search also what stands for several of them."""
        found = {v.name: _record(v) for v in self.variables}
        found.update({one.variable.name: one.record() for one in (self.shared if contextual else ())})
        return tuple(found.values())

    def _counts(self, constraint: Expression, condition: int) -> bool:
        named = {symbol.name for symbol in constraint.names}
        return condition < 0 or all(condition in v.conditions for v in self.variables if v.name in named)

    def _with_metrics(
        self, values: Mapping[str, Value], metrics: Mapping[str, Any], expressions: list[Expression]
    ) -> Mapping[str, Any]:
        return with_metrics(self.names.resolved(self.full(values)), metrics, expressions)


def _record(one: SearchedVariable) -> VariableRecord:
    axis = one.variable
    ends = float(axis.low), float(axis.high)
    return VariableRecord(one.name, one.written, axis.type, *ends, axis.choices, one.unit, one.each)


def _broken(constraints: list[Expression], known: Mapping[str, Any]) -> dict[str, float]:
    amounts = {constraint.text: float(constraint.amount(known)) for constraint in constraints}
    return {
        text: amount if math.isfinite(amount) else NO_NUMBER
        for text, amount in amounts.items()
        if not amount <= 0
    }


def _plain(value: Value, axis: Variable) -> Value:
    """A number of numpy as Python's, whole where the variable is."""
    if isinstance(value, str):
        return value
    return round(float(value)) if axis.type == "integer" else float(value)


def _once(texts: list[str], label: str) -> None:
    double = next((text for text in texts if texts.count(text) > 1), None)
    if double is not None:
        raise UserError(f"'{label}' has '{double}' twice; keep one.")
