"""Write a third-party package that works and passes its own tests as generated.

The texts are in `templates/`: `common/` for every package and one folder per interface, as `string.Template`s whose
file names end in ``.txt``.
"""

from __future__ import annotations

import keyword
import re
import shutil
import sys
import tempfile
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template

from pliant import __version__
from pliant.errors import UserError, closest
from pliant.registry.component import INTERFACES

TEMPLATES = resources.files("pliant.cli") / "templates"
# What a study block of the generated plugin holds beside `kind`, and its line in `pliant plugins`.
EXAMPLES = {
    "effect": ('{"loss": 0.1}', "a share of the actuation is lost on the way"),
    "family": ("{}", "rectangular tube with its cavity off the axis"),
    "material": ('{"c10": "60 kPa", "c20": "5 kPa"}', "Yeoh rubber, nearly incompressible"),
    "meta_model": ("{}", "terms quadratic in the design's parameters, by least squares"),
    "optimizer": ("{}", "uniform random search"),
    "physics": ("{}", "equilibria by plain Newton, for short chains"),
    "surrogate": ("{}", "linear law by least squares"),
    "task": ('{"pressure": "10 kPa", "force": [0, 0, "-20 mN"]}', "hold a force at the tip"),
}


@dataclass(frozen=True)
class Names:
    """One name in its forms: pliant-my-finger, pliant_my_finger, my_finger, MyFinger."""

    distribution: str
    package: str
    kind: str
    cls: str


def create_package(name: str, folder: Path, interface: str = "effect") -> list[Path]:
    """Write the package `folder`/`name` and return its files.

    Args:
        name: name of the distribution, such as ``my-finger``; a leading ``pliant-`` is left out of the kind.
        folder: where the package's folder is made.
        interface: what the plugin shall fill; each has a small real plugin as a start.

    Raises:
        UserError: for a name or interface that cannot be, a folder that is not empty or cannot be written.
            Nothing is left behind.
    """
    if interface not in EXAMPLES:
        known = ", ".join(EXAMPLES)
        why = "has no skeleton yet" if interface in INTERFACES else "is no interface"
        raise UserError(f"interface '{interface}' {why}{closest(interface, EXAMPLES)} Skeletons: {known}.")
    names = _names(name)
    target = folder / name
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise UserError(f"{target} exists and is not empty; choose another name or --out folder.")
    texts = _texts(names, interface)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=folder))
        try:
            for path, text in texts.items():
                file = partial / path
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text, encoding="utf-8")
            partial.chmod(0o755)
            if target.is_dir():
                target.rmdir()
            partial.replace(target)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    except OSError as error:
        raise UserError(
            f"{target} cannot be written ({error.strerror or error}); choose another --out folder."
        ) from None
    return [target / path for path in texts]


def _names(name: str) -> Names:
    """Check the name: PEP 503's letters, a package that can be imported, a class of its own."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*([-_][A-Za-z0-9]+)*", name):
        raise UserError(
            f"'{name}' is no name for a package: use letters and digits in words joined by '-', such as "
            "my-finger."
        )
    package = name.lower().replace("-", "_")
    kind = package.removeprefix("pliant_")
    if (
        keyword.iskeyword(package)
        or package in sys.stdlib_module_names
        or package in ("pliant", "pliant_plugins")
    ):
        raise UserError(
            f"'{name}' would hide Python's or Pliant's own module '{package}'; choose another name."
        )
    if kind in INTERFACES or not kind.isidentifier() or keyword.iskeyword(kind):
        raise UserError(f"'{kind}' cannot be a kind; choose a name that says what the plugin models.")
    return Names(name, package, kind, "".join(word.capitalize() for word in kind.split("_")))


def _texts(names: Names, interface: str) -> dict[str, str]:
    """Path inside the package → text."""
    example, summary = EXAMPLES[interface]
    values = {
        "name": names.distribution,
        "package": names.package,
        "kind": names.kind,
        "cls": names.cls,
        "interface": interface,
        "example": example,
        "summary": summary,
        "pliant": __version__,
        "next_pliant": _next_minor(__version__),
    }
    texts = {}
    for folder in ("common", interface):
        for path, template in _files(TEMPLATES / folder):
            where = path.removesuffix(".txt").replace("PACKAGE", names.package)
            texts[where] = Template(template).substitute(values)
    return dict(sorted(texts.items()))


def _next_minor(version: str) -> str:
    """The first version that may change what a plugin relies on: 0.1.3 → 0.2."""
    major, minor = version.split(".")[:2]
    return f"{major}.{int(minor) + 1}"


def _files(folder: Traversable, prefix: str = "") -> list[tuple[str, str]]:
    found = []
    for item in folder.iterdir():
        if item.is_dir():
            found += _files(item, f"{prefix}{item.name}/")
        elif item.name.endswith(".txt"):
            found.append((prefix + item.name, item.read_text(encoding="utf-8")))
    return found
