"""Pages of the docs: their text blocks, and their commands, run unchanged."""

import re
import shlex
from pathlib import Path

from typer.testing import CliRunner

from pliant.cli.verbs import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def page_text(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def commands(text: str) -> list[str]:
    """Return the `pliant` commands of a page's console blocks, without their comments."""
    return re.findall(r"^\$ pliant ([^#\n]*)", "\n".join(blocks(text, "console")), re.M)


# By default a diagnosis tries all effects, which is slow; these kinds represent them.
FEW_EFFECTS = ("stiffness", "actuation_gain", "viscoelastic", "mullins", "dead_zone", "sensor_bias")
ASK_FEW = tuple(word for kind in FEW_EFFECTS for word in ("--effect", kind))


def run(command: str, *more: str) -> str:
    """Run a command, require success and return its output."""
    done = CliRunner().invoke(app, [*shlex.split(command), *more], env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    return done.stdout
