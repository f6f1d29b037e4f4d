"""The variables and conditions of a `search` block, read against the study: keys looked up, bounds parsed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from pliant.config.search import SearchConfig, SearchVariableConfig
from pliant.config.study import Study
from pliant.config.study_keys import KeyPath, StudyKey, study_key
from pliant.errors import UserError, closest
from pliant.interfaces.optimizer import Value, Variable
from pliant.registry.discovery import Registry

Where = Callable[[Sequence[Any]], str]


@dataclass(frozen=True)
class SearchedVariable:
    """A variable of a search.

    Attributes:
        name: in formulas and results.
        keys: paths that it sets, all to its value.
        variable: its range or choices, SI.
        unit: SI unit, "" for pure numbers and what is no number.
        each: whether every value has a search of its own.
        conditions: indices of the conditions in which it sets its keys.
        settings: of choices: choice → JSON value that the key gets.
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
        """Whether its values are numbers."""
        return self.variable.type != "categorical" or not isinstance(self.variable.choices[0], str)


@dataclass(frozen=True)
class Condition:
    """One of the conditions in which every candidate is tried.

    Attributes:
        name: "" where the search states none.
        changes: path → JSON value.
        features: numbers of order one that tell it from the others; see `search_conditions`.
    """

    name: str
    changes: Mapping[KeyPath, Any] = field(default_factory=dict)
    features: tuple[float, ...] = ()


def no_place(path: Sequence[Any]) -> str:
    """Where nobody knows where a key stands."""
    return ""


def search_conditions(
    study: Study, registry: Registry, where: Where = no_place
) -> tuple[tuple[Condition, ...], dict[KeyPath, str]]:
    """The conditions of a study's search, one without a name where it states none; and their keys as written.

    Features, in the order in which the keys first appear: a number is scaled to 0…1 over the conditions; anything
    else has a 0 or 1 for each of its values in the order of the conditions. A key that a condition does not set has
    the study's value there; a key with one value tells nothing and has no feature.

    Raises:
        UserError: unknown keys, values that are none, conditions that say nothing or say the same.
    """
    config: SearchConfig = study.need("search", "a search")
    keys: dict[KeyPath, StudyKey] = {}
    found: list[tuple[str, dict[KeyPath, Any]]] = []
    for name, changes in config.conditions.items():
        at = ("search", "conditions", name)
        place = _at(where(at))
        if not changes:
            raise UserError(
                f"{place}'{'.'.join(at)}' sets nothing; name the key that is its own, such as 'task.pressure: 12 kPa'."
            )
        set_here: dict[KeyPath, Any] = {}
        for written, value in changes.items():
            key = study_key(study, registry, written, where((*at, written)))
            if key.path in set_here:
                raise UserError(f"{place}'{'.'.join(at)}' sets '{key.written}' twice; keep one.")
            set_here[key.path] = key.parsed(value, ".".join((*at, written)), where((*at, written)))
            keys.setdefault(key.path, key)
        same = next((other for other, held in found if held == set_here), None)
        if same is not None:
            raise UserError(f"{place}conditions '{same}' and '{name}' set the same; keep one.")
        found.append((name, set_here))
    if not found:
        return (Condition(""),), {}
    columns = [column for key in keys.values() for column in _features(key, [held for _, held in found])]
    conditions = tuple(
        Condition(name, held, tuple(column[row] for column in columns))
        for row, (name, held) in enumerate(found)
    )
    return conditions, {path: key.written for path, key in keys.items()}


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
    """The variables of a study's search, in the order in which they are written.

    Args:
        study: has `search`.
        registry: the installed kinds.
        where: names the place of a key path ("finger.yaml, line 3").

    Raises:
        UserError: unknown keys, bounds that the key does not take, patterns without a condition, keys set twice.
    """
    config: SearchConfig = study.need("search", "a search")
    conditions, written = search_conditions(study, registry, where)
    found = [
        _variable(study, registry, name, variable, tuple(c.name for c in conditions), where)
        for name, variable in config.variables.items()
    ]
    _set_once(found, conditions, written, where)
    return tuple(found)


def _variable(
    study: Study,
    registry: Registry,
    name: str,
    config: SearchVariableConfig,
    conditions: Sequence[str],
    where: Where,
) -> SearchedVariable:
    at = ("search", "variables", name)
    place, label = where(at), ".".join(at)
    keys = [study_key(study, registry, key, where((*at, "key")) or place) for key in config.keys(name)]
    if not keys:
        raise UserError(f"{_at(place)}'{label}.key' is an empty list; name a key of the study.")
    other = next((key for key in keys if (key.sort, key.unit) != (keys[0].sort, keys[0].unit)), None)
    if other is not None:
        raise UserError(
            f"{_at(place)}'{label}' sets '{keys[0].written}' and '{other.written}', which hold different things; "
            "make them two variables."
        )
    if config.choices:
        variable, settings = _choices(name, keys, config, label, place)
    else:
        variable, settings = _range(name, keys, config, label, place), {}
    if config.each and variable.type == "real":
        raise UserError(
            f"{_at(place)}'{label}' is a real number, which has no single values; 'each' is for whole numbers "
            "and choices."
        )
    return SearchedVariable(
        name=name,
        keys=tuple(key.path for key in keys),
        variable=variable,
        unit=keys[0].unit,
        each=config.each,
        conditions=_conditions(config, conditions, label, place),
        settings=settings,
        written=tuple(key.written for key in keys),
        stated=_stated(keys[0].value, settings),
    )


