"""Analysis of a source file: its digest without comments, formatting and documentation; the modules it may import."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterator

# Arguments, of the functions that declare a config's field, that no result depends on.
DOCUMENTATION = {"description", "title", "examples"}
FIELDS = {"Field", "parameter"}
MODULE_NAME = re.compile(r"\.*[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)


def source_digest(source: bytes) -> str:
    """Return the hex digest of one file's code; comments, formatting and documentation do not count."""
    return parsed(source, "")[0]


def parsed(source: bytes, package: str) -> tuple[str, tuple[str, ...]]:
    """Return the digest of a source file's syntax tree, and the names of modules that it may import."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):  # a broken helper that may never be imported
        return hashlib.sha256(source).hexdigest(), ()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            constant = first.value if isinstance(first, ast.Expr) else None
            if isinstance(constant, ast.Constant) and isinstance(constant.value, str):
                node.body = node.body[1:]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FIELDS:
            node.keywords = [k for k in node.keywords if k.arg not in DOCUMENTATION]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest(), tuple(_imports(tree, package))


def _imports(tree: ast.Module, package: str) -> Iterator[str]:
    """Yield the names that a source file may import; `from a import b` may mean module a or module a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute("." * node.level + (node.module or ""), package)
            yield from (base, *(f"{base}.{alias.name}" for alias in node.names))
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and "." in node.value
            and MODULE_NAME.fullmatch(node.value)
        ):
            yield _absolute(node.value, package)


def _absolute(name: str, package: str) -> str:
    """Return the dotted name of a module that is written relative to a package, as ".mesh" or "..helpers"."""
    bare = name.lstrip(".")
    level = len(name) - len(bare)
    if not level:
        return name
    parts = package.split(".")
    return ".".join([*parts[: len(parts) - level + 1], *([bare] if bare else [])])
