"""A study with some of its keys changed, written as a study writes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from pliant.config.problems import sentences
from pliant.config.study import Study, normalised, study_model
from pliant.errors import UserError, closest
from pliant.registry.discovery import Registry
from pliant.units import strip_unit_suffix


def changed(registry: Registry, study: Study, change: Mapping[str, Any], place: str = "search.verify.change") -> Study:
    """The study with `change` on top: ``{task.trials: 10, chain.base.roll: 30 deg}``.

    Args:
        registry: the plugins, those of the study's own files among them.
        study: validated.
        change: dotted key, with or without its unit, → value; list items by number.
        place: how messages name `change`.

    Raises:
        UserError: a key that the study does not have, or a value that it does not allow.
    """
    if not change:
        return study
    raw = study.model_dump(mode="json")
    for key, value in change.items():
        _set(raw, key.split("."), value, f"{place}.{key}")
    raw = normalised({key: value for key, value in raw.items() if value is not None})
    model = study_model(raw, registry)
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        raise UserError(f"{place}: {sentences(error, model, lambda path: '')}") from None


def _set(raw: Any, parts: Sequence[str], value: Any, place: str) -> None:
    """Set one key of a tree of JSON values, in place."""
    head, rest = parts[0], parts[1:]
    if isinstance(raw, list):
        if not head.isdigit() or int(head) >= len(raw):
            raise UserError(f"{place}: there is no item '{head}'; the list has {len(raw)}.")
        at: Any = int(head)
    else:
        at = next((key for key in raw if head in (key, strip_unit_suffix(key))), None)
        if at is None:
            known = [strip_unit_suffix(key) for key in raw]
            raise UserError(f"{place}: the study has no key '{head}' there{closest(head, known)}")
    if not rest:
        raw[at] = value
    elif isinstance(raw[at], dict | list):
        _set(raw[at], rest, value, place)
    else:
        raise UserError(f"{place}: '{head}' has no keys of its own in this study.")
