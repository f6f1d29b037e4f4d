"""Turn pydantic's report into sentences: where (file, line, key), what was wrong, what is allowed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, get_args

from pydantic import ValidationError

from pliant.config.study import allowed_keys, nested_model
from pliant.errors import closest
from pliant.interfaces.base import FrozenModel

MOST = 5


def sentences(error: ValidationError, model: type[FrozenModel], where: Callable[[Sequence[Any]], str]) -> str:
    """One line per problem, at most `MOST`; `where` names the place of a key path ("finger.yaml, line 3")."""
    details = error.errors()
    lines = []
    for detail in details[:MOST]:
        place = where(detail["loc"])
        lines.append(f"{place}: {_sentence(detail, model)}" if place else _sentence(detail, model))
    if len(details) > MOST:
        lines.append(f"… and {len(details) - MOST} more.")
    return "\n".join(lines)


def _sentence(detail: Any, model: type[FrozenModel]) -> str:
    path = [str(part) for part in detail["loc"]]
    key = ".".join(path) or "the study"
    kind = detail["type"]
    if kind == "extra_forbidden":
        owner = _model_at(model, detail["loc"][:-1])
        known = allowed_keys(owner) if owner else []
        name = f" of {'.'.join(path[:-1])}" if path[:-1] else " of a study"
        return (
            f"'{path[-1]}' is not a key{name}{closest(path[-1], known)} Allowed: {', '.join(known)}."
            if known
            else f"'{path[-1]}' is not a key{name}."
        )
    if kind == "missing":
        return f"key '{key}' is missing."
    if kind == "quantity":
        return (
            f"'{key}': {detail['ctx']['sentence']}."
            if "sentence" in detail["ctx"]
            else f"'{key}': {detail['msg']}."
        )
    if kind == "value_error":
        return f"'{key}': {detail['msg'].removeprefix('Value error, ')}."
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"'{key}' is {detail['input']!r}; it needs a block of 'key: value' lines."
    return f"'{key}' is {detail['input']!r}; {_lower(detail['msg']).replace('input ', 'it ')}."


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


def _model_at(model: type[FrozenModel] | None, path: Sequence[Any]) -> type[FrozenModel] | None:
    for part in path:
        if model is None:
            return None
        if isinstance(part, int):
            continue
        matches = [f for name, f in model.model_fields.items() if part in (name, _alias(f))]
        model = nested_model(_item(matches[0].annotation, path)) if matches else None
    return model


def _alias(field: Any) -> Any:
    return field.validation_alias


def _item(annotation: Any, path: Sequence[Any]) -> Any:
    """For a tuple of different models (`effects`), the one at the path's index."""
    arguments = [a for a in get_args(annotation) if a is not Ellipsis]
    index = next((part for part in path if isinstance(part, int)), None)
    if index is not None and index < len(arguments):
        return arguments[index]
    return annotation
