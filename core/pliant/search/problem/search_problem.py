"""What a study's `search` block means: variables, conditions, constraints and objectives, read once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pliant.config.search import SearchConfig
from pliant.config.searched import Condition, SearchedVariable, search_conditions, search_variables
from pliant.config.study import Study
from pliant.config.study_keys import KeyPath, study_key
from pliant.errors import UserError, closest
from pliant.formatting import quantity
from pliant.interfaces.optimizer import Context, Space, Trial, Value, Variable
from pliant.records.design import Array
from pliant.records.search import VariableRecord
from pliant.registry.discovery import Registry
from pliant.registry.files import with_files
from pliant.search.expressions import Expression, parse
from pliant.search.problem.names import FormulaNames, metric_name
from pliant.search.problem.study_setter import StudySetter, changed
from pliant.units import strip_unit_suffix

NO_NUMBER = 1.0  # by how much a constraint counts as broken that comes to no number
MOST_BRANCHES = 100_000
MOST_TRIED = 20_000_000  # combinations of `each` variables on the way
NUMBERS = (int, float, np.number, np.bool_)


@dataclass(frozen=True)
class SharedVariable:
    """One axis of a search that answers conditions, for several variables that set the same keys in different ones.

    It is a share 0…1 of each one's own range, so that one policy serves an egg whose inset runs from 0 to 16 mm and a
    cylinder whose inset runs from −4 to 4 mm. Choices are merged where they are the same.

    Attributes:
        variable: the axis, named like the key: real 0…1, or the choices that all have.
        of: the variables that it stands for.
    """

    variable: Variable
    of: tuple[SearchedVariable, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(one.name for one in self.of)

    def value_in(self, full: Mapping[str, Value], condition: int) -> Value:
        """The value that the key gets in a condition, from one per variable; NaN where none of them sets it."""
        return next((full[one.name] for one in self.of if condition in one.conditions), math.nan)

    def record(self) -> VariableRecord:
        """Of the key's value, over the ranges of all: what people are shown instead of shares."""
        first, ranges = self.of[0], [one.variable for one in self.of]
        low, high = min(float(r.low) for r in ranges), max(float(r.high) for r in ranges)
        axis, name = first.variable, self.variable.name
        return VariableRecord(name, first.written, axis.type, low, high, axis.choices, first.unit)


