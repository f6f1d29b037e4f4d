"""Setting keys of a study: the blocks as JSON values once, then only what changes, validated anew."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from pliant.config.problems import sentences
from pliant.config.study import BLOCKS, Study, varied
from pliant.config.study_keys import KeyPath, StudyKey, study_key
from pliant.errors import UserError
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.family import FamilyConfig
from pliant.registry.discovery import Registry
from pliant.units import strip_unit_suffix

__all__ = ["KeyPath", "StudyKey", "StudySetter", "study_key", "written_path"]


def written_path(path: KeyPath) -> str:
    """A path as messages write it: `family.average_radius`."""
    return ".".join(strip_unit_suffix(part) if isinstance(part, str) else str(part) for part in path)


class StudySetter:
    """Makes studies that differ from one by some keys.

    Blocks that no key touches are shared; a touched block is built from the values that the study states, so that
    what it leaves to defaults stays so. Block types are those of the study, found by kind once.
    """

    def __init__(self, study: Study, registry: Registry) -> None:
        self._study = study
        self._registry = registry
        self._types: dict[tuple[str, str], type[FrozenModel]] = {}
        self._adapters: dict[str, TypeAdapter[Any]] = {}
        self._raw: dict[str, Any] = {}

    def study(self, changes: Mapping[KeyPath, Any]) -> Study:
        """The study with the keys set.

        Args:
            changes: path → JSON value in SI; where one lies in another, the longer path is set last.

        Raises:
            UserError: the study's models refuse the values, or the family the design (`InvalidDesignError`).
        """
        touched: dict[str, dict[KeyPath, Any]] = {}
        for path, value in changes.items():
            touched.setdefault(str(path[0]), {})[path[1:]] = value
        blocks = {head: self._block(head, inner) for head, inner in touched.items()}
        found: Study = self._study.model_copy(update=blocks)
        if {"family", "chain"} & set(touched):
            self._check_families(found)
        return found

    def _block(self, head: str, changes: Mapping[KeyPath, Any]) -> Any:
        held = getattr(self._study, head)
        kind = changes.get(("kind",))
        if kind is not None and (held is None or kind != held.kind):  # another kind has other keys
            raw: Any = {"kind": kind}
            held = None
        else:
            if head not in self._raw:
                self._raw[head] = self._dumped(head)
            raw = self._raw[head]
        for path in sorted(changes, key=len):
            raw = _with(raw, held, path, changes[path])
        try:
            if isinstance(held, tuple):
                return self._items(head, held).validate_python(raw)
            model = type(held) if held is not None else self._type(head, raw["kind"])
            return model.model_validate(raw)
        except ValidationError as error:
            model = type(held) if isinstance(held, FrozenModel) else FrozenModel
            raise UserError(sentences(error, model, lambda path: "", (head,))) from None

    def _items(self, head: str, held: tuple[Any, ...]) -> TypeAdapter[Any]:
        """What validates a list of blocks, each by its own type."""
        if head not in self._adapters:
            types: Any = tuple[tuple(type(item) for item in held)]  # type: ignore[misc]
            self._adapters[head] = TypeAdapter(types)
        return self._adapters[head]

    def _dumped(self, head: str) -> Any:
        """A block's raw values; families of segments in SI, so that no text is parsed for every candidate."""
        raw = _dumped(getattr(self._study, head))
        for segment in raw.get("segments", ()) if head == "chain" and self._study.family else ():
            if segment.get("family"):
                family = varied(self._study.family, segment["family"])  # type: ignore[arg-type]
                stated = {strip_unit_suffix(key) for key in segment["family"]}
                values = family.model_dump(mode="json")
                segment["family"] = {k: v for k, v in values.items() if strip_unit_suffix(k) in stated}
        return raw

    def _type(self, head: str, kind: str) -> type[FrozenModel]:
        if (head, kind) not in self._types:
            self._types[head, kind] = self._registry.get(BLOCKS[head], kind).config_model()
        return self._types[head, kind]

    def _check_families(self, study: Study) -> None:
        """Every design of the chain, as its family judges it."""
        if study.family is None:
            return
        designs: list[FamilyConfig] = []
        for number, segment in enumerate(study.chain.segments if study.chain else ()):
            if segment.rigid is not None or not segment.family:
                continue
            try:
                designs.append(varied(study.family, segment.family))  # type: ignore[arg-type]
            except ValidationError as error:
                at = ("chain", "segments", number, "family")
                raise UserError(sentences(error, type(study.family), lambda path: "", at)) from None
        segments = study.chain.as_segments() if study.chain else ()
        if not segments or any(s.rigid is None and not s.family for s in segments):
            designs.append(study.family)
        for design in designs:
            self._registry.build("family", design)


