"""A study's text with keys anywhere set anew and blocks left out: how a found design is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ruamel.yaml.nodes import MappingNode, Node

from pliant.config.splicing import Splicer, find
from pliant.config.text_edits import rewritten, with_value
from pliant.errors import UserError
from pliant.units import strip_unit_suffix


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
    text = rewritten(source, target, overrides, without)
    for path, value in changes.items():
        text = with_value(text, _written_path(text, path), value)
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
