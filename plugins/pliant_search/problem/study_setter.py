"""Setting of a study's keys: blocks are dumped as JSON values once; only changed blocks are validated again."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from pliant.config.problems import sentences
from pliant.config.study import Study, varied
from pliant.config.study_keys import KeyPath, study_key
from pliant.errors import UserError
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.family import FamilyConfig
from pliant.registry.block import kind_blocks
from pliant.registry.discovery import Registry
from pliant.units import strip_unit_suffix


def written_path(path: KeyPath) -> str:
    """Return a path in the notation of messages: `family.average_radius`."""
    return ".".join(strip_unit_suffix(part) if isinstance(part, str) else str(part) for part in path)


class StudySetter:
    """Builder of studies that differ from one study in some keys.

    Unchanged blocks are shared. A changed block is built from the values that the study states, so that defaults remain
    defaults. Block types are those of the study, looked up by kind once.
    """

    def __init__(self, study: Study, registry: Registry) -> None:
        self._study, self._registry = study, registry
        self._raw: dict[str, Any] = {}

    def study(self, changes: Mapping[KeyPath, Any]) -> Study:
        """Return the study with the keys set.

        Args:
            changes: path → JSON value in SI; a path inside another one is set after it.

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
        raw: Any = {"kind": changes.get(("kind",))}
        if raw["kind"] is not None and (held is None or raw["kind"] != held.kind):
            held = None  # keys depend on the kind
        else:
            raw = self._stated(head)
        for path in sorted(changes, key=len):
            raw = _with(raw, held, path, changes[path])
        try:
            if isinstance(held, tuple):
                return _adapter(tuple(type(item) for item in held)).validate_python(raw)
            model = type(held) if held is not None else self._registry.config_model(kind_blocks()[head], raw)
            return model.model_validate(raw)
        except ValidationError as error:
            raise _refused(
                error, type(held) if isinstance(held, FrozenModel) else FrozenModel, head
            ) from None

    def _stated(self, head: str) -> Any:
        """Return a block's raw values; families of segments in SI, so that no text is parsed for every candidate."""
        if head in self._raw:
            return self._raw[head]
        raw = self._raw[head] = _dumped(getattr(self._study, head))
        for segment in raw.get("segments", ()) if head == "chain" and self._study.family else ():
            if segment.get("family"):
                family = varied(self._study.family, segment["family"])  # type: ignore[arg-type]
                stated = {strip_unit_suffix(key) for key in segment["family"]}
                values = family.model_dump(mode="json")
                segment["family"] = {k: v for k, v in values.items() if strip_unit_suffix(k) in stated}
        return raw

    def _check_families(self, study: Study) -> None:
        """Validate every design of the chain by its family."""
        if study.family is None:
            return
        designs: list[FamilyConfig] = []
        for number, segment in enumerate(study.chain.segments if study.chain else ()):
            if segment.rigid is None and segment.family:
                try:
                    designs.append(varied(study.family, segment.family))  # type: ignore[arg-type]
                except ValidationError as error:
                    place = ("chain", "segments", number, "family")
                    raise _refused(error, type(study.family), *place) from None
        segments = study.chain.as_segments() if study.chain else ()
        if not segments or any(s.rigid is None and not s.family for s in segments):
            designs.append(study.family)
        for design in designs:
            self._registry.build("family", design)


def _refused(error: ValidationError, model: type[FrozenModel], *place: str | int) -> UserError:
    return UserError(sentences(error, model, lambda path: "", place))


@lru_cache(64)
def _adapter(types: tuple[type, ...]) -> TypeAdapter[Any]:
    """Return the validator of a tuple of blocks of given types."""
    return TypeAdapter(tuple[types])  # type: ignore[valid-type]


def _dumped(value: Any) -> Any:
    """Return the values that were set explicitly, as JSON values under field names."""
    if isinstance(value, FrozenModel):
        return value.model_dump(mode="json", exclude_unset=True)
    return [_dumped(item) for item in value] if isinstance(value, tuple | list) else value


def _with(raw: Any, held: Any, path: KeyPath, value: Any) -> Any:
    """Return the raw values with one path set; only the containers on the path are copied."""
    if not path:
        return value
    part, rest = path[0], path[1:]
    if isinstance(part, int):
        inner = held[part] if isinstance(held, tuple | list) and part < len(held) else None
        return [*raw[:part], _with(raw[part], inner, rest, value), *raw[part + 1 :]]
    inner = held.get(part) if isinstance(held, Mapping) else getattr(held, part, None)
    below = dict(raw) if isinstance(raw, Mapping) else {}
    old = part
    if not isinstance(held, FrozenModel):  # as written, with or without its unit
        old = next((key for key in below if strip_unit_suffix(key) == strip_unit_suffix(part)), part)
    raw_inner = below.pop(old, None)
    if rest and raw_inner is None:  # a default of the study's models
        raw_inner = _dumped(inner)
    below[part] = _with(raw_inner, inner, rest, value)
    return below


def changed(
    registry: Registry, study: Study, change: Mapping[str, Any], place: str = "search.verify.change"
) -> Study:
    """Return the study with `change` on top: ``{task.trials: 10, chain.base.roll: 30 deg}``.

    Args:
        registry: the plugins, those of the study's own files among them.
        study: validated.
        change: dotted key, with or without its unit, → value; list items by number.
        place: location of `change` in the study, for messages.

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
    """Return the number at a path; for a segment's `family`, that of the resulting family.

    Raises:
        UserError: there is no number at the path.
    """
    found: Any = study
    for place, part in enumerate(path):
        if isinstance(part, int):
            found = found[part] if isinstance(found, list | tuple) and part < len(found) else None
        elif isinstance(found, Mapping):
            named = {strip_unit_suffix(key): held for key, held in found.items()}
            found = named.get(strip_unit_suffix(part))
        else:
            found = getattr(found, part, None)
        if path[:2] == ("chain", "segments") and place == 3 and part == "family" and study.family is not None:
            found = varied(study.family, found or {})
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise UserError(f"'{written_path(path)}' holds no number that could be varied; give it a value.")
    return float(found)


def overridden(study: Study, path: KeyPath) -> tuple[KeyPath, ...]:
    """Return the paths of the same `family` key in the segments that state their own value."""
    if len(path) != 2 or path[0] != "family" or study.chain is None:
        return ()
    name = strip_unit_suffix(str(path[1]))
    return tuple(
        ("chain", "segments", number, "family", path[1])
        for number, segment in enumerate(study.chain.segments)
        if name in {strip_unit_suffix(key) for key in segment.family}
    )
