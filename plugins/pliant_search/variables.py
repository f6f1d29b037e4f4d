"""The variables and conditions of a `search` block, resolved in the study: keys looked up, bounds parsed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from pliant.config.problems import at_place
from pliant.config.study import Study
from pliant.config.study_keys import KeyPath, StudyKey, study_key
from pliant.errors import UserError, closest
from pliant.registry.discovery import Registry
from pliant_search.config import SearchConfig, SearchVariableConfig
from pliant_search.optimizer import Value, Variable

Where = Callable[[Sequence[Any]], str]


@dataclass(frozen=True)
class SearchedVariable:
    """A variable of a search.

    Attributes:
        name: in formulas and results.
        keys: paths that it sets, all to its value.
        variable: its range or choices, SI.
        unit: SI unit, "" for pure numbers and values that are no numbers.
        each: whether every value has a separate search.
        conditions: indices of the conditions in which it sets its keys.
        settings: for choices: choice → JSON value of the key.
        written: its keys as people write them.
        stated: the study's own value as a choice or number; None where the study has none.
    """

    name: str
    keys: tuple[KeyPath, ...]
    variable: Variable
    unit: str
    each: bool
    conditions: tuple[int, ...]
    settings: Mapping[Value, Any] = field(default_factory=dict)
    written: tuple[str, ...] = ()
    stated: Value | None = None

    @property
    def numeric(self) -> bool:
        """Return whether its values are numbers."""
        return self.variable.type != "categorical" or not isinstance(self.variable.choices[0], str)


@dataclass(frozen=True)
class Condition:
    """One of the conditions in which every candidate is tried.

    Attributes:
        name: "" where the search states none.
        changes: path → JSON value.
        features: numbers of order one that distinguish the conditions; see `search_conditions`.
    """

    name: str
    changes: Mapping[KeyPath, Any] = field(default_factory=dict)
    features: tuple[float, ...] = ()


def no_place(path: Sequence[Any]) -> str:
    """Return "": the place of a key is not known."""
    return ""


def search_conditions(study: Study, registry: Registry, where: Where = no_place) -> tuple[Condition, ...]:
    """Return the conditions of a study's search; one without a name if it states none.

    Features, in the order in which the keys first appear: a number is scaled to 0…1 over the conditions; anything
    else has a 0 or 1 for each of its values in the order of the conditions. A key that a condition does not set has
    the study's value there; a key with one value has no feature.

    Raises:
        UserError: unknown keys, invalid values, empty or equal conditions.
    """
    config: SearchConfig = study.need("search", "a search")
    keys: dict[KeyPath, StudyKey] = {}
    found: list[tuple[str, dict[KeyPath, Any]]] = []
    for name, changes in config.conditions.items():
        path = ("search", "conditions", name)
        at, label = at_place(where(path)), ".".join(path)
        if not changes:
            raise UserError(
                f"{at}'{label}' sets nothing; name the key that is its own, such as 'task.pressure: 12 kPa'."
            )
        set_here: dict[KeyPath, Any] = {}
        for written, value in changes.items():
            key = study_key(study, registry, written, where((*path, written)))
            if key.path in set_here:
                raise UserError(f"{at}'{label}' sets '{key.written}' twice; keep one.")
            set_here[key.path] = key.parsed(value, f"{label}.{written}", where((*path, written)))
            keys.setdefault(key.path, key)
        same = next((other for other, held in found if held == set_here), None)
        if same is not None:
            raise UserError(f"{at}conditions '{same}' and '{name}' set the same; keep one.")
        found.append((name, set_here))
    if not found:
        return (Condition(""),)
    columns = [column for key in keys.values() for column in _features(key, [held for _, held in found])]
    return tuple(
        Condition(name, held, tuple(column[row] for column in columns))
        for row, (name, held) in enumerate(found)
    )


def _features(key: StudyKey, conditions: Sequence[Mapping[KeyPath, Any]]) -> list[list[float]]:
    values = [held.get(key.path, key.value) for held in conditions]
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        low, high = min(values), max(values)
        return [[(value - low) / (high - low) for value in values]] if high > low else []
    texts = [json.dumps(value, sort_keys=True) for value in values]
    known = list(dict.fromkeys(texts))
    return [[float(text == one) for text in texts] for one in known] if len(known) > 1 else []


def search_variables(
    study: Study, registry: Registry, where: Where = no_place
) -> tuple[SearchedVariable, ...]:
    """Return the variables of a study's search, in the order in which they are written.

    Args:
        study: with `search`.
        registry: the installed kinds.
        where: returns the place of a key path ("finger.yaml, line 3").

    Raises:
        UserError: unknown keys, bounds that the key does not take, patterns without a condition, keys set twice.
    """
    config: SearchConfig = study.need("search", "a search")
    conditions = search_conditions(study, registry, where)
    found = [
        _variable(study, registry, name, variable, tuple(c.name for c in conditions), where)
        for name, variable in config.variables.items()
    ]
    _set_once(found, conditions, where)
    return tuple(found)


def check_search(study: Study, registry: Registry, where: Where) -> None:
    """Raise `UserError`, with its line, for variables, conditions or checks that name no key of the study."""
    search_variables(study, registry, where)
    search: SearchConfig = study.need("search", "a search")
    vary = search.robust.vary if search.robust else {}
    change = search.verify.change if search.verify else {}
    for block, keys in ((("robust", "vary"), vary), (("verify", "change"), change)):
        for key in keys:
            study_key(study, registry, key, where(("search", *block, key)))


def _variable(
    study: Study,
    registry: Registry,
    name: str,
    config: SearchVariableConfig,
    conditions: Sequence[str],
    where: Where,
) -> SearchedVariable:
    path = ("search", "variables", name)
    place, label = where(path), ".".join(path)
    at = at_place(place)
    keys = [study_key(study, registry, key, where((*path, "key")) or place) for key in config.keys(name)]
    if not keys:
        raise UserError(f"{at}'{label}.key' is an empty list; name a key of the study.")
    first = keys[0]
    other = next((key for key in keys if (key.sort, key.unit) != (first.sort, first.unit)), None)
    if other is not None:
        raise UserError(
            f"{at}'{label}' sets '{first.written}' and '{other.written}', which hold different things; "
            "make them two variables."
        )

    def parsed(value: Any, end: str) -> Any:
        """Return the value as the first key takes it; every key must take it."""
        one, *others = [key.parsed(value, f"{label}.{end}", place) for key in keys]
        if any(also != one for also in others):
            raise UserError(f"{at}'{label}.{end}' is {value}, which its keys read in different ways.")
        return one

    settings: dict[Value, Any] = {}
    instead = f"leaves nothing to search; write '{first.written}' into the study instead."
    if config.choices:
        for number, written in enumerate(config.choices):
            value = parsed(written, f"choices.{number}")
            plain = isinstance(value, int | float | str) and not isinstance(value, bool)
            choice = value if plain else written if isinstance(written, str) else json.dumps(written)
            if choice in settings:
                raise UserError(f"{at}'{label}.choices' has {written} twice; keep one.")
            settings[choice] = value
        if len({isinstance(choice, str) for choice in settings}) > 1:
            raise UserError(f"{at}'{label}.choices' mixes numbers and texts.")
        if len(settings) < 2 and not config.each:
            raise UserError(f"{at}'{label}.choices' has one value, which {instead}")
        variable = Variable(name, "categorical", choices=tuple(settings))
        stated = next((choice for choice, setting in settings.items() if setting == first.value), None)
    else:
        if first.sort not in ("real", "integer"):
            raise UserError(f"{at}'{first.written}' is no number, so '{label}' has no range; give 'choices'.")
        low, high = parsed(config.low, "low"), parsed(config.high, "high")
        if low > high:
            raise UserError(f"{at}'{label}' has low {config.low} above high {config.high}; exchange them.")
        if low == high and not config.each:  # a variant of a study fixes one structure of it
            raise UserError(f"{at}'{label}' has low and high {config.low}, which {instead}")
        variable = Variable(name, "integer" if first.sort == "integer" else "real", low, high)
        stated = first.value if isinstance(first.value, int | float) else None
    if config.each and variable.type == "real":
        raise UserError(
            f"{at}'{label}' is a real number, which has no single values; 'each' is for whole numbers "
            "and choices."
        )
    return SearchedVariable(
        name=name,
        keys=tuple(key.path for key in keys),
        variable=variable,
        unit=first.unit,
        each=config.each,
        conditions=_conditions(config, conditions, label, at),
        settings=settings,
        written=tuple(key.written for key in keys),
        stated=stated,
    )


def _conditions(config: SearchVariableConfig, names: Sequence[str], label: str, at: str) -> tuple[int, ...]:
    """Return the indices of the conditions that the patterns of `only` match."""
    patterns = (config.only,) if isinstance(config.only, str) else config.only or ("*",)
    if config.only and names == ("",):
        raise UserError(f"{at}'{label}' has 'only', but the search states no conditions.")
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise UserError(
                f"{at}'{label}.only' has '{pattern}', which no condition is called"
                f"{closest(pattern, names)} Conditions: {', '.join(names)}."
            )
    return tuple(i for i, name in enumerate(names) if any(fnmatchcase(name, p) for p in patterns))


def _set_once(
    variables: Sequence[SearchedVariable],
    conditions: Sequence[Condition],
    where: Where,
) -> None:
    """Check that no key is set twice in a condition."""
    setters: dict[tuple[int, KeyPath], str] = {}
    for variable in variables:
        at = at_place(where(("search", "variables", variable.name)))
        for index in variable.conditions:
            condition = conditions[index]
            for path, name in zip(variable.keys, variable.written, strict=True):
                if path in condition.changes:
                    raise UserError(
                        f"{at}'{name}' is set by variable '{variable.name}' and by condition '{condition.name}' "
                        "itself; leave it out of one of them."
                    )
                other = setters.setdefault((index, path), variable.name)
                if other != variable.name or variable.keys.count(path) > 1:
                    inside = f" in condition '{condition.name}'" if condition.name else ""
                    who = f"'{other}' and '{variable.name}'" if other != variable.name else f"'{other}' twice"
                    raise UserError(f"{at}'{name}' is set by variable {who}{inside}; keep one.")
