"""A YAML text that is changed at the places that its parser marks, and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode


class Splicer:
    """A YAML text, its tree, and changes by position."""

    def __init__(self, text: str) -> None:
        self.text = text if text.endswith("\n") else text + "\n"
        self.root: Node = YAML(typ="safe", pure=True).compose(self.text)
        self._changes: list[tuple[int, int, str]] = []

    def replace(self, start: int, end: int, new: str) -> None:
        """Put `new` in the place of a stretch of the text."""
        self._changes.append((start, end, new))

    def done(self) -> str:
        """The text with all changes."""
        text = self.text
        for start, end, new in sorted(self._changes, key=lambda change: change[:2], reverse=True):
            text = text[:start] + new + text[end:]
        return text

    def of(self, node: Node) -> str:
        """The text of a node."""
        return self.text[node.start_mark.index : node.end_mark.index]

    def line_end(self, at: int) -> int:
        """Index of the line break that ends the line of a position."""
        if at > 0 and self.text[at - 1] == "\n":
            return at - 1
        return self.text.index("\n", at)

    def last(self, node: Node) -> int:
        """Where a node's own text ends; a block's end mark lies behind the comments that follow it."""
        if isinstance(node, MappingNode | SequenceNode) and not node.flow_style and node.value:
            final = node.value[-1]
            return max(self.last(n) for n in (final if isinstance(final, tuple) else (final,)))
        return int(node.end_mark.index)

    def key_end(self, mapping: Node, key: str) -> int:
        """Behind the colon of a key."""
        name = next(name for name, _ in mapping.value if name.value == key)
        return self.text.index(":", name.end_mark.index) + 1

    def insert_key(self, mapping: MappingNode, key: str, value: str) -> None:
        """`key: value` at the end of a mapping."""
        if mapping.flow_style:
            comma = ", " if mapping.value else ""
            self.replace(mapping.end_mark.index - 1, mapping.end_mark.index - 1, f"{comma}{key}: {value}")
            return
        at = self.line_end(self.last(mapping))
        indent = " " * mapping.start_mark.column
        self.replace(at, at, f"\n{indent}{key}: {value}")


def kind_of(node: Node) -> str | None:
    """The `kind` of a block, written as a word or as a key; or None."""
    if isinstance(node, ScalarNode):
        return str(node.value)
    kind = find(node, ("kind",))
    return str(kind.value) if isinstance(kind, ScalarNode) else None


def find(node: Node | None, path: Sequence[str]) -> Node | None:
    """The node at a path of keys and item numbers, or None."""
    for key in path:
        if isinstance(node, MappingNode):
            node = next((value for name, value in node.value if name.value == key), None)
        elif isinstance(node, SequenceNode) and key.isdecimal() and int(key) < len(node.value):
            node = node.value[int(key)]
        else:
            return None
    return node
