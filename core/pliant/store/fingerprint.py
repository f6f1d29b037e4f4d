"""A hash of the code that a result depends on, so that editing a plugin recomputes what it made.

The fingerprint follows import statements, and texts that name a module ("my_plugin.tables", ".tables"), from the
given modules through the packages that are ours to follow: Pliant, the packages of the given modules and those
of other plugins. It hashes each module's syntax tree without docstrings and without descriptions of config
fields, and the data files and compiled modules that lie beside those modules. Comments, formatting and
documentation do not recompute anything. Other libraries count by their version, where a component `requires` them.

What was read off a module is kept beside its byte code, under a digest of its source: parsing some two hundred modules
takes longer than all else that a cached run does.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

OURS = ("pliant", "pliant_plugins")
# What only carries values about; what it does to them is in the config, and so in the key, already.
MACHINERY = (
    "pliant",
    "pliant.errors",
    "pliant.formatting",
    "pliant.units",
    "pliant.interfaces.base",
    "pliant.registry",
    "pliant.store",
    "pliant.execution",
    "pliant.pipeline.workbench",
)
WHOLE_ROOMS = ("pliant.registry.", "pliant.store.", "pliant.execution.")
# Files in a package that no result depends on; the code itself is hashed module by module.
NO_DATA = {".py", ".pyi", ".pyc", ".pyo", ".typed", ".md", ".rst"}
# Arguments that no result depends on, of the functions that declare a config's field.
DOCUMENTATION = {"description", "title", "examples"}
FIELDS = {"Field", "parameter"}
KEPT = ".fingerprint"
MODULE_NAME = re.compile(r"\.*[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)


def code_fingerprint(modules: Iterable[str], packages: Iterable[str] = ()) -> str:
    """Hex digest over the transitive imports of `modules` (dotted names), and the data files beside them.

    `packages` are followed too where an import leads there: those of other plugins.
    """
    closure = code_closure(modules, packages)
    digest = hashlib.sha256()
    for name, path in sorted(closure.items()):
        digest.update(f"{name}:{_read(path, _package(name, path))[0]}\n".encode())
    folders = {_package(name, path): path.parent for name, path in closure.items()}
    for package, folder in sorted(folders.items()):
        for file in sorted(_data_files(folder)) if package else ():
            with file.open("rb") as data:
                content = hashlib.file_digest(data, "sha256").hexdigest()
            digest.update(f"{package}/{file.relative_to(folder).as_posix()}:{content}\n".encode())
    return digest.hexdigest()


def code_closure(modules: Iterable[str], packages: Iterable[str] = ()) -> dict[str, Path]:
    """Module name → source file of everything that `modules` import within our, their own and these packages.

    `MACHINERY` counts only where it is among `modules`: pages depend on how numbers are written, states do not.
    """
    start = tuple(modules)
    followed = {*OURS, *packages, *(name.partition(".")[0] for name in start)}
    found: dict[str, Path] = {}
    source = cache(_source)  # for this call: files may come and go
    queue = [*start]
    while queue:
        name = queue.pop()
        machinery = name in MACHINERY or name.startswith(WHOLE_ROOMS)
        if name in found or name.partition(".")[0] not in followed or (machinery and name not in start):
            continue
        parent = source(name.rpartition(".")[0]) if "." in name else None
        if parent is not None and parent.name != "__init__.py":
            continue  # an attribute of a module; to look for it as a module would run that one
        path = source(name)
        if path is None:
            continue
        found[name] = path
        queue += _read(path, _package(name, path))[1]
        queue += [name.rpartition(".")[0]]  # importing a module runs its package's __init__
    return found


def source_digest(source: bytes) -> str:
    """Hex digest of one file's code; comments, formatting and documentation do not count."""
    return _parsed(source, "")[0]


def versions(modules: Iterable[str]) -> dict[str, str]:
    """Installed versions of the distributions that provide these modules."""
    names = (one for module in modules for one in _providers(module.partition(".")[0]))
    return {name: importlib.metadata.version(name) for name in names}


@cache
def _providers(module: str) -> tuple[str, ...]:
    """Distributions that provide a module: the one of its name, or those that the table of all of them tells."""
    with suppress(importlib.metadata.PackageNotFoundError):
        return (str(importlib.metadata.distribution(module).metadata["Name"]),)
    return tuple(sorted(set(_distributions().get(module, []))))


@cache
def _distributions() -> Mapping[str, list[str]]:
    """Module → distributions that provide it; reading them takes a tenth of a second and more."""
    return importlib.metadata.packages_distributions()


def _source(name: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(name)
    except Exception:
        # "from package import attribute" names no module, and a plugin's __init__ may fail in any way.
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return Path(spec.origin)


def _package(module: str, path: Path) -> str:
    """The package whose folder holds a module's file; empty for a module that lies alone."""
    return module if path.name == "__init__.py" else module.rpartition(".")[0]


def _data_files(folder: Path) -> Iterator[Path]:
    """Files of a package that are neither Python source nor documentation, without those of its sub-packages."""
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name.endswith("~") or path.name == "__pycache__":
            continue
        if path.is_dir():
            if not (path / "__init__.py").is_file():
                yield from _data_files(path)
        elif path.suffix not in NO_DATA:
            yield path


def _read(path: Path, package: str) -> tuple[str, tuple[str, ...]]:
    """`_parsed` of a file as it is now."""
    return _kept(path, path.read_bytes(), package)


@cache
def _kept(path: Path, source: bytes, package: str) -> tuple[str, tuple[str, ...]]:
    """`_parsed`, from beside the byte code where it was written for the same source by the same code as this."""
    file = Path(importlib.util.cache_from_source(str(path))).with_suffix(KEPT)
    key = hashlib.sha256(_own_code() + package.encode() + b"\0" + source).hexdigest()
    with suppress(OSError, ValueError):
        digest, *names, written = file.read_text(encoding="utf-8").split("\n")
        if written == key:
            return digest, tuple(names)
    found = _parsed(source, package)
    if not sys.dont_write_bytecode:
        part = file.with_suffix(f".{os.getpid()}")
        with suppress(OSError):  # a folder that is not ours
            file.parent.mkdir(parents=True, exist_ok=True)
            part.write_text("\n".join((found[0], *found[1], key)), encoding="utf-8")
            part.replace(file)
    return found


@cache
def _own_code() -> bytes:
    """A digest of this file."""
    return hashlib.sha256(Path(__file__).read_bytes()).digest()


def _parsed(source: bytes, package: str) -> tuple[str, tuple[str, ...]]:
    """Digest of a source file's syntax tree, and the names of modules that it may import."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):  # a broken helper that nothing may ever import
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
    """Names that a source file may import; `from a import b` may mean module a or module a.b."""
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
    """The dotted name of a module that is written relative to a package, as ".mesh" or "..helpers"."""
    bare = name.lstrip(".")
    level = len(name) - len(bare)
    if not level:
        return name
    parts = package.split(".")
    return ".".join([*parts[: len(parts) - level + 1], *([bare] if bare else [])])