def _range(
    name: str, keys: Sequence[StudyKey], config: SearchVariableConfig, label: str, place: str
) -> Variable:
    sort = keys[0].sort
    if sort not in ("real", "integer"):
        raise UserError(
            f"{_at(place)}'{keys[0].written}' is no number, so '{label}' has no range; give 'choices'."
        )
    low, high = (
        _parsed(keys, value, f"{label}.{end}", place)
        for end, value in (("low", config.low), ("high", config.high))
    )
    if low > high:
        raise UserError(
            f"{_at(place)}'{label}' has low {config.low} above high {config.high}; exchange them."
        )
    if low == high and not config.each:  # one structure of a study that is fixed in one derived from it
        raise UserError(
            f"{_at(place)}'{label}' has low and high {config.low}, which leaves nothing to search; "
            f"write '{keys[0].written}' into the study instead."
        )
    return Variable(name, "integer" if sort == "integer" else "real", low, high)


def _choices(
    name: str, keys: Sequence[StudyKey], config: SearchVariableConfig, label: str, place: str
) -> tuple[Variable, dict[Value, Any]]:
    settings: dict[Value, Any] = {}
    for number, written in enumerate(config.choices):
        value = _parsed(keys, written, f"{label}.choices.{number}", place)
        plain = isinstance(value, int | float) and not isinstance(value, bool)
        choice: Value = value if plain or isinstance(value, str) else _label(written)
        if choice in settings:
            raise UserError(f"{_at(place)}'{label}.choices' has {written} twice; keep one.")
        settings[choice] = value
    if len({isinstance(choice, str) for choice in settings}) > 1:
        raise UserError(f"{_at(place)}'{label}.choices' mixes numbers and texts.")
    if len(settings) < 2 and not config.each:
        raise UserError(
            f"{_at(place)}'{label}.choices' has one value, which leaves nothing to search; write "
            f"'{keys[0].written}' into the study instead."
        )
    return Variable(name, "categorical", choices=tuple(settings)), settings


def _parsed(keys: Sequence[StudyKey], value: Any, label: str, place: str) -> Any:
    """The value as the first key takes it; each of them must."""
    first, *others = [key.parsed(value, label, place) for key in keys]
    if any(other != first for other in others):
        raise UserError(f"{_at(place)}'{label}' is {value}, which its keys read in different ways.")
    return first


def _label(written: Any) -> str:
    return written if isinstance(written, str) else json.dumps(written)


def _stated(value: Any, settings: Mapping[Value, Any]) -> Value | None:
    """The study's own value, among the choices by its choice."""
    if settings:
        return next((choice for choice, setting in settings.items() if setting == value), None)
    return value if isinstance(value, int | float) else None


def _conditions(
    config: SearchVariableConfig, names: Sequence[str], label: str, place: str
) -> tuple[int, ...]:
    """Indices of the conditions that the patterns of `only` match."""
    patterns = (config.only,) if isinstance(config.only, str) else config.only
    if not patterns:
        return tuple(range(len(names)))
    if names == ("",):
        raise UserError(f"{_at(place)}'{label}' has 'only', but the search states no conditions.")
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise UserError(
                f"{_at(place)}'{label}.only' has '{pattern}', which no condition is called"
                f"{closest(pattern, names)} Conditions: {', '.join(names)}."
            )
    return tuple(i for i, name in enumerate(names) if any(fnmatchcase(name, p) for p in patterns))


def _set_once(
    variables: Sequence[SearchedVariable],
    conditions: Sequence[Condition],
    written: Mapping[KeyPath, str],
    where: Where,
) -> None:
    """No key is set twice in a condition."""
    setters: dict[tuple[int, KeyPath], str] = {}
    for variable in variables:
        place = _at(where(("search", "variables", variable.name)))
        for index in variable.conditions:
            for path, name in zip(variable.keys, variable.written, strict=True):
                inside = f" in condition '{conditions[index].name}'" if conditions[index].name else ""
                if path in conditions[index].changes:
                    raise UserError(
                        f"{place}'{name}' is set by variable '{variable.name}' and by condition "
                        f"'{conditions[index].name}' itself; leave it out of one of them."
                    )
                other = setters.setdefault((index, path), variable.name)
                if other != variable.name or variable.keys.count(path) > 1:
                    who = f"'{other}' and '{variable.name}'" if other != variable.name else f"'{other}' twice"
                    raise UserError(f"{place}'{name}' is set by variable {who}{inside}; keep one.")


def _at(place: str) -> str:
    return f"{place}: " if place else ""