def _dumped(value: Any) -> Any:
    """What was stated, as JSON values under field names."""
    if isinstance(value, FrozenModel):
        return value.model_dump(mode="json", exclude_unset=True)
    if isinstance(value, tuple | list):
        return [_dumped(item) for item in value]
    return value


def _with(raw: Any, held: Any, path: KeyPath, value: Any) -> Any:
    """The raw values with one path set; only the containers on the path are copied."""
    if not path:
        return value
    part, rest = path[0], path[1:]
    if isinstance(part, int):
        items = list(raw)
        inner = held[part] if isinstance(held, tuple | list) and part < len(held) else None
        items[part] = _with(items[part], inner, rest, value)
        return items
    inner = held.get(part) if isinstance(held, Mapping) else getattr(held, part, None)
    below = dict(raw) if isinstance(raw, Mapping) else {}
    if isinstance(held, Mapping) or not isinstance(
        held, FrozenModel
    ):  # as people wrote it, with or without its unit
        old = [key for key in below if strip_unit_suffix(key) == strip_unit_suffix(part)]
        raw_inner = below.pop(old[0]) if old else None
    else:
        raw_inner = below.get(part)
    if rest and raw_inner is None:  # a default of the study's models
        raw_inner = _dumped(inner)
    below[part] = _with(raw_inner, inner, rest, value)
    return below


PLACE = "search.verify.change"


def changed(registry: Registry, study: Study, change: Mapping[str, Any], place: str = PLACE) -> Study:
    """The study with `change` on top: ``{task.trials: 10, chain.base.roll: 30 deg}``.

    Args:
        registry: the plugins, those of the study's own files among them.
        study: validated.
        change: dotted key, with or without its unit, → value; list items by number.
        place: of `change` in the study, for messages.

    Raises:
        UserError: a key that the study does not have, or a value that it does not allow.
    """
    if not change:
        return study
    found: dict[KeyPath, Any] = {}
    for written, value in change.items():
        key = study_key(study, registry, written, place)
        found[key.path] = key.parsed(value, written, place)
    return StudySetter(study, registry).study(found)


def number_at(study: Study, path: KeyPath) -> float:
    """The number at a path; of a segment's `family`, that of the family that it comes to.

    Raises:
        UserError: there is none.
    """
    found: Any = study
    for place, part in enumerate(path):
        found = _inside(found, part)
        if path[:2] == ("chain", "segments") and place == 3 and part == "family" and study.family is not None:
            found = varied(study.family, found or {})
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise UserError(f"'{written_path(path)}' holds no number that could be varied; give it a value.")
    return float(found)


def overridden(study: Study, path: KeyPath) -> tuple[KeyPath, ...]:
    """The same key of `family` in the segments that give it a value of their own."""
    if len(path) != 2 or path[0] != "family" or study.chain is None:
        return ()
    name = strip_unit_suffix(str(path[1]))
    return tuple(
        ("chain", "segments", number, "family", path[1])
        for number, segment in enumerate(study.chain.segments)
        if name in {strip_unit_suffix(key) for key in segment.family}
    )


def _inside(value: Any, part: str | int) -> Any:
    if isinstance(part, int):
        return value[part] if isinstance(value, list | tuple) and part < len(value) else None
    if isinstance(value, Mapping):
        named = {strip_unit_suffix(key): held for key, held in value.items()}
        return named.get(strip_unit_suffix(part))
    return getattr(value, part, None)
