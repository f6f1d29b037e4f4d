"""A mutant: one changed place of the source, and the drawing of places to change."""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Room → folders and files that mutants are drawn from.
ROOMS: Mapping[str, Sequence[str]] = {
    "physics": ("plugins/pliant_plugins/physics", "core/pliant/mechanics"),
    "fem": ("plugins/pliant_plugins/fem",),
    "laws": ("plugins/pliant_plugins/surrogates", "plugins/pliant_designs"),
    "effects": ("plugins/pliant_plugins/effects",),
    "diagnosis": (
        "core/pliant/diagnosis",
        "core/pliant/evidence",
        "plugins/pliant_counts",
        "plugins/pliant_learned",
    ),
    "search": ("plugins/pliant_search", "plugins/pliant_ppo"),
    "store": ("core/pliant/store",),
    "execution": ("core/pliant/execution",),
}
SWAPPED: Mapping[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Attributes:
        room: the part of the code that it belongs to.
        file: path from the root.
        line: the line, from 1; 0 where `before` occurs once in the file.
        before, after: the text and its replacement.
    """

    room: str
    file: str
    line: int
    before: str
    after: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        return f"[{self.room}] {place}  {_short(self.before)}  →  {_short(self.after)}"

    def applied(self) -> str:
        """Return the file's text with the change. Raises `ValueError` if the text to change does not occur once."""
        text = (ROOT / self.file).read_text(encoding="utf-8")
        if not self.line:
            if text.count(self.before) != 1:
                raise ValueError(f"{self}: the text stands {text.count(self.before)} times in the file")
            return text.replace(self.before, self.after)
        lines = text.splitlines(keepends=True)
        if self.before not in lines[self.line - 1]:
            raise ValueError(f"{self}: the line is {lines[self.line - 1].strip()!r}")
        lines[self.line - 1] = lines[self.line - 1].replace(self.before, self.after, 1)
        return "".join(lines)


def drawn(count: int, seed: int) -> list[Mutant]:
    """Return mutants drawn by a seed, the same number for each room, at most one in a function."""
    generator = random.Random(seed)
    found: list[Mutant] = []
    rooms = list(ROOMS)
    for number, room in enumerate(rooms):
        places = [place for folder in ROOMS[room] for file in _files(folder) for place in _places(room, file)]
        generator.shuffle(places)
        wanted = count // len(rooms) + (number < count % len(rooms))
        taken: set[tuple[str, str]] = set()
        for mutant, function in places:
            if wanted and (mutant.file, function) not in taken:
                taken.add((mutant.file, function))
                found.append(mutant)
                wanted -= 1
    return found


def _files(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def _places(room: str, file: Path) -> Iterator[tuple[Mutant, str]]:
    """Yield every possible change of a file, with the name of the function that contains it."""
    text = file.read_text(encoding="utf-8")
    lines = text.splitlines()
    name = file.relative_to(ROOT).as_posix()
    for function in ast.walk(ast.parse(text)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in ast.walk(function):
            new = _changed(node)
            if new is None or node.lineno != node.end_lineno:  # type: ignore[attr-defined]
                continue
            line = lines[node.lineno - 1].encode()  # type: ignore[attr-defined]
            before = line[node.col_offset : node.end_col_offset].decode()  # type: ignore[attr-defined]
            if lines[node.lineno - 1].count(before) == 1:  # type: ignore[attr-defined]
                yield Mutant(room, name, node.lineno, before, new), function.name  # type: ignore[attr-defined]


def _changed(node: ast.AST) -> str | None:
    """Return the node's text with its sign, factor, comparison, connective or negation changed, None for others."""
    if isinstance(node, ast.BinOp) and type(node.op) in SWAPPED:
        if isinstance(node.op, ast.Div) and re.search(
            r"folder|root|path|FILE|MANIFEST|name", ast.unparse(node)
        ):
            return None  # a path, which fails at once
        if any(
            isinstance(side, ast.Constant | ast.JoinedStr) and not _number(side)
            for side in (node.left, node.right)
        ):
            return None
        return f"({ast.unparse(ast.BinOp(node.left, SWAPPED[type(node.op)](), node.right))})"  # type: ignore[call-arg]
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in SWAPPED:
        return ast.unparse(ast.Compare(node.left, [SWAPPED[type(node.ops[0])]()], node.comparators))  # type: ignore[list-item]
    if isinstance(node, ast.BoolOp):
        return f"({ast.unparse(ast.BoolOp(SWAPPED[type(node.op)](), node.values))})"  # type: ignore[arg-type]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        return f"({ast.unparse(node.operand)})"
    return None


def _number(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float)


def _short(text: str, width: int = 70) -> str:
    line = " ".join(text.split())
    return line if len(line) <= width else line[: width - 1] + "…"
