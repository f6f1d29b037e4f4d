"""The verbs about plugins: plugins, check, schema, new-plugin."""

from __future__ import annotations

import json as json_module
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from pliant.cli.new_plugin import EXAMPLES, create_package
from pliant.cli.options import JsonFile, PluginFiles, Quiet
from pliant.cli.session import session
from pliant.config.schema import study_schema
from pliant.errors import UserError, closest
from pliant.registry.component import INTERFACES
from pliant.registry.files import with_files

CHECK_FAILED = 3


def plugins(
    study: Annotated[
        Path | None, typer.Argument(metavar="[STUDY.yaml]", help="List its own `plugins` files too.")
    ] = None,
    file: PluginFiles = None,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """What is installed, what misses a package, and what failed to load."""
    with session("plugins", json, quiet) as here:
        if study is not None:
            here.study(study, None)
        here.registry = with_files(here.registry, file or ())
        table = Table("interface", "kind", "package", "what it is", box=None, pad_edge=False)
        rows = []
        for interface in INTERFACES:
            for component in here.registry.of(interface):
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
        here.say(table)
        failures = [vars(failure) for failure in here.registry.failures]
        for failure in failures:
            line = f"{failure['name']} ({failure['package']}): {failure['cause']}"
            here.say(Text.assemble(("failed", "red"), f"   {line}"))
        here.result.update({"components": rows, "failed": failures})


def check(
    interface: Annotated[str, typer.Argument(metavar="INTERFACE", help=", ".join(INTERFACES))],
    kind: Annotated[str, typer.Argument(metavar="KIND", help="The plugin's kind.")],
    file: PluginFiles = None,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Run the conformance suite of an interface on a plugin."""
    with session("check", json, quiet) as here:
        from pliant.testing import run_checks

        here.registry = with_files(here.registry, file or ())
        if interface not in INTERFACES:
            raise UserError(
                f"unknown interface '{interface}'{closest(interface, INTERFACES)} "
                f"Interfaces: {', '.join(INTERFACES)}."
            )
        outcomes = run_checks(here.registry.get(interface, kind))
        marks = {"passed": "[green]passed[/] ", "failed": "[red]FAILED[/] ", "skipped": "[yellow]skipped[/]"}
        for outcome in outcomes:
            here.say(f"{marks[outcome.status]}  {outcome.name}", markup=True)
            if outcome.message:
                here.say(f"           {outcome.message}")
        counts = {state: sum(o.status == state for o in outcomes) for state in marks}
        here.say(", ".join(f"{count} {state}" for state, count in counts.items()))
        here.result.update(
            {
                "interface": interface,
                "kind": kind,
                **counts,
                "checks": [{"name": o.name, "status": o.status, "message": o.message} for o in outcomes],
            }
        )
        if counts["failed"]:
            here.exit_code = CHECK_FAILED


def schema(json: JsonFile = None, quiet: Quiet = False) -> None:
    """JSON schema of a study under the installed plugins, for editors."""
    with session("schema", json, quiet) as here:
        made = study_schema(here.registry)
        if json is None and not quiet:
            typer.echo(json_module.dumps(made, indent=1))
        here.result["schema"] = made


def new_plugin(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the package, e.g. my-finger.")],
    interface: Annotated[
        str, typer.Option("--interface", help=f"What it shall fill: {', '.join(EXAMPLES)}.")
    ] = "effect",
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Parent folder of the package.")] = Path(),
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """A third-party package that works and passes its own tests as generated."""
    with session("new-plugin", json, quiet) as here:
        files = create_package(name, out, interface)
        here.result["files"] = [str(path) for path in files]
        for path in files:
            here.say(str(path))
        here.say(f"\nnext: pip install -e '{out / name}[test]' && pytest {out / name}")
