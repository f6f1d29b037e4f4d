"""A hash of the code that a result depends on, so that editing a plugin recomputes what it made.

The fingerprint follows import statements from the given modules through the packages that are ours to follow
(Pliant and the plugin's own package) and hashes each module's syntax tree without docstrings: comments,
formatting and documentation do not recompute anything.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
from collections.abc import Iterable
from pathlib import Path

OURS = ("pliant", "pliant_plugins")
# What only carries values about; what it does to them is in the config, and so in the key, already.
MACHINERY = (
    "pliant",
    "pliant.errors",
    "pliant.units",
    "pliant.interfaces.base",
    "pliant.registry",
    "pliant.store",
    "pliant.pipeline.progress",
    "pliant.pipeline.workbench",
)


def code_fingerprint(modules: Iterable[str]) -> str:
    """Hex digest over the transitive imports of `modules` (dotted names)."""
    digest = hashlib.sha256()
    for name, path in sorted(code_closure(modules).items()):
        digest.update(f"{name}:{_tree_digest(path)}\n".encode())
    return digest.hexdigest()


def code_closure(modules: Iterable[str]) -> dict[str, Path]:
    """Module name → source file of everything that `modules` import within our and their own packages."""
    start = list(modules)
    followed = {*OURS, *(name.partition(".")[0] for name in start)}
    found: dict[str, Path] = {}
    queue = start
    while queue:
        name = queue.pop()
        if name in found or name.partition(".")[0] not in followed or _is_machinery(name):
            continue
        path = _source(name)
        if path is None:
            continue
        found[name] = path
        queue += _imports(path, name)
    return found


def _is_machinery(name: str) -> bool:
    return name in MACHINERY or name.startswith(("pliant.registry.", "pliant.store."))


def versions(modules: Iterable[str]) -> dict[str, str]:
    """Installed versions of the distributions that provide these modules."""
    table = importlib.metadata.packages_distributions()
    result = {}
    for module in modules:
        for distribution in sorted(set(table.get(module.partition(".")[0], []))):
            result[distribution] = importlib.metadata.version(distribution)
    return result


def _source(name: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None  # "from package import attribute" names no module
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return Path(spec.origin)


def _imports(path: Path, module: str) -> list[str]:
    """Names that a source file imports; `from a import b` may mean module a or module a.b."""
    names: list[str] = []
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, base] if base else above)
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return names


def _tree_digest(path: Path) -> str:
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            _drop_docstring(node)
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _drop_docstring(node: ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> None:
    first = node.body[0] if node.body else None
    constant = first.value if isinstance(first, ast.Expr) else None
    if isinstance(constant, ast.Constant) and isinstance(constant.value, str):
        node.body = node.body[1:]
