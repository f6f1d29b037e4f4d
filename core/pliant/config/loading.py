"""Reading of a study: YAML 1.2 with line numbers, `extends`, overrides, validation by kind."""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from ruamel.yaml.comments import CommentedMap

from pliant.config.measurements import ColumnNotes
from pliant.config.overrides import merge, overridden, with_payload
from pliant.config.paths import change_paths
from pliant.config.places import Places
from pliant.config.problems import at_place, sentences
from pliant.config.study import Study, normalised, study_model, varied
from pliant.config.yaml_file import KeyPath, Plain, neighbours, read_yaml
from pliant.errors import UserError, closest
from pliant.formatting import listed
from pliant.interfaces.base import FrozenModel
from pliant.registry.block import blocks
from pliant.registry.discovery import Registry
from pliant.registry.files import not_run_yet, shown, with_files
from pliant.registry.shipped import REMEDY, shipped_in

Notes = TypeVar("Notes", bound=FrozenModel)


@dataclass
class _Sources:
    """The sources of each key.

    Attributes:
        places: "file, line" of each key, or the override that set it.
        files: read files, the study first, then its bases.
        remarks: notes on them for the user.
    """

    places: dict[KeyPath, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def where(self, path: Sequence[Any]) -> str:
        """Return the place of the nearest key that was written."""
        for end in range(len(path), -1, -1):
            place = self.places.get(tuple(path[:end]))
            if place is not None:
                return place
        return ""


def load_study(
    path: Path,
    registry: Registry,
    overrides: Sequence[str] = (),
    note: Callable[[str], None] = warnings.warn,
) -> Study:
    """Read, merge and validate a study file.

    Args:
        path: the YAML file.
        registry: the installed plugins; those of the study's own `plugins` files are added.
        overrides: "key=value" texts with dotted keys, as on the command line; list items by number.
        note: receives warnings, such as a base that has changed since it was extended.

    Raises:
        UserError: one line per problem, with file and line.
    """
    sources = _Sources()
    raw, _ = _read_with_bases(path, sources, ())
    for remark in sources.remarks:
        note(remark)
    _refuse_absent_blocks(raw, sources)
    stated = normalised(raw)
    for override in overrides:
        raw = overridden(raw, override, sources.places)
    raw = normalised(raw)
    own = _plugin_files(raw, sources)
    if code := not_run_yet(
        [*own, *_model_code(raw)]
    ):  # before the plugins run: the study may be someone else's
        note(f"{path.name} runs Python code of its own: {', '.join(map(shown, code))}.")
    registry = with_files(registry, own)
    raw = with_payload(stated, raw, registry, note) if overrides else raw
    try:
        model = study_model(raw, registry)
    except UserError as error:
        raise UserError(_kind_location(str(error), raw, sources) + str(error)) from None
    try:
        study = model.model_validate(raw)
    except ValidationError as error:
        raise UserError(sentences(error, model, sources.where)) from None
    study.stand_at(Places(sources.places, path.name))
    for number, segment in enumerate(study.chain.segments if study.chain else ()):
        try:  # a segment's changes are keys of the study's family; their errors are reported with lines too
            if study.family is not None and segment.family:
                varied(study.family, segment.family)
        except ValidationError as error:
            at = ("chain", "segments", number, "family")
            raise UserError(sentences(error, type(study.family), sources.where, at)) from None  # type: ignore[arg-type]
    for block in blocks().values():  # so that their errors are reported with lines
        if (check := block.function("check")) and study.block(block.key) is not None:
            check(study, registry, sources.where)
    return study


def _refuse_absent_blocks(raw: Mapping[str, Any], sources: _Sources) -> None:
    """Raise `UserError` for blocks of a package that ships with Pliant and is not registered."""
    absent = [
        key for key, value in raw.items() if value is not None and key not in blocks() and shipped_in(key)
    ]
    if absent:
        names = listed([f"'{key}'" for key in absent])
        belong = "belongs" if len(absent) == 1 else "belong"
        raise UserError(
            f"{at_place(sources.where(absent[:1]))}{names} {belong} to the package {shipped_in(absent[0])}, {REMEDY}."
        )


def _plugin_files(raw: Mapping[str, Any], sources: _Sources) -> list[Path]:
    """Return the files that `plugins` lists; their kinds are read before the study is validated."""
    files = raw.get("plugins") or []
    at = at_place(sources.where(("plugins",)))
    if not (isinstance(files, list) and all(isinstance(file, str) for file in files)):
        raise UserError(f"{at}'plugins' needs a list of Python files such as [my_effect.py].")
    for file in files:
        if not os.path.isfile(file):  # noqa: PTH113 - never raises, whatever the name
            beside = [p.name for p in Path(file).parent.glob("*.py")]
            raise UserError(
                f"{at}'plugins' names {shown(Path(file))}, which is no file{closest(Path(file).name, beside)}"
            )
    return [Path(file) for file in files]


def _model_code(raw: Mapping[str, Any]) -> list[Path]:
    """Return the Python file of the study's own model, if it is one."""
    block = raw.get("model")
    file = block.get("file") if isinstance(block, Mapping) else None
    return [Path(file)] if isinstance(file, str) and file.endswith(".py") else []


def _kind_location(message: str, raw: Mapping[str, Any], sources: _Sources) -> str:
    for key, block in raw.items():
        blocks = block if isinstance(block, list) else [block]
        for index, item in enumerate(blocks):
            kind = item.get("kind") if isinstance(item, Mapping) else None
            if kind is not None and f"kind '{kind}'" in message:
                path = (key, index, "kind") if isinstance(block, list) else (key, "kind")
                return at_place(sources.where(path))
    return ""


def load_notes(path: Path, model: type[Notes]) -> Notes | None:
    """Return a YAML file of notes, validated by `model`; None for a study (it has a `name`, or the key `pliant`).

    Notes may be nested below a key `measurements`, as `pliant import` prints them for a study; their `file` is
    ignored: it is the measurement in the same folder.

    Raises:
        UserError: one line per problem, with file and line.
    """
    sources = _Sources()
    tree = read_yaml(path)
    if "pliant" in tree or "name" in tree:
        return None
    pasted = tree["measurements"] if set(tree) == {"measurements"} else None
    values = Plain(path, sources.places).values(pasted if isinstance(pasted, CommentedMap) else tree)
    if pasted is not None:
        values.pop("file", None)
    try:
        notes = model.model_validate(values)
    except ValidationError as error:
        text = sentences(error, model, sources.where)
        raise UserError(text.replace(" of a study", " of this file")) from None
    if isinstance(notes, ColumnNotes):
        notes.stand_at(Places(sources.places))
    return notes


@dataclass(frozen=True)
class StudyFile:
    """The contents of a study file before validation.

    Attributes:
        values: merged with its bases, with absolute paths and blocks as mappings.
        files: the file and its bases.
        digest: SHA-256 of the values of the file and its bases.
    """

    values: dict[str, Any]
    files: tuple[Path, ...]
    digest: str

    @staticmethod
    def read(path: Path) -> StudyFile:
        """Read the file and its bases; raises `UserError` for files that cannot be read."""
        sources = _Sources()
        values, digest = _read_with_bases(path, sources, ())
        return StudyFile(normalised(values), tuple(sources.files), digest)


def with_override(values: Mapping[str, Any], override: str) -> dict[str, Any]:
    """Return the values of a study file with "key=value" applied."""
    return normalised(overridden(dict(values), override, {}))


def _read_with_bases(path: Path, sources: _Sources, chain: tuple[Path, ...]) -> tuple[dict[str, Any], str]:
    """Return the values of a file merged over those of its bases, and their digest."""
    data = read_yaml(path)
    resolved = path.resolve()
    if resolved in chain:
        names = " → ".join(p.name for p in (*chain, resolved))
        raise UserError(f"{path}: 'extends' runs in a circle ({names}).")
    sources.files.append(resolved)
    here = _Sources()
    own = Plain(path, here.places).values(data)
    extends = parse_extends(own.pop("extends", None), here.where(("extends",)))
    base: dict[str, Any] = {}
    base_digest = ""
    if extends is not None:
        base_path = path.parent / extends.file
        if not os.path.isfile(base_path):  # noqa: PTH113 - never raises, whatever the name
            place = here.where(("extends",))
            raise UserError(
                f"{place}: 'extends: {extends.file}' is no file beside it{neighbours(base_path)}."
            )
        base, base_digest = _read_with_bases(base_path, sources, (*chain, resolved))
        if not base_digest.startswith(extends.values_sha256):
            sources.remarks.append(
                f"{path.name}: its base {extends.file} has changed since this study was written; it is read as it is "
                "now."
            )
    # Comments, layout and the order of keys do not count.
    text = json.dumps([own, base_digest], sort_keys=True, default=str)
    digest = hashlib.sha256(text.encode()).hexdigest()
    change_paths(own, lambda path: str(resolved.parent / path))
    sources.places.update(here.places)
    return merge(base, own), digest


@dataclass(frozen=True)
class Extends:
    """The key `extends`: a base's file, and the first digits of the digest that it had ("" for any)."""

    file: str
    values_sha256: str = ""


def parse_extends(value: Any, place: str) -> Extends | None:
    """Return the value of `extends`; raises `UserError` beginning with `place` for an invalid one."""
    if value is None:
        return None
    if isinstance(value, str):
        return Extends(value)
    texts = isinstance(value, Mapping) and all(isinstance(v, str) for v in value.values())
    if texts and "file" in value and set(value) <= {"file", "values_sha256"}:
        return Extends(**value)
    raise UserError(
        f"{place}: 'extends' must be the name of one file, or {{file: base.yaml, values_sha256: …}}, both texts."
    )


def plain_values(node: Any, path: Path = Path()) -> Any:
    """Return a parsed YAML tree as plain values; raises `UserError` for tags and endless aliases."""
    return Plain(path).values(node)