@dataclass(frozen=True, eq=False)
class SearchProblem:
    """A search as the study states it.

    Values are one per variable, SI, choices as in `Variable.choices`; those of a contextual candidate have a merged
    variable instead of those that share its key (`SharedVariable`). All methods take either.

    Attributes:
        study, config: what is searched, and its `search` block.
        variables, constraints, conditions, until: as the block states them.
        objectives: what is minimised, or maximised where `maximised` says so.
        registry: the plugins, those of the study's own files among them.
        names: of the formulas.
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
    def of(cls, study: Study, registry: Registry) -> SearchProblem:
        """The study's search.

        Raises:
            UserError: the study has none, or one of its keys, ranges, formulas or conditions is wrong.
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
        """Values of the `each` variables, one mapping per search, the first one varying slowest; one empty mapping
        where there are none.

        Raises:
            UserError: no combination passes the constraints, or more than `MOST_BRANCHES` do.
        """
        return self._branches

    @cached_property
    def _branches(self) -> tuple[Mapping[str, Value], ...]:
        """Variables are combined one after another; a constraint thins them out once all its names have values."""
        axes = [one for one in self.variables if one.each]
        if not axes:
            return ({},)
        left = self._of_structures
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
    def _of_structures(self) -> list[Expression]:
        """The constraints that name `each` variables only."""
        each = {one.name for one in self.variables if one.each}
        return [c for c in self.constraints if c.variables and c.variables <= each and not c.uses("metric")]

    @cached_property
    def structural(self) -> frozenset[str]:
        """Texts of the constraints that only choose which searches there are, and hold no candidate back."""
        return frozenset(c.text for c in self._of_structures)

    def space(self, contextual: bool = False) -> Space:
        """What an optimizer searches: all variables but the `each` ones.

        Args:
            contextual: each candidate is for one condition: the conditions are the contexts, and variables that
                set one key in different conditions are one, as a share 0…1 of each condition's own range.
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
        """The variables that are one where each candidate is for one condition: two or more of the same keys."""
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
        """Which variables do not begin at the study's own value, and why; empty where `start` is anywhere."""
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
        """One value per variable: each merged axis gives every variable that it stands for its share of its range."""
        found = dict(values)
        for group in self.shared:
            if group.variable.name in found and not set(group.names) <= set(found):
                share = found.pop(group.variable.name)
                found.update({one.name: _at_share(one.variable, share) for one in group.of})
        return found

    def changes(self, values: Mapping[str, Value], condition: int) -> dict[KeyPath, Any]:
        """What variables and condition set: path → JSON value, SI; `values` has those of the branch too."""
        values = self.full(values)
        found = dict(self.conditions[condition].changes)
        for one in self.variables:
            if condition in one.conditions:
                setting = one.settings[values[one.name]] if one.settings else values[one.name]
                if not one.settings and not isinstance(setting, str):  # a number of numpy as Python's
                    setting = round(float(setting)) if one.variable.type == "integer" else float(setting)
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
        return self._broken(self._counting(condition), values, {})

    def violated_each(self, trials: Sequence[Trial]) -> list[dict[str, float]]:
        """`violated` of every trial, computed for all trials of a condition at once."""
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
        """Constraints of variables only that count in a condition."""
        others = {v.name for v in self.variables if condition >= 0 and condition not in v.conditions}
        return [c for c in self.constraints if not c.uses("metric") and not c.variables & others]

    def metric_violations(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> dict[str, float]:
        """Constraints with metrics that are broken → by how much; one that was not measured does not hold."""
        return self._broken([c for c in self.constraints if c.uses("metric")], values, metrics)

    def _broken(
        self, constraints: Sequence[Expression], values: Mapping[str, Value], metrics: Mapping[str, Any]
    ) -> dict[str, float]:
        known = self._known(values, metrics, constraints)
        amounts = {constraint.text: float(constraint.amount(known)) for constraint in constraints}
        return {text: _finite(amount) for text, amount in amounts.items() if not amount <= 0}

    def require_metrics(self, metrics: Mapping[str, Any]) -> None:
        """See that objectives, constraints and `until` name numbers among a task's metrics; None is one that was not
        measured this time.

        Raises:
            UserError: a name that is no metric, or a metric that is no number.
        """
        until = [self.until] if self.until is not None else []
        numbers = [strip_unit_suffix(key) for key, value in metrics.items() if isinstance(value, NUMBERS)]
        there = f" Numbers that the task gives: {', '.join(numbers) or 'none'}."
        for name, text in _metrics_of((*self.objectives, *self.constraints, *until)):
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

    def objective_values(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> tuple[float, ...]:
        """The objectives as minimised, a maximised one negated; NaN where one is no number."""
        known = self._known(values, metrics, self.objectives)
        found = [float(expression.value(known)) for expression in self.objectives]
        return tuple(-v if up else v for v, up in zip(found, self.maximised, strict=True))

    def reached(self, values: Mapping[str, Value], metrics: Mapping[str, Any]) -> bool:
        """Whether `until` holds; it does not where a metric was not measured."""
        if self.until is None:
            return False
        return float(self.until.amount(self._known(values, metrics, [self.until]))) == 0.0

    def _known(
        self, values: Mapping[str, Value], metrics: Mapping[str, Any], expressions: Sequence[Expression]
    ) -> dict[str, Any]:
        """Symbol → value of variables, the study's constants and the metrics that the expressions name; NaN for what a
        task did not measure, or not as a number. `rmse` means `rmse_m` too.
        """
        known: dict[str, Any] = {**self.names.constants, **self.full(values)}
        for name, _ in _metrics_of(expressions):
            value = metrics.get(metric_name(name, metrics) or "")
            known[name] = float(value) if isinstance(value, NUMBERS) else math.nan
        return known

    def stated(self, values: Mapping[str, Value], condition: int) -> Mapping[str, Value]:
        """One value per variable; of those that are one, under that one's name too, as they are in the condition."""
        full = self.full(values)
        return {**full, **{one.variable.name: one.value_in(full, condition) for one in self.shared}}

    def records(self, contextual: bool = False) -> tuple[VariableRecord, ...]:
        """The variables as a result keeps them; of a contextual search also what stands for several of them."""
        found = {}
        for v in self.variables:
            axis, ends = v.variable, (float(v.variable.low), float(v.variable.high))
            found[v.name] = VariableRecord(v.name, v.written, axis.type, *ends, axis.choices, v.unit, v.each)
        found.update({one.variable.name: one.record() for one in (self.shared if contextual else ())})
        return tuple(found.values())


def reevaluation_problem(problem: SearchProblem) -> SearchProblem:
    """The problem in which the best trials are evaluated again; conditions give way to what `confirm.change` sets.

    Raises:
        UserError: a key that the study does not have or that the search varies, or a value that it does not allow.
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


def _metrics_of(expressions: Sequence[Expression]) -> Iterator[tuple[str, str]]:
    """Names of metrics with the text that names them."""
    for expression in expressions:
        yield from ((one.name, expression.text) for one in expression.names if one.role == "metric")


def _finite(amount: float) -> float:
    return amount if math.isfinite(amount) else NO_NUMBER


def _column(values: Sequence[Value]) -> Array:
    """Values of a variable as expressions take them: texts stay what they are."""
    return np.array(values, dtype=object if any(isinstance(one, str) for one in values) else None)


def _start(one: SearchedVariable) -> Value:
    """The study's own value, or the middle of the range where that is none."""
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
    count = int(axis.high - axis.low) + 1  # equal shares for all whole numbers
    return int(axis.low) + min(int(float(share) * count), count - 1)
