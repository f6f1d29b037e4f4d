"""Keys of a study by dots, as a search, a condition or a check writes them: `family.average_radius`,
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
from pliant.config.study import BLOCKS, Study, varied, written_name
from pliant.errors import UserError, closest
from pliant.interfaces.base import FrozenModel
from pliant.registry.discovery import Registry
from pliant.units import quantities_in

KeyPath = tuple[str | int, ...]
# What a key holds, as far as a search cares: a choice is a text out of a few, anything else is "other".
Sort = Literal["real", "integer", "text", "truth", "other"]
# Keys that say how a study is worked on, not what is simulated.
NOT_TO_SET = {
    "pliant": "it is the file's format",
    "name": "it names the output folder",
    "plugins": "they are code",
    "search": "it is the search itself",
    "optimizer": "it is what searches",
    "measurements": "they are what the bench recorded",
    "posterior": "it is how sure a fit was",
    "protocols": "they are for the bench",
    "sweep": "its designs are what the meta-model is fitted to",
    "meta_model.data": "its designs are what the meta-model is fitted to",
}


@dataclass(frozen=True, eq=False)
class StudyKey:
    """A key that a study has.

    Attributes:
        written: as people write it, without unit suffixes.
        path: field names and list indices from the study down.
        sort: what it holds.
        unit: SI unit of a number, "" for pure numbers and what is none.
        annotation: the type with its rules (units, bounds).
        value: what the study holds there as JSON values; None where it is not given.
        kinds: of a block's `kind`: the installed kinds.
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
        """A value as JSON, SI, judged by the key's own rules.

        Args:
            value: as a study writes it ("6 mm").
            label: what it is called in the message (`search.variables.n1.low`).
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
    """The key that a dotted text means; names may have their unit (`wall_m`) or not (`wall`).

    Args:
        study: has the blocks that the key goes through.
        registry: knows the kinds.
        written: the text.
        place: begins an error's message.

    Raises:
        UserError: the study has no such key, or it is none that anybody may set.
    """
    at = at_place(place)
    parts = [int(p) if p.isascii() and p.isdigit() else p for p in str(written).split(".")]
    for name in (str(parts[0]), ".".join(map(str, parts[:2]))):
        if name in NOT_TO_SET:
            raise UserError(f"{at}'{written}' cannot be set: {NOT_TO_SET[name]}.")
    head = str(parts[0])
    if len(parts) == 2 and parts[1] == "kind" and head in BLOCKS:
        block = getattr(study, head)
        kinds = tuple(registry.kinds(BLOCKS[head]))
        return StudyKey(written, (head, "kind"), "text", "", str, block.kind if block else None, kinds)
    step = _Step(study, type(study), ())
    for number, part in enumerate(parts):
        step = step.into(
            part, ".".join(map(str, parts[:number])), f"{at}'{written}' is no key of this study: "
        )
        if number == 0 and step.value is None:
            raise UserError(f"{at}'{written}' cannot be set: the study has no '{head}' block.")
        if number == 3 and step.path[:2] == ("chain", "segments") and step.path[3] == "family":
            # Keys of the study's family that differ in the segment: of the family that it comes to.
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
    """How far a key has been followed: what the study holds there, its type, the path and the written names."""

    value: Any
    annotation: Any
    path: KeyPath
    names: tuple[str | int, ...] = ()

    def into(self, part: str | int, above: str, start: str) -> _Step:
        """The step to one part of a dotted key: a field, an item of a list."""
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
    """The model that a key's parts are looked up in: of what is there, else of what may be there."""
    if isinstance(value, FrozenModel):
        return type(value)
    if value is not None:
        return None
    models = [a for a in _arms(annotation) if isinstance(a, type) and issubclass(a, FrozenModel)]
    return models[0] if models else None


def _arms(annotation: Any) -> Iterator[Any]:
    """The types of a union, without what annotates them."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _arms(get_args(annotation)[0])
    elif origin in (Union, UnionType):
        for arm in get_args(annotation):
            yield from _arms(arm)
    else:
        yield annotation


def _items(annotation: Any, index: int) -> Any:
    """Type of a list's item."""
    for arm in _arms(annotation):
        if get_origin(arm) in (tuple, list):
            items = [a for a in get_args(arm) if a is not Ellipsis]
            return items[index] if index < len(items) else items[0] if items else Any
    return Any


def _mapping_values(annotation: Any) -> Any:
    """Type of a mapping's values; None where it is no mapping."""
    for arm in _arms(annotation):
        if get_origin(arm) in (dict, Mapping):
            return get_args(arm)[1]
    return None


def _sort(annotation: Any) -> tuple[Sort, str]:
    """What a type holds, and the unit that it is annotated with."""
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
