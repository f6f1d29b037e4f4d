"""Dotted keys of a study, as a search, a condition or a check writes them: `family.average_radius`,
`chain.segments.0.modules`, `task.target.radius`, `effects.0.factor`, `physics.kind`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import TypeAdapter, ValidationError

from pliant.config.problems import at_place, sentences
from pliant.config.study import Study, varied, written_name
from pliant.errors import UserError, closest
from pliant.interfaces.base import FrozenModel
from pliant.registry.block import blocks, kind_blocks
from pliant.registry.discovery import Registry
from pliant.units import quantities_in

KeyPath = tuple[str | int, ...]
# The type of a key for a search: a choice is one of a few texts, anything else is "other".
Sort = Literal["real", "integer", "text", "truth", "other"]
# Keys, besides those of blocks that say so, that control the computation and not what is simulated.
NOT_TO_SET = {
    "pliant": "it is the file's format",
    "name": "it names the output folder",
    "plugins": "they are code",
    "meta_model.data": "its designs are what the meta-model is fitted to",
}


@dataclass(frozen=True, eq=False)
class StudyKey:
    """A key that a study has.

    Attributes:
        written: as people write it, without unit suffixes.
        path: field names and list indices from the study down.
        sort: type of its value.
        unit: SI unit of a number, "" for pure numbers and other values.
        annotation: the type with its rules (units, bounds).
        value: the study's value as JSON; None where it is not given.
        kinds: for a block's `kind`: the installed kinds.
    """

    written: str
    path: KeyPath
    sort: Sort
    unit: str
    annotation: Any
    value: Any
    kinds: tuple[str, ...] = ()

    @cached_property
    def _adapter(self) -> TypeAdapter[Any]:
        return TypeAdapter(self.annotation)

    def parsed(self, value: Any, label: str, place: str = "") -> Any:
        """Return a value as JSON, SI, checked by the key's own rules.

        Args:
            value: as a study writes it ("6 mm").
            label: its name in the message (`search.variables.n1.low`).
            place: begins the message ("finger.yaml, line 3").

        Raises:
            UserError: the key does not take it.
        """
        at = at_place(place)
        if self.kinds and value not in self.kinds:
            raise UserError(
                f"{at}'{label}' is {value!r}, which is no installed kind{closest(str(value), self.kinds)} "
                f"Known: {', '.join(self.kinds)}."
            )
        if isinstance(value, float) and not math.isfinite(value):
            raise UserError(f"{at}'{label}' is {value}; it needs a finite number.")
        try:
            found = self._adapter.validate_python(value)
        except ValidationError as error:
            parts = tuple(label.split("."))
            raise UserError(sentences(error, FrozenModel, lambda path: place, parts)) from None
        if self.sort in ("real", "integer") and not (found is None or math.isfinite(found)):
            raise UserError(f"{at}'{label}' is {value}; it needs a finite number.")
        return self._adapter.dump_python(found, mode="json", exclude_unset=True)


def study_key(study: Study, registry: Registry, written: str, place: str = "") -> StudyKey:
    """Return the key that a dotted text means; names may have their unit (`wall_m`) or not (`wall`).

    Args:
        study: has the blocks that the key goes through.
        registry: with the installed kinds.
        written: the text.
        place: begins an error's message.

    Raises:
        UserError: the study has no such key, or it cannot be set.
    """
    at = at_place(place)
    parts = [int(p) if p.isascii() and p.isdigit() else p for p in str(written).split(".")]
    fixed = {**NOT_TO_SET, **{key: block.fixed for key, block in blocks().items() if block.fixed}}
    for name in (str(parts[0]), ".".join(map(str, parts[:2]))):
        if name in fixed:
            raise UserError(f"{at}'{written}' cannot be set: {fixed[name]}.")
    head = str(parts[0])
    kind_of = kind_blocks()
    if len(parts) == 2 and parts[1] == "kind" and head in kind_of:
        block = study.block(head)
        kinds = tuple(registry.kinds(kind_of[head]))
        return StudyKey(written, (head, "kind"), "text", "", str, block.kind if block else None, kinds)
    step = _Step(study, type(study), ())
    for number, part in enumerate(parts):
        step = step.into(
            part, ".".join(map(str, parts[:number])), f"{at}'{written}' is no key of this study: "
        )
        if number == 0 and step.value is None:
            raise UserError(f"{at}'{written}' cannot be set: the study has no '{head}' block.")
        if number == 3 and step.path[:2] == ("chain", "segments") and step.path[3] == "family":
            # Keys of the study's family that differ in the segment refer to the family with these changes.
            if study.family is None:
                raise UserError(f"{at}'{written}' cannot be set: the study has no 'family' block.")
            family = varied(study.family, step.value or {})
            step = _Step(family, type(family), step.path, step.names)
    if len(parts) == 1:
        model, example = _model(step.value, step.annotation), "0"
        if model is not None:
            hidden = ("kind", "visual", "visual_scale")
            named = (written_name(model, name) for name in model.model_fields if name not in hidden)
            example = next(named, "kind")
        raise UserError(f"{at}'{written}' is a whole block; name a key in it, such as '{written}.{example}'.")
    sort, unit = _sort(step.annotation)
    shown = ".".join(map(str, step.names))
    if isinstance(step.value, FrozenModel):
        value = step.value.model_dump(mode="json", exclude_unset=True)
    else:
        value = TypeAdapter(Any).dump_python(step.value, mode="json")
    return StudyKey(shown, step.path, sort, unit, step.annotation, value)


@dataclass(frozen=True, eq=False)
class _Step:
    """The state of following a key: the study's value there, its type, the path and the written names."""

    value: Any
    annotation: Any
    path: KeyPath
    names: tuple[str | int, ...] = ()

    def into(self, part: str | int, above: str, start: str) -> _Step:
        """Return the step to one part of a dotted key: a field or an item of a list."""
        model = _model(self.value, self.annotation)
        if model is not None:
            return self._field(model, part, above, start)
        if isinstance(part, int):
            if not isinstance(self.value, list | tuple):
                raise UserError(f"{start}'{above}' is no list{_unless_given(self.value)}.")
            if part >= len(self.value):
                has = f"items 0 to {len(self.value) - 1}" if self.value else "no item"
                raise UserError(f"{start}'{above}' has {has}.")
            item = _items(self.annotation, part)
            return _Step(self.value[part], item, (*self.path, part), (*self.names, part))
        inner = _mapping_values(self.annotation)
        if inner is not None:
            held = self.value if isinstance(self.value, Mapping) else {}
            return _Step(held.get(part), inner, (*self.path, part), (*self.names, part))
        if isinstance(self.value, list | tuple) and self.value:
            raise UserError(f"{start}'{above}' is a list; name an item by its number, such as '{above}.0'.")
        raise UserError(f"{start}'{above}' has no keys{_unless_given(self.value)}.")

    def _field(self, model: type[FrozenModel], part: str | int, above: str, start: str) -> _Step:
        names = {
            written: name for name in model.model_fields for written in (written_name(model, name), name)
        }
        if not isinstance(part, str) or part not in names:
            known = list(dict.fromkeys(written_name(model, name) for name in model.model_fields))
            owner = f"'{above}'" if above else "it"
            raise UserError(f"{start}{owner} has {', '.join(known)}{closest(str(part), known)}")
        name = names[part]
        info = model.model_fields[name]
        annotation = Annotated[(info.annotation, *info.metadata)] if info.metadata else info.annotation
        value = getattr(self.value, name, None)
        path, shown = (*self.path, name), (*self.names, written_name(model, name))
        return _Step(value, annotation, path, shown)


