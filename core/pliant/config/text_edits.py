"""Changes of a study's text that every writer makes: values set, overrides written in, paths told from elsewhere."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from pliant.config.loading import read_yaml
from pliant.config.paths import PATH_KEYS
from pliant.config.splicing import Splicer, find, kind_of
from pliant.errors import UserError

SIMPLE = re.compile(r"[A-Za-z_./][\w./+-]*")
WORDS_OF_YAML = {"true", "false", "null", "yes", "no", "on", "off"}


def flow_text(value: Any) -> str:
    """A plain value as YAML on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{flow_text(str(k))}: {flow_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(flow_text(item) for item in value) + "]"
    if isinstance(value, str) and SIMPLE.fullmatch(value) and value.lower() not in WORDS_OF_YAML:
        return value
    return json.dumps(value, ensure_ascii=False)


def rewritten(source: Path, target: Path, overrides: Sequence[str], without: Sequence[str] = ()) -> str:
    """The text of a study as it reads from another folder, with overrides written into it.

    Args:
        source: the study that is read.
        target: where the text will be written: paths in it are relative to that place.
        overrides: changes "key=value" with which `source` was read.
        without: top-level keys whose overrides are left out.

    Raises:
        UserError: a file that cannot be read, an override that has no place in the text.
    """
    read_yaml(source)  # for its messages
    folder = target.resolve().parent
    text = relocated(source.read_text(encoding="utf-8-sig"), source.resolve().parent, folder)
    for override in overrides:
        if path_of(override)[0] not in without:
            text = overridden(text, override, folder)
    return text


def relocated(text: str, old: Path, new: Path) -> str:
    """Relative paths of the file as they read from another folder."""
    if old == new:
        return text
    splicer = Splicer(text)
    for node in _paths(splicer.root):
        if isinstance(node, ScalarNode) and node.value and not os.path.isabs(node.value):  # noqa: PTH117
            moved = flow_text(os.path.relpath(old / node.value, new))
            splicer.replace(node.start_mark.index, node.end_mark.index, moved)
    return splicer.done()


def _paths(root: Node | None) -> Iterator[Node | None]:
    """What holds paths in a study, as `pliant.config.paths` finds them."""
    yield find(root, ("extends",))
    plugins, segments = find(root, ("plugins",)), find(root, ("chain", "segments"))
    yield from plugins.value if isinstance(plugins, SequenceNode) else ()
    blocks = [(find(root, (block,)), key) for block, key in PATH_KEYS]
    for segment in segments.value if isinstance(segments, SequenceNode) else ():
        blocks += [(find(segment, ("surrogate",)), "data"), (find(segment, ("family",)), "visual")]
    for block, key in blocks:
        yield from _within(block, key)


def _within(block: Node | None, key: str) -> Iterator[Node]:
    """The values of a key in a block and in blocks inside it, such as the axes of a law."""
    for name, value in block.value if isinstance(block, MappingNode) else ():
        if name.value == key and isinstance(value, ScalarNode):
            yield value
        else:
            yield from _within(value, key)


def path_of(override: str) -> list[str]:
    """The keys that an override "key=value" sets."""
    return override.partition("=")[0].strip().split(".")


def overridden(text: str, override: str, folder: Path) -> str:
    """The text with an override written into it; its paths are told from `folder`."""
    path, written = path_of(override), override.partition("=")[2].strip()
    value = YAML(typ="safe", pure=True).load(written)
    if (path[0], path[-1]) in PATH_KEYS and isinstance(value, str):
        value = os.path.relpath(Path(value).absolute(), folder)
        return with_value(text, path, flow_text(value))
    if path == ["plugins"] and isinstance(value, list):
        value = [os.path.relpath(Path(file).absolute(), folder) for file in value]
        return with_value(text, path, flow_text(value))
    if isinstance(value, Mapping):
        for key, inner in value.items():
            text = overridden(text, f"{'.'.join(path)}.{key}={flow_text(inner)}", folder)
        return text
    return with_value(text, path, written)


def with_value(text: str, path: Sequence[str], value: str) -> str:
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
