"""A YAML file as plain values with the line of each key, restricted to data and limited in size.

YAML allows more than a study needs: tags that build objects, keys that are lists, aliases that expand to more values
than fit into memory. Anything but data is refused with its line, and reading ends at these limits:
`LARGEST` bytes of a file, `MOST` values with aliases written out, `DEEPEST` levels, `LONGEST` characters of a text.
"""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.composer import Composer
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, ScalarEvent
from ruamel.yaml.nodes import MappingNode

from pliant.errors import UserError
from pliant.regular_files import read_regular
from pliant.units import BEYOND

LARGEST = 500_000
MOST = 20_000
DEEPEST = 64
LONGEST = 10_000
LONGEST_KEY = 200

KeyPath = tuple[Any, ...]


class _Bounded(Composer):
    """A composer of data nodes alone, up to the number that a study may have."""

    def __init__(self, loader: Any = None, path: Path = Path()) -> None:
        super().__init__(loader=loader)
        self.warn_double_anchors = False
        self._path, self._nodes = path, 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        is_key = isinstance(parent, MappingNode) and index is None
        self._nodes += 1
        if problem := self._problem(event, is_key):
            line = event.start_mark.line + 1
            raise UserError(f"{self._path}, line {line}: {problem}.")
        return super().compose_node(parent, index)

    def _problem(self, event: Any, is_key: bool) -> str:
        if self._nodes > MOST:
            return f"the file has more than {MOST} values, which is the most; keep long lists in a table"
        if self.depth >= DEEPEST:
            return f"blocks are nested too deeply; {DEEPEST} levels are the most"
        if isinstance(event, AliasEvent):
            return "a key is a word, not an alias" if is_key else ""
        if event.tag is not None:
            return f"a study has no tags such as '{_as_written(event.tag)}'; leave it out"
        if not isinstance(event, ScalarEvent):
            return "a key is a word, not a list or a block; is there a stray '?' or '{'" if is_key else ""
        if is_key and not event.value:
            return "there is a key without a word; is there a stray '?' or ':'"
        longest = LONGEST_KEY if is_key else LONGEST
        if len(event.value) > longest:
            size = f"{len(event.value)} characters"
            return f"a {'key' if is_key else 'text'} has {size}; {longest} are the most"
        return ""


def _as_written(tag: str) -> str:
    return str(tag).replace("tag:yaml.org,2002:", "!!")[:40]


def bounded_yaml(path: Path) -> YAML:
    """Return a reader of YAML 1.2 that keeps comments; `path` is for its messages."""
    yaml = YAML(typ="rt")
    yaml.Composer = partial(_Bounded, path=path)  # type: ignore[assignment]
    return yaml


def read_yaml(path: Path) -> CommentedMap:
    """Read one YAML file as ruamel's map; raises `UserError` with the line of anything but data, or of an excess."""
    try:
        text = read_regular(path, LARGEST, "a YAML file").decode("utf-8")
    except FileNotFoundError:
        raise UserError(f"{path}: no such file{neighbours(path)}.") from None
    except IsADirectoryError:
        raise UserError(f"{path} is a folder; give a study file such as {path}/study.yaml.") from None
    except UnicodeDecodeError:
        raise UserError(f"{path}: it is not a UTF-8 text file; save it as UTF-8.") from None
    except (OSError, ValueError) as error:  # ValueError: an impossible file name
        cause = getattr(error, "strerror", None) or error
        name = str(path) if len(str(path)) <= 80 else f"{str(path)[:60]}…"
        raise UserError(f"{name}: the file cannot be read ({cause}).") from None
    return _parse(text, path)


def _parse(text: str, path: Path) -> CommentedMap:
    try:
        data = bounded_yaml(path).load(text)
    except DuplicateKeyError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        name = re.search(r'found duplicate key "([^"]*)"', str(error.problem))
        key = f"'{name[1]}'" if name else "a key"
        raise UserError(f"{path}, line {line}: key {key} stands twice; keep one.") from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else "?"
        problem = str(error.problem)  # in words for users who do not know the parser's grammar
        if "'\\t'" in problem:
            problem = "there is a tab; YAML takes spaces only"
        elif "found another document" in problem:
            problem = "'---' begins a second document; a file holds one study"
        raise UserError(f"{path}, line {line}: this is not YAML ({problem}).") from None
    except YAMLError as error:
        raise UserError(f"{path}: this is not YAML ({' '.join(str(error).split())}).") from None
    except RecursionError:
        raise UserError(f"{path}: blocks are nested too deeply.") from None
    except ValueError as error:  # a number of thousands of digits, an impossible date
        raise UserError(f"{path}: a value cannot be read ({str(error).partition(';')[0]}).") from None
    except (
        LookupError,
        TypeError,
        AttributeError,
        AssertionError,
    ):  # errors of the parser on text that is hardly YAML
        raise UserError(
            f"{path}: this is not YAML that a study may have; write plain 'key: value' lines."
        ) from None
    if not isinstance(data, CommentedMap):
        raise UserError(f"{path}: a study is a list of 'key: value' lines; this file holds none.")
    return data


def neighbours(path: Path) -> str:
    """Return the end of a sentence on a missing file: the studies in its folder."""
    folder = path.parent
    try:
        names = sorted(p.name for p in folder.glob("*.y*ml"))[:5] if folder.is_dir() else []
    except OSError:  # a name longer than the system allows
        names = []
    return f"; {folder} holds {', '.join(names)}" if names else ""


@dataclass
class Plain:
    """A converter of ruamel's trees to plain values.

    Attributes:
        path: for messages.
        places: receives "file, line" of each key.
        count: number of values so far, including those of expanded aliases.
    """

    path: Path = field(default_factory=Path)
    places: dict[KeyPath, str] = field(default_factory=dict)
    count: int = 0

    def values(self, node: Any, at: KeyPath = ()) -> Any:
        """Return the plain values; raises `UserError` for endless aliases, and for numbers beyond any quantity."""
        self.count += 1
        if len(at) > DEEPEST:
            raise UserError(f"{self.path}: '{at[0]}' is nested too deeply, or holds itself by an alias.")
        if self.count > MOST:
            raise UserError(
                f"{self.path}: '{at[0]}' unfolds by its aliases into more than {MOST} values, which is the most."
            )
        if isinstance(node, CommentedMap):
            lines = node.lc.data or {}
            for key in node:
                if key in lines:  # keys that came in by a merge '<<' have no line here
                    self.places[(*at, str(key))] = f"{self.path}, line {lines[key][0] + 1}"
            return {str(key): self.values(value, (*at, str(key))) for key, value in node.items()}
        if isinstance(node, CommentedSeq):
            return [self.values(value, (*at, i)) for i, value in enumerate(node)]
        if isinstance(node, bool) or node is None:
            return node
        if isinstance(node, datetime.date):
            return node.isoformat()
        for kind in (int, float):
            if isinstance(node, kind):
                return self._number(kind(node), at)
        return str(node)

    def _number(self, value: float, at: KeyPath) -> float:
        if BEYOND < abs(value) < float("inf"):
            where = self.places.get(at) or str(self.path)
            raise UserError(
                f"{where}: a number is beyond ±{BEYOND:g}, and no quantity is that large; correct it."
            )
        return value
