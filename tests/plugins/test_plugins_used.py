"""A run records the packages of the plugins that computed it, and names the one that is not installed any more."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
from tests.plugins.broken import lay_package
from typer.testing import CliRunner, Result

from pliant.cli.verbs import app

TEXTS = {
    "__init__.py": "",
    "manifest.py": """\
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_components():
    return [Component("surrogate", "my_law", "my_law.config:Config", "my_law.work:Work", "a stated law")]
""",
    "config.py": """\
from typing import Literal

from pliant_plugins.surrogates.config import PolynomialConfig


class Config(PolynomialConfig):
    kind: Literal["my_law"] = "my_law"
""",
    "work.py": """\
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial


class Work(Polynomial):
    pass
""",
}


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture
def run_with_a_package(site: Path) -> Path:
    """Return the folder of a run with a law of a package."""
    lay_package(site, "my_law", TEXTS, version="0.3")
    text = Path("joint.yaml").read_text().replace("kind: polynomial", "kind: my_law")
    text = text.replace("measurements: {file: joint.csv}", "task: {kind: free_bending, pressure: 15 kPa}")
    Path("mine.yaml").write_text(text)
    done = call("run", "mine.yaml", "--out", "out")
    assert done.exit_code == 0, (done.output, done.exception)
    return Path("out")


def test_folder_and_store_record_package_and_version(run_with_a_package: Path) -> None:
    wanted = {"interface": "surrogate", "kind": "my_law", "package": "my_law 0.3"}
    assert wanted in json.loads((run_with_a_package / "run.json").read_text())["plugins"]
    manifests = [
        json.loads(file.read_text()) for file in Path(".pliant/store").glob("simulate/*/manifest.json")
    ]
    assert any(wanted in manifest["plugins"] for manifest in manifests)
    assert "my_law 0.3" in (run_with_a_package / "report.html").read_text()


def test_a_report_without_the_plugin_names_its_package(site: Path, run_with_a_package: Path) -> None:
    shutil.rmtree(site / "my_law-0.3.dist-info")
    for name in [name for name in sys.modules if name.startswith("my_law")]:
        del sys.modules[name]
    done = call("report", str(run_with_a_package))
    said = " ".join(done.output.split())
    assert done.exit_code == 2
    assert "out was computed with surrogate 'my_law' of my_law 0.3, which is needed to read it" in said
