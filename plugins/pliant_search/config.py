"""The `search` block: variables, objectives, and budget."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from pliant.config.chain import Count
from pliant.interfaces.base import FrozenModel
from pliant.units import Ratio

NAME = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*$"


class SearchVariableConfig(FrozenModel):
    """One variable: a range or choices of one key of the study, or of several keys that get the same value.

    Its name is the key with dots (`family.average_radius`), or any name where `key` gives the key: names such as
    `n1` are short in constraints, and keys with numbers (`chain.segments.0.modules`) need one.
    """

    key: str | tuple[str, ...] | None = Field(
        None, description="key or keys that it sets; by default its name"
    )
    low: Any = Field(None, description="lowest value, as the study writes the key: 6 mm")
    high: Any = Field(None, description="highest value")
    choices: tuple[Any, ...] = Field((), description="instead of a range: the values of the key")
    each: bool = Field(
        False, description="a search of its own for each value (whole numbers and choices only)"
    )
    only: str | tuple[str, ...] = Field(
        (), description="names of the conditions that it sets its key in (egg-*); by default all"
    )

    @model_validator(mode="after")
    def _range_or_choices(self) -> SearchVariableConfig:
        ranged = [value is not None for value in (self.low, self.high)]
        if any(ranged) == bool(self.choices) or any(ranged) != all(ranged):
            raise ValueError("give either 'low' and 'high', or 'choices'")
        return self

    def keys(self, name: str) -> tuple[str, ...]:
        """Return the keys that it sets under its name."""
        return self.key if isinstance(self.key, tuple) else (self.key or name,)


class ObjectiveConfig(FrozenModel):
    """`{minimize: rmse}` or `{maximize: z_max - 0.01 * pressure}`: a metric of the task, or an expression of metrics
    and variables.
    """

    minimize: str | None = Field(None, min_length=1, description="expression to be small")
    maximize: str | None = Field(None, min_length=1, description="expression to be large")

    @model_validator(mode="after")
    def _one_way(self) -> ObjectiveConfig:
        if (self.minimize is None) == (self.maximize is None):
            raise ValueError("give either 'minimize' or 'maximize'")
        return self

    @property
    def expression(self) -> str:
        """The expression that is computed."""
        return self.minimize or self.maximize or ""


def _joined(raw: Mapping[Any, Any], done: Callable[[Any], bool], above: str = "") -> dict[str, Any]:
    """Flatten nested blocks to dotted names, down to where a value is `done`; equal names are merged."""
    flat: dict[str, Any] = {}
    for name, value in raw.items():
        inner = {f"{above}{name}": value} if done(value) else _joined(value, done, f"{above}{name}.")
        for key, item in inner.items():
            both = isinstance(item, Mapping) and isinstance(flat.get(key), Mapping)
            flat[key] = {**flat[key], **item} if both else item
    return flat


def _joined_keys(changes: Any, done: Callable[[Any], bool] = lambda value: True) -> Any:
    """Return `{task: {trials: 10}}`, as overrides write it, as `{task.trials: 10}`; keys with dots are not changed."""
    if not isinstance(changes, Mapping):
        return changes
    flat: dict[str, Any] = {}
    for name, value in changes.items():
        whole = isinstance(value, Mapping) and "." not in str(name)
        flat.update(_joined(value, done, f"{name}.") if whole else {name: value})
    return flat


def _widths(raw: Any) -> Any:
    return _joined_keys(raw, lambda value: not isinstance(value, Mapping) or "sd" in value)


Changes = Annotated[dict[str, Any], BeforeValidator(_joined_keys)]
Widths = Annotated[dict[str, Any], BeforeValidator(_widths)]


class RobustConfig(FrozenModel):
    """Robust designs: every candidate is tried in the same scenarios, which are drawn once.

    `vary` has keys of the study: `task.friction: 5 %` is a half width relative to the value, `family.wall: 0.1 mm`
    an absolute one, and `effects.0.factor: {sd: 0.03}` a normal deviation, as the evidence loop writes it.
    """

    samples: Count = Field(16, ge=2, le=1000, description="scenarios")
    measure: Literal["mean", "worst", "cvar"] = Field(
        "mean", description="of the objective over the scenarios"
    )
    level: Ratio = Field(
        0.8, ge=0, lt=1, description="of cvar: the mean of the worst 1 − level of the scenarios"
    )
    laws: bool = Field(True, description="whether laws are drawn from their error bars")
    vary: Widths = Field(default_factory=dict, description="keys of the study and how far they are off")
    seed: int = Field(0, ge=0, description="of the scenarios")
    compare: bool = Field(
        True,
        description="whether a nominal search of the same budget comes first: the robust one begins at its best "
        "design, and the result says what robustness costs",
    )


class HalvingConfig(FrozenModel):
    """Successive halving: the best searches of `each` variables continue with more candidates until one remains."""

    factor: int = Field(
        3, ge=2, le=100, description="one in so many goes on, with so many times the candidates"
    )


class ConfirmConfig(FrozenModel):
    """The best candidates are tried again before one is chosen: the best of many noisy trials was lucky, too."""

    best: Count = Field(
        10,
        ge=1,
        le=10_000,
        description="candidates, of each condition where it has its own; near twins of a better one are left out",
    )
    change: Changes = Field(
        description="keys that are different then: {task.trials: 10, task.seed: 500}", min_length=1
    )


class PolishConfig(FrozenModel):
    """A descent from the best candidates, by slopes through the chain's equilibrium; see `pliant_search.polish`."""

    best: Count = Field(
        8,
        ge=1,
        le=10_000,
        description="candidates that it begins from, best first; those near a better one with the same choices and "
        "whole numbers are left out",
    )
    steps: Count = Field(40, ge=1, le=10_000, description="at most, of each descent")


