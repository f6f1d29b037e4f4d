"""Size and structure of the source tree.

    python -m benchmarks.house             lines and statements, modules with one importer, names of classes, circles
    python -m benchmarks.house --list      the same, each module with one importer by its name
    python -m benchmarks.house --circles   circles of imports only; exit code 1 where there is one (`make imports`)

All imports count, also those inside functions and under `TYPE_CHECKING`. A room is a folder of
`core/pliant`, `plugins/pliant_plugins` or `benchmarks` with its sub-folders.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = {"core": "core", "plugins": "plugins", "benchmarks": "."}
COUNTED = (*SOURCES, "tests", "contrib")


@dataclass(frozen=True)
class Module:
    """A source file: its dotted name, its room and its syntax tree."""

    name: str
    room: str
    tree: ast.Module
    is_package: bool


def modules(root: Path = ROOT) -> dict[str, Module]:
    """Return every module of core, plugins and benchmarks by its dotted name."""
    found = {}
    for folder, base in SOURCES.items():
        for file in sorted((root / folder).rglob("*.py")):
            parts = file.relative_to(root / base).with_suffix("").parts
            package = parts[-1] == "__init__"
            name = ".".join(parts[:-1] if package else parts)
            depth = 1 if len(parts) > 2 else 0
            room = ".".join(parts[: 1 + depth])
            found[name] = Module(name, room, ast.parse(file.read_text(encoding="utf-8")), package)
    return found


def imports(module: Module, known: Mapping[str, Module]) -> set[str]:
    """Return names of the modules of this tree that a module imports."""
    found: set[str] = set()
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in known}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.name.split(".")
                parts = parts[: len(parts) - node.level + module.is_package]
                base = ".".join([*parts, *([base] if base else [])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                if inner in known:
                    found.add(inner)
                elif base in known:
                    found.add(base)
    return found - {module.name}


def one_importer(graph: Mapping[str, set[str]], known: Mapping[str, Module]) -> list[tuple[str, str]]:
    """Return modules with a single importer, which is in the same package, with the importer."""
    importers = defaultdict(set)
    for name, targets in graph.items():
        for target in targets:
            importers[target].add(name)
    pairs = ((name, *importers[name]) for name in known if len(importers[name]) == 1)
    return [
        (name, by) for name, by in pairs if known[name].room == known[by].room and not known[name].is_package
    ]


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Return groups of modules that import each other, directly or indirectly (Tarjan 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for target in sorted(graph[name]):
            if target not in index:
                visit(target)
                low[name] = min(low[name], low[target])
            elif target in stack:
                low[name] = min(low[name], index[target])
        if low[name] == index[name]:
            group = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(group) > 1:
                found.append(sorted(group))

    sys.setrecursionlimit(10_000)
    for name in graph:
        if name not in index:
            visit(name)
    return found


def class_names(known: Mapping[str, Module], public: bool = False) -> dict[str, list[str]]:
    """Return names of classes at module level that occur more than once, with their modules."""
    places = defaultdict(list)
    for name, module in known.items():
        for node in module.tree.body:
            if isinstance(node, ast.ClassDef) and not (public and node.name.startswith("_")):
                places[node.name].append(name)
    return {name: where for name, where in sorted(places.items()) if len(where) > 1}


def size(folder: Path) -> tuple[int, int, int]:
    """Count files, lines and statements of a folder's Python; docstrings are no statements."""
    files = lines = statements = 0
    for file in folder.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        files, lines = files + 1, lines + text.count("\n")
        nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.stmt)]
        statements += sum(not (isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)) for n in nodes)
    return files, lines, statements


def main() -> int:
    known = modules()
    graph = {name: imports(module, known) for name, module in known.items()}
    # A package's __init__ that gathers its modules is no circle of theirs.
    inner = {n: {t for t in targets if not known[t].is_package} for n, targets in graph.items()}
    found = circles(inner)
    if "--circles" not in sys.argv:
        for folder in COUNTED:
            files, lines, statements = size(ROOT / folder)
            print(f"{folder:<11} {files:4d} files {lines:6d} lines {statements:6d} statements")
        single = one_importer(graph, known)
        rooms = Counter(known[name].room for name, _ in single)
        print(f"{len(single)} modules with one importer, in their own room")
        print("    " + ", ".join(f"{room} {count}" for room, count in rooms.most_common()))
        source = {name: module for name, module in known.items() if not name.startswith("benchmarks")}
        core = {name: module for name, module in known.items() if name.startswith("pliant.")}
        print(f"{len(class_names(source))} class names twice or more in core and plugins")
        print(
            f"{len(class_names(core, public=True))} public ones in core: {', '.join(class_names(core, public=True))}"
        )
        if "--list" in sys.argv:
            print("\n".join(f"    {name} <- {by}" for name, by in single))
    print(f"{len(found)} circles of imports" + "".join(f"\n    {', '.join(group)}" for group in found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
