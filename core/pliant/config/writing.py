"""Write a study anew with other effects: every line that does not change stays as it was, comments included.

The text is not dumped from its tree: changes are spliced in at the places that the YAML parser marks.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from pliant.config.loading import PATH_KEYS, read_yaml
from pliant.config.splicing import Splicer, find, kind_of
from pliant.errors import UserError
from pliant.units import strip_unit_suffix

# What `entry` writes behind a value; an older one gives way to it.
GENERATED = re.compile(r"[ \t]*# (?:fitted to |[^#\n]* ± )[^#\n]*?(?=[ \t]*(?:#|$))", re.MULTILINE)
SIMPLE = re.compile(r"[A-Za-z_./][\w./+-]*")
WORDS_OF_YAML = {"true", "false", "null", "yes", "no", "on", "off"}
FULL = re.compile(r"#[^\n]*")


@dataclass(frozen=True)
class EffectEntry:
    """One effect as it is to stand in the file.

    Attributes:
        kind: the effect's.
        values: text of each value by the key as it is written.
        comments: behind these values, without "#".
        note: behind the kind.
        at: place in the study's list whose effect this replaces; None adds it at the end.
    """

    kind: str
    values: Mapping[str, str] = field(default_factory=dict)
    comments: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    at: int | None = None

    def lines(self) -> list[str]:
        """Block style, without the dash."""
        first = f"kind: {self.kind}" + (f"  # {_one_line(self.note)}" if self.note else "")
        return [first, *(self.line(key) for key in self.values)]

    def line(self, key: str) -> str:
        """One value with its comment."""
        comment = self.comments.get(key, "")
        return f"{key}: {self.values[key]}" + (f"  # {_one_line(comment)}" if comment else "")

    def flow(self) -> str:
        """``{kind: …}`` on one line."""
        return "{" + ", ".join([f"kind: {self.kind}", *(f"{k}: {v}" for k, v in self.values.items())]) + "}"


def study_with_effects(
    source: Path,
    target: Path,
    entries: Sequence[EffectEntry],
    present: Sequence[Mapping[str, Any]],
    overrides: Sequence[str] = (),
) -> str:
    """The text of a study with effects added or replaced.

    Args:
        source: the study that is read.
        target: where the text will be written: paths in it are relative to that place.
        entries: what is new.
        present: all effects that the study has now, with those of the files that it extends.
        overrides: changes "key=value" with which `source` was read; they are written into the text.

    Raises:
        UserError: a file that cannot be read.
    """
    read_yaml(source)  # for its messages
    text = source.read_text(encoding="utf-8-sig")
    text = _relocated(text, source.resolve().parent, target.resolve().parent)
    own = not any(_path_of(override)[0] == "effects" for override in overrides)
    for override in overrides:
        if _path_of(override)[0] != "effects":
            text = _overridden(text, override, target.resolve().parent)
    return _with_effects(text, entries, present, own)


def study_with_values(
    source: Path,
    target: Path,
    block: str,
    values: Mapping[str, str],
    remarks: Mapping[str, str],
    overrides: Sequence[str] = (),
) -> str:
    """The text of a study with keys of one block set anew.

    Args:
        source: the study that is read.
        target: where the text will be written: paths in it are relative to that place.
        block: name of the block, such as `material`.
        values: text of each value by its key, without unit in the name.
        remarks: comments behind these keys and, by "kind", behind the block's kind; without "#".
        overrides: changes "key=value" with which `source` was read; they are written into the text.

    Raises:
        UserError: a file that cannot be read.
    """
    read_yaml(source)  # for its messages
    text = source.read_text(encoding="utf-8-sig")
    text = _relocated(text, source.resolve().parent, target.resolve().parent)
    for override in overrides:
        text = _overridden(text, override, target.resolve().parent)
    for key, value in values.items():
        text = _set(text, (block, _written_key(text, block, key)), value)
    return _remarked(text, block, remarks)


def study_with_changes(
    source: Path,
    target: Path,
    changes: Mapping[tuple[str, ...], str],
    without: Sequence[str],
    overrides: Sequence[str] = (),
) -> str:
    """The text of a study with keys anywhere set anew and some of its blocks left out.

    Args:
        source: the study that is read; one without `extends`.
        target: where the text will be written: paths in it are relative to that place.
        changes: path of keys and item numbers → text of the value; keys with or without their unit.
        without: top-level keys to leave out.
        overrides: changes "key=value" with which `source` was read; they are written into the text.

    Raises:
        UserError: a file that cannot be read, a key that has no place in the text.
    """
    read_yaml(source)  # for its messages
    text = source.read_text(encoding="utf-8-sig")
    text = _relocated(text, source.resolve().parent, target.resolve().parent)
    for override in overrides:
        if _path_of(override)[0] not in without:
            text = _overridden(text, override, target.resolve().parent)
    for path, value in changes.items():
        text = _set(text, _written_path(text, path), value)
    return _without(text, without)


def _written_path(text: str, path: Sequence[str]) -> list[str]:
    """The path as the text has it; what is not in the text is written without its unit."""
    node: Node | None = Splicer(text).root
    found = []
    for key in path:
        names = [str(name.value) for name, _ in node.value] if isinstance(node, MappingNode) else [key]
        bare = strip_unit_suffix(key)
        found.append(next((name for name in names if strip_unit_suffix(name) == bare), bare))
        node = find(node, (found[-1],))
    return found


def _without(text: str, keys: Sequence[str]) -> str:
    """The text without some blocks of a study in block style."""
    splicer = Splicer(text)
    if not isinstance(splicer.root, MappingNode) or splicer.root.flow_style:
        raise UserError("a study on one line loses no block.")
    for name, value in splicer.root.value:
        if name.value in keys:
            end = splicer.line_end(max(splicer.last(value), int(name.end_mark.index)))
            splicer.replace(int(name.start_mark.index), end + 1, "")
    return splicer.done()


def _written_key(text: str, block: str, key: str) -> str:
    """The key as the text has it: `shear_modulus` may stand as `shear_modulus_pa`."""
    node = find(Splicer(text).root, (block,))
    names = [str(name.value) for name, _ in node.value] if isinstance(node, MappingNode) else []
    return next((name for name in names if key in (name, strip_unit_suffix(name))), key)


def _remarked(text: str, block: str, remarks: Mapping[str, str]) -> str:
    """Comments behind values of a block, or all of them behind a block that stands on one line."""
    splicer = Splicer(text)
    node = find(splicer.root, (block,))
    if not isinstance(node, MappingNode) or (
        isinstance(splicer.root, MappingNode) and splicer.root.flow_style
    ):
        return text
    if node.flow_style:
        places = {int(node.end_mark.index): "; ".join(remarks.values())}
    else:
        keys = {strip_unit_suffix(str(name.value)): value for name, value in node.value}
        places = {splicer.last(keys[key]): remark for key, remark in remarks.items() if key in keys}
    for end, remark in places.items():
        old = GENERATED.match(splicer.text, end)
        splicer.replace(end, old.end() if old else end, f"  # {_one_line(remark)}")
    return splicer.done()


def flow_text(value: Any) -> str:
    """A plain value as YAML on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{flow_text(str(k))}: {flow_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(flow_text(item) for item in value) + "]"
    if isinstance(value, str) and SIMPLE.fullmatch(value) and value.lower() not in WORDS_OF_YAML:
        return value
    return json.dumps(value, ensure_ascii=False)


def _relocated(text: str, old: Path, new: Path) -> str:
    """Relative paths of the file as they read from another folder."""
    if old == new:
        return text
    splicer = Splicer(text)
    nodes = [find(splicer.root, path) for path in (("extends",), *PATH_KEYS)]
    plugins = find(splicer.root, ("plugins",))
    nodes += plugins.value if isinstance(plugins, SequenceNode) else []
    for node in nodes:
        if isinstance(node, ScalarNode) and node.value and not os.path.isabs(node.value):  # noqa: PTH117
            moved = flow_text(os.path.relpath(old / node.value, new))
            splicer.replace(node.start_mark.index, node.end_mark.index, moved)
    return splicer.done()


def _path_of(override: str) -> list[str]:
    return override.partition("=")[0].strip().split(".")


def _overridden(text: str, override: str, folder: Path) -> str:
    path, written = _path_of(override), override.partition("=")[2].strip()
    value = YAML(typ="safe", pure=True).load(written)
    if (path[0], path[-1]) in PATH_KEYS and isinstance(value, str):
        value = os.path.relpath(Path(value).absolute(), folder)
        return _set(text, path, flow_text(value))
    if path == ["plugins"] and isinstance(value, list):
        value = [os.path.relpath(Path(file).absolute(), folder) for file in value]
        return _set(text, path, flow_text(value))
    if isinstance(value, Mapping):
        for key, inner in value.items():
            text = _overridden(text, f"{'.'.join(path)}.{key}={flow_text(inner)}", folder)
        return text
    return _set(text, path, written)


def _set(text: str, path: Sequence[str], value: str) -> str:
    """The text with one value set; a changed `kind` clears its block, as it does on loading."""
    splicer = Splicer(text)
    node = splicer.root
    for depth, key in enumerate(path):
        child = find(node, (key,))
        rest = path[depth + 1 :]
        if child is None:
            if not isinstance(node, MappingNode):
                raise UserError(
                    f"'{'.'.join(path)}={value}' cannot be written into the study; write it there first."
                )
            splicer.insert_key(node, key, _nested(rest, value))
            return splicer.done()
        ends = child.start_mark.index, child.end_mark.index
        if list(rest) == ["kind"] and kind_of(child) != value:
            ends = ends[0], splicer.last(child)
            splicer.replace(*ends, _nested(rest, value))
            return splicer.done()
        if rest and isinstance(child, ScalarNode):
            splicer.replace(
                *ends, f"{{kind: {child.value}, {'.'.join(rest[:1])}: {_nested(rest[1:], value)}}}"
            )
            return splicer.done()
        if not rest:
            splicer.replace(ends[0], splicer.last(child), value)
            return splicer.done()
        node = child
    return text


def _nested(path: Sequence[str], value: str) -> str:
    return value if not path else "{" + f"{path[0]}: {_nested(path[1:], value)}" + "}"


def _with_effects(
    text: str, entries: Sequence[EffectEntry], present: Sequence[Mapping[str, Any]], own: bool
) -> str:
    splicer = Splicer(text)
    root, node = splicer.root, find(splicer.root, ("effects",))
    if isinstance(root, MappingNode) and root.flow_style:
        items = [flow_text(effect) for effect in present]
        _place(items, [entry.flow() for entry in entries], entries)
        whole = "[" + ", ".join(items) + "]"
        return _set(text, ("effects",), whole) if node is not None else _added(splicer, root, whole)
    listed = isinstance(node, SequenceNode) and bool(node.value) and own and len(node.value) == len(present)
    if listed and isinstance(node, SequenceNode) and not node.flow_style:
        return _in_block(splicer, node, entries)
    kept = [splicer.of(item) for item in node.value] if listed and node is not None else []
    items = [f"- {item}" for item in kept or [flow_text(effect) for effect in present]]
    _place(items, ["- " + "\n    ".join(entry.lines()) for entry in entries], entries)
    block = "".join(f"\n  {item}" for item in items)
    if node is None:
        return splicer.text + f"effects:{block}\n"
    start, end = node.start_mark.index, splicer.last(node)
    if start == end:  # an empty value is marked where the next key begins
        start = end = splicer.key_end(root, "effects")
    comments = FULL.findall(_gaps(splicer, node)) if listed else []
    block = "".join(f"\n  {comment}" for comment in comments) + block
    start = len(splicer.text[:start].rstrip(" "))
    end = max(start, end)
    at = splicer.line_end(end)
    splicer.replace(at, at, block)
    splicer.replace(start, end, "")
    return splicer.done()


def _added(splicer: Splicer, root: MappingNode, whole: str) -> str:
    splicer.insert_key(root, "effects", whole)
    return splicer.done()


def _place(items: list[str], texts: Sequence[str], entries: Sequence[EffectEntry]) -> None:
    """Put each entry's text where it belongs among the items."""
    for entry, text in zip(entries, texts, strict=True):
        if entry.at is None:
            items.append(text)
        else:
            items[entry.at] = text


def _gaps(splicer: Splicer, node: Node) -> str:
    """What stands in a flow list between its items."""
    edges = [node.start_mark.index]
    for item in node.value:
        edges += [item.start_mark.index, item.end_mark.index]
    edges.append(node.end_mark.index)
    return "\n".join(splicer.text[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True))


def _in_block(splicer: Splicer, node: SequenceNode, entries: Sequence[EffectEntry]) -> str:
    """Entries in a list of which every item has its own dash."""
    at = splicer.line_end(splicer.last(node))
    indent = " " * node.start_mark.column
    for entry in entries:
        if entry.at is None:
            lines = f"\n{indent}  ".join(entry.lines())
            splicer.replace(at, at, f"\n{indent}- {lines}")
            continue
        item = node.value[entry.at]
        if isinstance(item, MappingNode) and not item.flow_style:
            _refreshed(splicer, item, entry)
        else:
            inner = "\n" + " " * item.start_mark.column
            splicer.replace(item.start_mark.index, item.end_mark.index, inner.join(entry.lines()))
    return splicer.done()


def _refreshed(splicer: Splicer, item: MappingNode, entry: EffectEntry) -> None:
    """New values in a block item; comments that people wrote stay."""
    nodes = {str(key.value): value for key, value in item.value}
    indent = " " * item.start_mark.column
    texts = {"kind": (entry.kind, entry.note)}
    texts |= {key: (value, entry.comments.get(key, "")) for key, value in entry.values.items()}
    for key, (value, comment) in texts.items():
        remark = f"  # {_one_line(comment)}" if comment else ""
        written = next((name for name in nodes if key in (name, strip_unit_suffix(name))), None)
        if written is None:
            at = splicer.line_end(splicer.last(item))
            splicer.replace(at, at, f"\n{indent}{key}: {value}{remark}")
            continue
        node = nodes[written]
        end = int(node.end_mark.index)
        old = GENERATED.match(splicer.text, end)
        splicer.replace(int(node.start_mark.index), old.end() if old else end, f"{value}{remark}")


def _one_line(text: str) -> str:
    return " ".join(text.split()).replace("#", "no. ")
