"""A hash of the code that a result depends on, so that editing a plugin recomputes its results.

The fingerprint follows import statements, and texts that name a module ("my_plugin.tables", ".tables"), from the given
modules through the packages that are followed: Pliant, the packages of the given modules and those of other plugins. It
hashes each module's syntax tree without docstrings and without descriptions of config fields, and the data files and
compiled modules in the folders of those modules. Changed comments, formatting and documentation do not recompute
anything. Other libraries count by their version, where a component `requires` them.

The result for a module is cached next to its byte code, under a digest of its source: parsing some two hundred modules
takes longer than the rest of a cached run.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

from pliant.registry import source_code
from pliant.registry.shipped import PACKAGES
from pliant.registry.source_code import parsed

OURS = ("pliant_tables", *PACKAGES)
# Modules that only pass values on; their effect on a value is in the config, and so already in the key.
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
    "pliant_tables",
    "pliant_tables.errors",
    "pliant_tables.wording",
)
WHOLE_ROOMS = ("pliant.registry.", "pliant.store.", "pliant.execution.")
# Files in a package that no result depends on; the code itself is hashed module by module.
NO_DATA = {".py", ".pyi", ".pyc", ".pyo", ".typed", ".md", ".rst"}
KEPT = ".fingerprint"


def code_fingerprint(modules: Iterable[str], packages: Iterable[str] = ()) -> str:
    """Return the hex digest over the transitive imports of `modules` (dotted names), and the data files in their
    folders.

    Imports into `packages`, those of other plugins, are followed too.
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
    """Return module name → source file of everything that `modules` import within Pliant, their own and these packages.

    `MACHINERY` counts only where it is among `modules`: pages depend on the formatting of numbers, states do not.
    """
    start = tuple(modules)
    followed = {*OURS, *packages, *(name.partition(".")[0] for name in start)}
    found: dict[str, Path] = {}
    source = cache(_source)  # for this call only: files may appear and disappear
    queue = [*start]
    while queue:
        name = queue.pop()
        machinery = name in MACHINERY or name.startswith(WHOLE_ROOMS)
        if name in found or name.partition(".")[0] not in followed or (machinery and name not in start):
            continue
        parent = source(name.rpartition(".")[0]) if "." in name else None
        if parent is not None and parent.name != "__init__.py":
            continue  # an attribute of a module; looking for it as a module would execute that module
        path = source(name)
        if path is None:
            continue
        found[name] = path
        queue += _read(path, _package(name, path))[1]
        queue += [name.rpartition(".")[0]]  # importing a module runs its package's __init__
    return found


def versions(modules: Iterable[str]) -> dict[str, str]:
    """Return the installed versions of the distributions that provide these modules."""
    names = (one for module in modules for one in _providers(module.partition(".")[0]))
    return {name: importlib.metadata.version(name) for name in names}


@cache
def _providers(module: str) -> tuple[str, ...]:
    """Return the distributions that provide a module: that of its name, or those in the table of all of them."""
    with suppress(importlib.metadata.PackageNotFoundError):
        return (str(importlib.metadata.distribution(module).metadata["Name"]),)
    return tuple(sorted(set(_distributions().get(module, []))))


@cache
def _distributions() -> Mapping[str, list[str]]:
    """Return module → distributions that provide it; reading them takes a tenth of a second or more."""
    return importlib.metadata.packages_distributions()


def _source(name: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(name)
    except Exception:
        # "from package import attribute" names no module, and a plugin's __init__ may raise anything.
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return Path(spec.origin)


def _package(module: str, path: Path) -> str:
    """Return the package whose folder contains a module's file; empty for a module outside a package."""
    return module if path.name == "__init__.py" else module.rpartition(".")[0]


def _data_files(folder: Path) -> Iterator[Path]:
    """Yield the files of a package except Python source, documentation and those of its sub-packages."""
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name.endswith("~") or path.name == "__pycache__":
            continue
        if path.is_dir():
            if not (path / "__init__.py").is_file():
                yield from _data_files(path)
        elif path.suffix not in NO_DATA:
            yield path


def _read(path: Path, package: str) -> tuple[str, tuple[str, ...]]:
    """Return `parsed` of the current contents of a file."""
    return _kept(path, path.read_bytes(), package)


@cache
def _kept(path: Path, source: bytes, package: str) -> tuple[str, tuple[str, ...]]:
    """Return `parsed`, from the cache next to the byte code if the same code wrote it for the same source."""
    file = Path(importlib.util.cache_from_source(str(path))).with_suffix(KEPT)
    key = hashlib.sha256(_own_code() + package.encode() + b"\0" + source).hexdigest()
    with suppress(OSError, ValueError):
        digest, *names, written = file.read_text(encoding="utf-8").split("\n")
        if written == key:
            return digest, tuple(names)
    found = parsed(source, package)
    if not sys.dont_write_bytecode:
        part = file.with_suffix(f".{os.getpid()}")
        with suppress(OSError):  # a folder that we may not write to
            file.parent.mkdir(parents=True, exist_ok=True)
            part.write_text("\n".join((found[0], *found[1], key)), encoding="utf-8")
            part.replace(file)
    return found


@cache
def _own_code() -> bytes:
    """Return a digest of this file and of the one that parses."""
    files = (__file__, source_code.__file__)
    return hashlib.sha256(b"".join(Path(file).read_bytes() for file in files)).digest()
