"""Studies that Pliant writes: a base by `extends` and the changes, or on request a self-contained file."""

from __future__ import annotations

import copy
import io
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import CommentMark
from ruamel.yaml.tokens import CommentToken

from pliant.config.loading import (
    StudyFile,
    load_study,
    parse_extends,
    plain_values,
    with_override,
)
from pliant.config.paths import change_paths
from pliant.config.yaml_file import KeyPath, read_yaml
from pliant.errors import UserError
from pliant.registry.discovery import Registry
from pliant.store.store import whole_file
from pliant.units import UnitError, parse_quantity, si_unit, strip_unit_suffix

DIGITS = 16  # number of digits of the base's digest
LONGEST_NAME = 100
# The remark of a new fit replaces that of an earlier one; the user's text after it stays.
GENERATED = re.compile(r"# (?:fitted to |[^#]* ± )[^#]*(?=#|$)")


class StudyDraft:
    """A study to be written: the values of a file with overrides, and changes by key.

    Attributes:
        values: of the new study, as a study file has them; paths are absolute.
    """

    def __init__(self, source: Path, overrides: Sequence[str] = ()) -> None:
        """Read the source; raises `UserError` for one that cannot be read."""
        self._source = source
        self._base = StudyFile.read(source)
        self.values: dict[str, Any] = copy.deepcopy(self._base.values)
        for override in overrides:
            self.values = with_override(self.values, override)
        self._remarks: dict[KeyPath, str] = {}

    def set(self, path: KeyPath, value: Any, remark: str = "", spelled: bool = False) -> None:
        """Set one value; a changed `kind` clears its block, as it does on reading.

        Args:
            path: keys, with or without their unit, and item numbers; the number after the last adds an item.
            value: as a study file has it.
            remark: becomes a comment after it.
            spelled: a new last key keeps its spelling, for fields whose unit belongs to their name.
        """
        node: Any = self.values
        written: list[Any] = []
        for depth, key in enumerate(path):
            last = depth == len(path) - 1
            written.append(_written_key(node, key, spelled and last))
            if last and key == "kind" and node.get("kind") != value:
                node.clear()
            if isinstance(node, list) and written[-1] == len(node):
                node.append({})
            if last:
                node[written[-1]] = value
            else:
                if isinstance(node, dict) and node.get(written[-1]) is None:
                    node[written[-1]] = [] if isinstance(path[depth + 1], int) else {}
                node = node[written[-1]]
        if remark:
            self._remarks[tuple(written)] = " ".join(remark.split()).replace("#", "no. ")

    def name_after(self, target: Path) -> str:
        """Name the study after its file; the name of an override stays.

        The output folders of commands are named after the study: with its base's name it would overwrite them.
        """
        base, now = str(self._base.values["name"]), str(self.values["name"])
        if now != base:
            return now
        stem, own = study_name_from_path(self._source), study_name_from_path(target)
        named = f"{base}{own.removeprefix(stem)}" if own.startswith(stem) else own
        named = f"{base}-2" if named in ("", base) else named
        self.values["name"] = named[-LONGEST_NAME:].lstrip("-._")
        return str(self.values["name"])

    def drop(self, key: str) -> None:
        """Leave a block out."""
        self.values.pop(key, None)

    def text(self, target: Path, full: bool = False, head: str = "") -> str:
        """Return the YAML text.

        Args:
            target: its future path; paths in it are relative to its folder.
            full: everything in one file, with the comments of the source, instead of a base and the changes. Also
                used where merging over a base cannot give the change (a key removed from a block).
            head: a comment at the top.
        """
        folder = target.resolve().parent
        changes = None if full else _changes(self._base.values, self.values)
        if changes is None:
            tree = self._whole(folder)
        else:
            for path in self._remarks:
                _add_unchanged(changes, self.values, path)
            change_paths(changes, lambda path: os.path.relpath(path, folder))
            tree = CommentedMap()
            tree["extends"] = CommentedMap(
                file=os.path.relpath(self._source.resolve(), folder).replace(os.sep, "/"),
                values_sha256=self._base.digest[:DIGITS],
            )
            tree["extends"].fa.set_flow_style()
            for key, value in changes.items():
                tree[key] = as_node(value)
        for path, remark in self._remarks.items():
            _remark(tree, path, remark)
        stream = io.StringIO()
        yaml = yaml_writer()
        yaml.dump(tree, stream)
        return "".join(f"# {line}\n" for line in head.splitlines()) + stream.getvalue()

    def write(
        self, target: Path, meant: Mapping[str, Any], registry: Registry, full: bool = False, head: str = ""
    ) -> None:
        """Write the study, completely or not at all; see `text`.

        Args:
            target: the new file.
            meant: the canonical values that reading the file must give.
            registry: without the study's own plugin files.
            full: see `text`.
            head: see `text`.

        Raises:
            UserError: the file would be the source or one of its bases, cannot be written, or does not read back as
                meant.
        """
        refuse_bases(target, self._base)
        with whole_file(target) as partial:
            partial.write_text(self.text(target, full, head), encoding="utf-8")
            _check(partial, meant, registry)

    def _whole(self, folder: Path) -> CommentedMap:
        """Return the source and its bases as one tree with their comments, changed to the draft's values."""
        absolute: set[str] = set()
        tree = _tree(self._source, folder, absolute)
        values = copy.deepcopy(self.values)
        change_paths(values, lambda path: path if path in absolute else os.path.relpath(path, folder))
        _become(tree, values)
        tree.fa.set_block_style()
        return tree


