"""Conversion of pydantic's report into sentences: where (file, line, key), what was wrong, what is allowed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, get_args, get_origin

from pydantic import ValidationError
from pydantic_core.core_schema import ErrorType

from pliant.config.study import NAME_PATTERN, allowed_keys, nested_model
from pliant.errors import closest
from pliant.interfaces.base import FrozenModel

MOST = 5
LONGEST = 80
PYDANTICS_OWN = frozenset((*get_args(ErrorType), "path_type"))
WANTED = dict.fromkeys(
    ("model_type", "model_attributes_type", "dict_type"), "it needs a block of 'key: value' lines"
) | {
    **dict.fromkeys(("tuple_type", "list_type"), "it needs a list such as [a, b]"),
    **dict.fromkeys(("string_type", "path_type"), "it should be a text"),
    "int": "it should be a whole number",
    "bool": "it should be true or false",
}
PATTERNS = {
    NAME_PATTERN: "it should begin with a letter or digit and hold only A-Z a-z 0-9 . _ -",
}


def at_place(place: str) -> str:
    """Return the beginning of a sentence with its place: "finger.yaml, line 3: "; empty where it is not known."""
    return f"{place}: " if place else ""


def sentences(
    error: ValidationError,
    model: type[FrozenModel],
    where: Callable[[Sequence[Any]], str],
    at: tuple[Any, ...] = (),
) -> str:
    """Return one line per problem, at most `MOST`; `where` returns the place of a key path ("finger.yaml, line 3").

    `at` is the path of the block that `model` describes, for a block that is validated alone.
    """
    details = error.errors()
    lines = []
    for detail in details[:MOST]:
        lines.append(at_place(where((*at, *detail["loc"]))) + _sentence(detail, model, at))
    if len(details) > MOST:
        lines.append(f"… and {len(details) - MOST} more.")
    return "\n".join(lines)


def _sentence(detail: Any, model: type[FrozenModel], at: tuple[Any, ...]) -> str:
    path = [str(part) for part in (*at, *detail["loc"])]
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
    if kind == "value_error":
        return f"'{key}': {detail['msg'].removeprefix('Value error, ')}."
    if kind not in PYDANTICS_OWN:  # a plugin's own sentence
        return f"'{key}': {detail['msg']}."
    return f"'{key}' is {_written(detail['input'])}; {_wanted(detail)}."


def _wanted(detail: Any) -> str:
    """Return what is allowed, without pydantic's and Python's terms."""
    kind, context = detail["type"], detail.get("ctx", {})
    if kind == "too_short":
        return f"it should have at least {context['min_length']} item{'s' * (context['min_length'] > 1)}"
    if kind == "too_long":
        return f"it should have at most {context['max_length']} items"
    if kind == "string_pattern_mismatch":
        pattern = context["pattern"]
        return PATTERNS.get(pattern, f"it should match the pattern {pattern}")
    words = WANTED.get(kind) or WANTED.get(kind.partition("_")[0])
    text = str(detail["msg"])
    text = text[:1].lower() + text[1:]
    return words or text.replace("input ", "it ").replace("string should", "it should")


def _written(value: Any) -> str:
    """Return the value as a study writes it, truncated."""
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value) if isinstance(value, str | int) else _flow(value)
    if isinstance(value, float):
        text = f"{value:.6g}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 20]}…"


def _flow(value: Any) -> str:
    """Return a list or block on one line of YAML."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return str(value)


def _model_at(model: type[FrozenModel] | None, path: Sequence[Any]) -> type[FrozenModel] | None:
    for part in path:
        if model is None:
            return None
        if isinstance(part, int):
            continue
        matches = [f for name, f in model.model_fields.items() if part in (name, f.validation_alias)]
        model = nested_model(_item(matches[0].annotation, path)) if matches else None
    return model


def _item(annotation: Any, path: Sequence[Any]) -> Any:
    """Return the item type at the path's index, for a tuple of different models (`effects`)."""
    arguments = [a for a in get_args(annotation) if a is not Ellipsis]
    index = next((part for part in path if isinstance(part, int)), None)
    if get_origin(annotation) is tuple and index is not None and index < len(arguments):
        return arguments[index]
    return annotation
