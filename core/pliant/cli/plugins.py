"""The verbs about plugins: plugins, check, schema, and new-plugin, which writes a package that passes its own tests."""

from __future__ import annotations

import json
import keyword
import re
import shutil
import sys
import tempfile
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from itertools import groupby
from pathlib import Path
from string import Template
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from pliant import __version__
from pliant.cli.options import PluginFiles, verb
from pliant.cli.session import Session
from pliant.config.overrides import parse_block
from pliant.config.schema import study_schema, without_schema
from pliant.errors import UserError, closest
from pliant.formatting import seconds
from pliant.registry.command import commands
from pliant.registry.discovery import without_unusable
from pliant.registry.files import with_files
from pliant.registry.interface import interfaces
from pliant.registry.manifests import FRAME
from pliant.registry.shipped import PACKAGES

CHECK_FAILED = 3
SHORTEST_S = 0.05  # the time of a shorter check is not shown
TEMPLATES = resources.files("pliant.cli") / "templates"
# Keys of the generated plugin's study block besides `kind`, and its line in `pliant plugins`.
EXAMPLES = {
    "bench": ("{}", "a finger in memory, in place of your hardware"),
    "command": ("{}", "mass and length of a study's chain"),
    "effect": ('{"loss": 0.1}', "a share of the actuation is lost on the way"),
    "family": ("{}", "rectangular tube with its cavity off the axis"),
    "fem": ('{"pressure_max": "8 kPa"}', "states of a rod by its closed form"),
    "material": ('{"c10": "60 kPa", "c20": "5 kPa"}', "Yeoh rubber, nearly incompressible"),
    "meta_model": ("{}", "terms quadratic in the design's parameters, by least squares"),
    "model": ("{}", "a hinge with a spring and a damper"),
    "optimizer": ("{}", "uniform random search"),
    "physics": ("{}", "equilibria by plain Newton, for short chains"),
    "surrogate": ("{}", "linear law by least squares"),
    "task": ('{"pressure": "10 kPa", "force": [0, 0, "-20 mN"]}', "hold a force at the tip"),
}


@verb(store=False)
def plugins(
    session: Session,
    study: Annotated[
        Path | None, typer.Argument(metavar="[STUDY.yaml]", help="List its own `plugins` files too.")
    ] = None,
    file: PluginFiles = None,
) -> None:
    """List what is installed, what misses a package, and what failed to load."""
    if study is not None:
        session.study(study, None)
    session.registry = with_files(session.registry, file or ())
    table = Table("interface", "kind", "package", "what it is", box=None, pad_edge=False)
    rows = []
    for interface in interfaces():
        session.registry = without_unusable(session.registry, interface)
        for component in session.registry.by_interface(interface):
            missing = component.missing(lazy=True)
            part = "" if component.missing() else " for part of its work"
            state = f"needs {missing}{part}: {component.install}" if missing else ""
            rows.append(
                {
                    "interface": interface,
                    "kind": component.kind,
                    "package": component.package,
                    "summary": component.summary,
                    "unavailable": state,
                }
            )
            text = Text(component.summary)
            if state:
                text.append(f" (unavailable: {state})", "yellow")
            table.add_row(interface, component.kind, component.package, text)
    added = [command for command in commands().values() if command.package != FRAME]
    verbs = [{"name": one.name, "package": one.package, "summary": one.help.split("\n")[0]} for one in added]
    for verb_row in verbs:
        table.add_row("command", verb_row["name"], verb_row["package"], verb_row["summary"])
    session.say(table)
    failures = [vars(failure) for failure in session.registry.failures]
    for failure in failures:
        line = f"{failure['name']} ({failure['package']}): {failure['cause']}"
        session.say(Text.assemble(("failed", "red"), f"   {line}"))
    session.result.update({"components": rows, "commands": verbs, "failed": failures})