def refuse_bases(target: Path, source: StudyFile) -> None:
    """Raise `UserError` where a new study would overwrite the study that it comes from, or one of its bases."""
    if target.resolve() == source.files[0]:
        raise UserError(f"{target} is the study itself, which is never overwritten; give another --out.")
    if target.resolve() in source.files:
        raise UserError(
            f"{target} is a base of {source.files[0].name}, which is never overwritten; give another --out."
        )


def study_name_from_path(path: Path) -> str:
    """Return a file's stem as the name of a study: characters that a name cannot have become a hyphen; may be empty."""
    return re.sub(r"[^A-Za-z0-9._]+", "-", path.stem).strip("-._")


def yaml_writer() -> YAML:
    """Return the YAML writer: blocks indented by two, no line broken."""
    yaml = YAML(typ="rt")
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.width, yaml.preserve_quotes = 10_000, True
    return yaml


def _written_key(node: Any, key: Any, spelled: bool = False) -> Any:
    """Return the key as a mapping has it: `shear_modulus` may be written `shear_modulus_pa`.

    A new key has no unit, unless it is spelled.
    """
    if not isinstance(node, dict):
        return int(key)
    bare = strip_unit_suffix(str(key))
    there = (name for name in node if strip_unit_suffix(name) == bare)
    return next(there, str(key) if spelled else bare)


def _same(a: Any, b: Any) -> bool:
    return json.dumps(a, sort_keys=True, default=str) == json.dumps(b, sort_keys=True, default=str)


def _changes(base: Mapping[str, Any], new: Mapping[str, Any], top: bool = True) -> dict[str, Any] | None:
    """Return the changes that, merged over `base`, give `new`; None where a key inside a block is removed."""
    gone = [key for key in base if key not in new]
    if gone and not top:
        return None
    found: dict[str, Any] = dict.fromkeys(gone)
    for key, value in new.items():
        old = base.get(key)
        if key in base and _same(old, value):
            continue
        if isinstance(old, Mapping) and isinstance(value, Mapping) and old.get("kind") == value.get("kind"):
            inner = _changes(old, value, top=False)
            if inner is None:
                return None
            found[key] = inner
        else:
            found[key] = copy.deepcopy(value)
    return found


def _add_unchanged(changes: dict[str, Any], values: dict[str, Any], path: KeyPath) -> None:
    """Add a value that has a remark to the changes, even if it did not change; first in its block."""
    node: Any = changes
    source: Any = values
    for key in path[:-1]:
        node = node.setdefault(key, {}) if isinstance(node, dict) else node[key]
        source = source[key]
    if isinstance(node, dict) and path[-1] not in node:
        changed = dict(node)
        node.clear()
        node.update({path[-1]: source[path[-1]], **changed})


