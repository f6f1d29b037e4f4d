"""The verbs of the command line, gathered in one `app`."""

from __future__ import annotations

from typing import Annotated

import typer

from pliant import __version__
from pliant.cli import (
    calibrate,
    compare,
    diagnose,
    export,
    extend,
    fit,
    improve,
    optimize,
    plan,
    plugins,
    render,
    studies,
    view,
)

app = typer.Typer(
    name="pliant",
    help="Soft robots from finite elements to fast, honest chain models.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for verb in (studies.run, studies.fem, fit.fit, studies.simulate, studies.report):
    app.command()(verb)
app.command("plugins")(plugins.plugins)
app.command("check")(plugins.check)
app.command("schema")(plugins.schema)
app.command("new-plugin")(plugins.new_plugin)
app.command("calibrate")(calibrate.calibrate)
app.command("compare")(compare.compare)
app.command("diagnose")(diagnose.diagnose)
app.command("plan")(plan.plan)
app.command("extend")(extend.extend)
app.command("improve")(improve.improve)
app.command("export")(export.export)
app.command("render")(render.render)
app.command("view")(view.view)
app.command("optimize")(optimize.optimize)


def _version(show: bool) -> None:
    if show:
        typer.echo(f"pliant {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass
