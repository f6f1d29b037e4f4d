"""Write a study anew with other effects: every line that does not change stays as it was, comments included.

The text is not dumped from its tree: changes are spliced in at the places that the YAML parser marks.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from pliant.config.splicing import Splicer, find
from pliant.config.text_edits import flow_text, path_of, rewritten, with_value
from pliant.units import strip_unit_suffix

__all__ = ["EffectEntry", "flow_text", "study_with_effects", "study_with_values"]

# What `entry` writes behind a value; an older one gives way to it.
GENERATED = re.compile(r"[ \t]*# (?:fitted to |[^#\n]* ± )[^#\n]*?(?=[ \t]*(?:#|$))", re.MULTILINE)
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
    text = rewritten(source, target, overrides, without=["effects"])
    own = not any(path_of(override)[0] == "effects" for override in overrides)
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
    text = rewritten(source, target, overrides)
    for key, value in values.items():
        text = with_value(text, (block, _written_key(text, block, key)), value)
    return _remarked(text, block, remarks)


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


def _with_effects(
    text: str, entries: Sequence[EffectEntry], present: Sequence[Mapping[str, Any]], own: bool
) -> str:
    splicer = Splicer(text)
    root, node = splicer.root, find(splicer.root, ("effects",))
    if isinstance(root, MappingNode) and root.flow_style:
        items = [flow_text(effect) for effect in present]
        _place(items, [entry.flow() for entry in entries], entries)
        whole = "[" + ", ".join(items) + "]"
        return with_value(text, ("effects",), whole) if node is not None else _added(splicer, root, whole)
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