@verb(store=False)
def check(
    session: Session,
    interface: Annotated[str, typer.Argument(metavar="INTERFACE", help=", ".join(interfaces()))],
    kind: Annotated[str, typer.Argument(metavar="KIND", help="The plugin's kind.")],
    config: Annotated[
        list[str] | None,
        typer.Argument(metavar="[KEY=VALUE]...", help="Keys of its config, as a study has them."),
    ] = None,
    clause: Annotated[
        list[str] | None,
        typer.Option("--clause", metavar="NAME", help="Run this check alone, may be repeated."),
    ] = None,
    file: PluginFiles = None,
    model: Annotated[
        str, typer.Option("--model", metavar="KIND", help="Of an effect: the kind of model that it changes.")
    ] = "",
) -> None:
    """Run the conformance suite of an interface on a plugin."""
    from pliant.testing import run_checks

    session.registry = with_files(session.registry, file or ())
    if model or kind not in session.registry.kinds(interface):  # an effect of users' own models alone
        session.registry = session.registry.for_model(model)
    known = interfaces()
    if interface not in known:
        raise UserError(
            f"unknown interface '{interface}'{closest(interface, known)} Interfaces: {', '.join(known)}."
        )
    component, changes = session.registry.get(interface, kind), parse_block(config or ())
    outcomes = run_checks(component, session.progress, changes=changes, clauses=clause or ())
    marks = {"passed": "[green]passed[/] ", "failed": "[red]FAILED[/] ", "skipped": "[yellow]skipped[/]"}
    for (status, message), alike in groupby(outcomes, key=lambda o: (o.status, o.message)):
        group = list(alike)
        names = [f"{one.name}  {_time(one.wall_s)}".rstrip() for one in group]
        many = status == "skipped" and len(names) > 1  # by one cause, whose line stays visible
        for name in [f"{len(names)} checks"] if many else names:
            session.say(f"{marks[status]}  {name}", markup=True)
        if message:
            session.say(f"           {message}")
    counts = {state: sum(o.status == state for o in outcomes) for state in marks}
    total = seconds(sum(o.wall_s for o in outcomes))
    session.say(", ".join(f"{count} {state}" for state, count in counts.items()) + f"; {total}")
    session.result.update(
        {
            "interface": interface,
            "kind": kind,
            **counts,
            "checks": [
                {"name": o.name, "status": o.status, "message": o.message, "wall_s": o.wall_s}
                for o in outcomes
            ],
        }
    )
    if counts["failed"]:
        session.exit_code = CHECK_FAILED


def _time(wall_s: float) -> str:
    """Return the duration of a check as text; empty for a short one."""
    return f"{wall_s:.1f} s" if wall_s >= SHORTEST_S else ""


@verb(store=False)
def schema(
    session: Session,
) -> None:
    """Print the JSON schema of a study under the installed plugins, for editors."""
    session.note_left_out(*interfaces())
    for origin in without_schema(session.registry):
        session.progress.note(f"left out: the config of {origin} has no JSON schema.")
    made = study_schema(session.registry)
    if session.json_target is None and not session.quiet:
        typer.echo(json.dumps(made, indent=1))
    session.result["schema"] = made


@verb(store=False)
def new_plugin(
    session: Session,
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the package, e.g. my-finger.")],
    interface: Annotated[
        str, typer.Option("--interface", help=f"What it shall fill: {', '.join(EXAMPLES)}.")
    ] = "effect",
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Parent folder of the package.")] = Path(),
) -> None:
    """Write a third-party package that works and passes its own tests as generated."""
    files = create_package(name, out, interface)
    session.result["files"] = [str(path) for path in files]
    for path in files:
        session.say(str(path))
    session.say(f"\nnext: pip install -e '{out / name}[test]' && pytest {out / name}")


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
        interface: interface of the plugin; each has a small working plugin as a start.

    Raises:
        UserError: for an impossible name or interface, or a folder that is not empty or writable; no file is left.
    """
    if interface not in EXAMPLES:
        known = ", ".join(EXAMPLES)
        why = "has no skeleton yet" if interface in interfaces() else "is no interface"
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
    """Return the name's forms; raises for a name that PEP 503, an import or a class name does not allow."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*([-_][A-Za-z0-9]+)*", name):
        raise UserError(
            f"'{name}' is no name for a package: use letters and digits in words joined by '-', such as "
            "my-finger."
        )
    package = name.lower().replace("-", "_")
    kind = package.removeprefix("pliant_")
    if keyword.iskeyword(package) or package in sys.stdlib_module_names or package in PACKAGES:
        raise UserError(
            f"'{name}' would hide Python's or Pliant's own module '{package}'; choose another name."
        )
    if kind in interfaces() or not kind.isidentifier() or keyword.iskeyword(kind):
        raise UserError(f"'{kind}' cannot be a kind; choose a name that says what the plugin models.")
    return Names(name, package, kind, "".join(word.capitalize() for word in kind.split("_")))


def _texts(names: Names, interface: str) -> dict[str, str]:
    """Return the texts of the package by their paths inside it."""
    example, summary = EXAMPLES[interface]
    values = {
        "name": names.distribution,
        "package": names.package,
        "kind": names.kind,
        "verb": names.kind.replace("_", "-"),
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
    """Return the first version that may change what a plugin relies on: 0.1.3 → 0.2."""
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