class VerifyConfig(FrozenModel):
    """The check of the best design: direct FEM of its modules, laws fitted to that, the task in the study's engine
    and in those of `cross_check`.
    """

    fem: bool = Field(True, description="whether its laws are fitted to FEM of the design itself")
    change: Changes = Field(
        default_factory=dict, description="keys that are different in the check: {task.trials: 10}"
    )
    others: Count = Field(
        3,
        ge=0,
        le=100,
        description="next designs that are checked where the best one breaks a constraint by FEM",
    )
    rounds: Count = Field(
        0,
        ge=0,
        le=100,
        description="searches of the same budget that follow, each with the FEM of the last best design among the "
        "meta-model's data, until one keeps its constraints by FEM and does not lean on extrapolation",
    )
    law_error: Ratio | None = Field(
        0.03,
        gt=0,
        description="error of a law against FEM, as a share of its range, above which the best design leans on "
        "extrapolation; null for any",
    )


class SearchConfig(FrozenModel):
    """The search of `pliant optimize`."""

    variables: dict[str, SearchVariableConfig] = Field(
        min_length=1, description="name → range or choices of a key"
    )
    objective: str | ObjectiveConfig | tuple[str | ObjectiveConfig, ...] = Field(
        description="what is minimised: a metric of the task, an expression, or a list of them"
    )
    constraints: tuple[str, ...] = Field(
        (), description="inequalities of variables or metrics, such as n1 + n2 <= 12"
    )
    budget: Count = Field(
        200, ge=1, le=10_000_000, description="candidates that are simulated, of each search"
    )
    generations: Count | None = Field(
        None, ge=1, le=1_000_000, description="instead of a budget: batches of the optimizer's own size"
    )
    halving: HalvingConfig | None = Field(
        None, description="of searches of `each` variables: the best go on with several times the budget"
    )
    until: str | None = Field(
        None,
        description="a search ends early where this holds: rmse <= 5 mm and e_max <= 5 mm; where each condition has a "
        "design of its own, once it holds in each",
    )
    seed: int = Field(0, ge=0, description="of the optimizer")
    start: Literal["study", "anywhere"] = Field(
        "study", description="whether the search begins at the study's own values, where they are in range"
    )
    conditions: dict[str, Changes] = Field(
        default_factory=dict, description="name → keys of the study: every candidate is tried in all of them"
    )
    over_conditions: Literal["mean", "worst"] = Field(
        "mean", description="of the objective over the conditions"
    )
    robust: RobustConfig | None = Field(None, description="designs for what is uncertain")
    polish: PolishConfig | None = Field(
        None,
        description="descents from the best candidates over the real variables, by slopes; whole numbers and choices "
        "stay",
    )
    confirm: ConfirmConfig | None = Field(
        None, description="of noisy tasks: the best candidates once more, before one is chosen"
    )
    sensitivity: bool = Field(
        True,
        description="whether the objective is found along each variable of the best design: some ten candidates each",
    )
    verify: VerifyConfig | None = Field(
        VerifyConfig(), description="the check of the best design; null for none"
    )

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, raw: Any) -> Any:
        """Flatten `variables: {family: {wall: {low: …}}}`, as overrides write it, to `{family.wall: {low: …}}`."""
        if not isinstance(raw, Mapping) or not isinstance(raw.get("variables"), Mapping):
            return raw
        fields = set(SearchVariableConfig.model_fields)

        def whole(value: Any) -> bool:
            return not isinstance(value, Mapping) or not value or bool(fields & set(value))

        return {**raw, "variables": _joined(raw["variables"], whole)}

    @field_validator("variables")
    @classmethod
    def _names(cls, variables: dict[str, SearchVariableConfig]) -> dict[str, SearchVariableConfig]:
        for name, variable in variables.items():
            if not re.fullmatch(NAME, name):
                raise ValueError(
                    f"'{name}' cannot stand in a formula; give it a name such as n1, with 'key: {name}'"
                    if variable.key is None
                    else f"'{name}' is no name: letters, digits and _, parted by dots"
                )
        return variables

    @model_serializer(mode="wrap")
    def _without_absent(self, dumped: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave `polish` out if there is none, as in keys of earlier results."""
        return {name: value for name, value in dumped(self).items() if name != "polish" or value is not None}

    @property
    def objectives(self) -> tuple[ObjectiveConfig, ...]:
        """Return the objectives, with plain texts as minimised ones."""
        listed = self.objective if isinstance(self.objective, tuple) else (self.objective,)
        return tuple(o if isinstance(o, ObjectiveConfig) else ObjectiveConfig(minimize=o) for o in listed)
