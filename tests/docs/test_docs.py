"""The docs are true: every kind has a fresh page, links lead somewhere, examples are accepted."""

import ast
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pliant.config.loading import load_study
from pliant.registry.discovery import discover

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
WRITTEN = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]
PAGES = [*WRITTEN, *sorted(DOCS.glob("reference/**/*.md"))]
REGISTRY = discover()
SHIPPED = [c for c in REGISTRY.components if c.package.startswith("pliant ")]


def blocks(path, language):
    return re.findall(rf"```{language}\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("component", SHIPPED, ids=lambda c: f"{c.interface}-{c.kind}")
def test_every_kind_has_a_page(component):
    page = DOCS / "reference" / component.interface / f"{component.kind}.md"
    assert page.is_file(), "run 'make docs'"
    assert component.kind in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("component", SHIPPED, ids=lambda c: f"{c.interface}-{c.kind}")
def test_every_key_says_what_it_means(component):
    for name, field in component.config_model().model_fields.items():
        if name != "kind":
            assert field.description or component.interface == "effect", f"{name} has no description"


def test_the_generated_pages_are_fresh():
    result = subprocess.run(
        [sys.executable, str(DOCS / "generate.py"), "--check"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout


def test_the_freshness_check_can_fail(tmp_path):
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.pages(REGISTRY)
    for component in SHIPPED:
        assert DOCS / "reference" / component.interface / f"{component.kind}.md" in made


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.name)
def test_studies_in_the_docs_are_accepted(page, tmp_path):
    for number, text in enumerate(blocks(page, "yaml")):
        if not text.startswith("pliant: 1"):
            continue
        path = tmp_path / f"study{number}.yaml"
        path.write_text(text)
        assert load_study(path, REGISTRY).name


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.name)
def test_python_in_the_docs_is_python(page):
    for text in blocks(page, "python"):
        ast.parse(text)


@pytest.mark.parametrize("study", sorted((ROOT / "examples").rglob("*.yaml")), ids=lambda p: p.name)
def test_examples_are_accepted(study):
    assert load_study(study, REGISTRY).name


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.name)
def test_commands_in_the_docs_exist(page):
    from pliant.cli.app import app

    verbs = {command.name or command.callback.__name__ for command in app.registered_commands}
    for text in blocks(page, "console"):
        for verb in re.findall(r"^\$ pliant (\S+)", text, re.MULTILINE):
            assert verb in verbs