def as_node(value: Any) -> Any:
    """Return plain values as ruamel's nodes: blocks on separate lines, lists of plain values on one line."""
    if isinstance(value, Mapping):
        return CommentedMap({key: as_node(item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        listed = CommentedSeq([as_node(item) for item in value])
        if not any(isinstance(item, Mapping) for item in value):
            listed.fa.set_flow_style()
        return listed
    return value


def _tree(path: Path, folder: Path, absolute: set[str]) -> CommentedMap:
    """Return a study file and its bases as one tree, paths relative to `folder`; `absolute` collects absolute ones."""
    tree, own = read_yaml(path), path.resolve().parent

    def told(name: str) -> str:
        if os.path.isabs(name):  # noqa: PTH117 - a text
            absolute.add(name)
            return name
        return os.path.relpath(own / name, folder)

    change_paths(tree, told)
    base = parse_extends(plain_values(tree.get("extends"), path), str(path))
    if base is None:
        return tree
    _remove(tree, "extends")
    below = _tree(path.parent / base.file, folder, absolute)
    _put_over(below, tree)
    return below


def _put_over(below: CommentedMap, over: CommentedMap) -> None:
    """Merge a tree over another, with its comments; `_become` corrects values that both change."""
    for key, value in over.items():
        if isinstance(value, CommentedMap) and isinstance(below.get(key), CommentedMap):
            _put_over(below[key], value)
        else:
            below[key] = value
        if key in over.ca.items:
            below.ca.items[key] = over.ca.items[key]


def _become(tree: Any, values: Any) -> None:
    """Change a tree, in place, until it has these `values`; unchanged values keep their text and comments."""
    pairs: Iterable[tuple[Any, Any]]
    if isinstance(tree, CommentedSeq):
        if not tree:  # written as "[]"
            tree.fa.set_flow_style()
        below = _cut_below(tree, len(tree) - 1) if tree and len(tree) != len(values) else ""
        del tree[len(values) :]
        tree.extend([as_node(value) for value in values[len(tree) :]])
        if below and tree:
            _put_below(tree, len(tree) - 1, below)
        pairs = enumerate(values)
    else:
        for key in [key for key in tree if str(key) not in values]:
            _remove(tree, key)
        pairs = values.items()
    for key, value in pairs:
        known = isinstance(tree, CommentedSeq) or key in tree
        there = tree[key] if known else None
        both = [(CommentedMap, Mapping), (CommentedSeq, list)]
        if any(isinstance(there, node) and isinstance(value, plain) for node, plain in both):
            _become(there, value)
        else:
            short = value["kind"] if isinstance(value, Mapping) and set(value) == {"kind"} else value
            if not known or not any(_same(plain_values(there), form) for form in (value, short)):
                tree[key] = as_node(value)


def _remove(tree: CommentedMap, key: str) -> None:
    """Remove a key; the comment lines below it, which the parser assigns to it, stay."""
    keys = list(tree)
    place = keys.index(key)
    below = _cut_below(tree, key)
    del tree[key]
    if below and place:
        _put_below(tree, keys[place - 1], below)
    elif below and len(keys) > 1:
        lines = [line.strip().removeprefix("#").strip() for line in below.splitlines() if line.strip()]
        tree.yaml_set_comment_before_after_key(keys[1], before="\n".join(lines))


def _leaf(tree: Any, key: Any) -> tuple[Any, Any]:
    """Return the node and key that the last line of a value belongs to: ruamel stores comments there."""
    while isinstance(tree[key], CommentedMap | CommentedSeq) and tree[key] and not tree[key].fa.flow_style():
        tree = tree[key]
        key = list(tree)[-1] if isinstance(tree, CommentedMap) else len(tree) - 1
    return tree, key


def _token(node: Any, key: Any) -> CommentToken | None:
    """Return the comment after a value, with the comment lines below it."""
    tokens = node.ca.items.get(key) or []
    place = 0 if isinstance(node, CommentedSeq) else 2
    return tokens[place] if len(tokens) > place else None


def _cut_below(tree: Any, key: Any) -> str:
    """Remove the comment lines below a value and return them."""
    node, last = _leaf(tree, key)
    token = _token(node, last)
    if token is None:
        return ""
    first, _, below = token.value.partition("\n")
    token.value = first + "\n"
    if not first.strip():
        del node.ca.items[last]
    return str(below)


def _put_below(tree: Any, key: Any, below: str) -> None:
    """Add comment lines below a value."""
    node, last = _leaf(tree, key)
    token = _token(node, last)
    if token is None:
        _put_behind(node, last, "\n" + below)
    else:
        token.value = token.value.removesuffix("\n") + "\n" + below


def _put_behind(node: Any, key: Any, comment: str) -> None:
    token = CommentToken(comment, CommentMark(0), None)
    node.ca.items[key] = [token, None] if isinstance(node, CommentedSeq) else [None, None, token, None]


def _put_on_lines(node: Any, key: Any) -> None:
    """Turn a value in brackets into a block on separate lines; its comments are moved below it."""
    value, outer = node[key], _token(node, key)
    inside = "".join(token.value for token in value.ca.end or ())
    node.ca.items.pop(key, None)
    value.ca.comment, value.ca.end = None, []  # ruamel keeps the outer token here too
    value.fa.set_block_style()
    below = inside + (outer.value if outer else "")
    if below:
        _put_below(node, key, below)


def _remark(tree: Any, path: KeyPath, remark: str) -> None:
    """Put a comment after a value, before a user's comment there; a parent in brackets becomes a block first."""
    node = tree
    for key in path[:-1]:
        if node[key].fa.flow_style():
            _put_on_lines(node, key)
        node = node[key]
    token = _token(node, path[-1])
    if token is None:
        _put_behind(node, path[-1], f" # {remark}\n")
        return
    first, _, below = token.value.partition("\n")
    kept = GENERATED.sub("", first).strip()
    token.value = f" # {remark}{'  ' + kept if kept else ''}\n{below}"


def _check(path: Path, canonical: Mapping[str, Any], registry: Registry) -> None:
    """Check that the written file reads back as the intended study."""
    meant = _comparable(canonical)
    read = _comparable(load_study(path, registry, note=lambda _: None).canonical())
    different = [key for key in meant if not _agree(key, meant[key], read.get(key))]
    if different:
        raise UserError(
            f"the new study would not say the same as the old one in {', '.join(different)}; write overrides, anchors "
            "and merges ('&', '*', '<<') out in the study and try again."
        )


def _agree(name: str, meant: Any, read: Any) -> bool:
    """Return whether two values are equal; values of a segment are stored as written, `module_length: 4.6 mm`."""
    if isinstance(meant, Mapping) and isinstance(read, Mapping):
        here, there = (
            {strip_unit_suffix(key): (key, item) for key, item in of.items()} for of in (meant, read)
        )
        return here.keys() == there.keys() and all(
            _agree(max(key, there[bare][0], key=len), item, there[bare][1])
            for bare, (key, item) in here.items()
        )
    if isinstance(meant, list | tuple) and isinstance(read, list | tuple):
        pairs = zip(meant, read, strict=False)
        return len(meant) == len(read) and all(_agree(name, one, other) for one, other in pairs)
    return bool(meant == read or _in_si(name, meant) == _in_si(name, read))


def _in_si(name: str, value: Any) -> Any:
    """Return a quantity as a number in the unit of its key; other values unchanged."""
    unit = si_unit(name)
    if not isinstance(value, str) or not unit:
        return value
    try:
        return parse_quantity(value, unit)
    except UnitError:
        return value


def _comparable(canonical: Mapping[str, Any]) -> dict[str, Any]:
    """Return the study as values, with paths resolved."""
    study = {"plugins": [], **copy.deepcopy(dict(canonical))}
    change_paths(study, os.path.realpath)
    return study