def _model(value: Any, annotation: Any) -> type[FrozenModel] | None:
    """Return the model in which a key's parts are looked up: that of the value, else that of the annotation."""
    if isinstance(value, FrozenModel):
        return type(value)
    if value is not None:
        return None
    models = [a for a in _arms(annotation) if isinstance(a, type) and issubclass(a, FrozenModel)]
    return models[0] if models else None


def _arms(annotation: Any) -> Iterator[Any]:
    """Return the types of a union, without their annotations."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _arms(get_args(annotation)[0])
    elif origin in (Union, UnionType):
        for arm in get_args(annotation):
            yield from _arms(arm)
    else:
        yield annotation


def _items(annotation: Any, index: int) -> Any:
    """Return the type of a list's item."""
    for arm in _arms(annotation):
        if get_origin(arm) in (tuple, list):
            items = [a for a in get_args(arm) if a is not Ellipsis]
            return items[index] if index < len(items) else items[0] if items else Any
    return Any


def _mapping_values(annotation: Any) -> Any:
    """Return the type of a mapping's values; None for another type."""
    for arm in _arms(annotation):
        if get_origin(arm) in (dict, Mapping):
            return get_args(arm)[1]
    return None


def _sort(annotation: Any) -> tuple[Sort, str]:
    """Return the sort of a type, and the unit that it is annotated with."""
    arms = [arm for arm in _arms(annotation) if arm is not type(None)]
    unit = next((one.unit for one in quantities_in(annotation)), "")
    if float in arms:
        return "real", "" if unit == "dimensionless" else unit
    if int in arms:
        return "integer", ""
    if arms == [bool]:
        return "truth", ""
    if arms and all(arm is str or get_origin(arm) is Literal for arm in arms):
        return "text", ""
    return "other", ""


def _unless_given(value: Any) -> str:
    return ", since the study does not give it" if value is None else ""
