"""The docs are true: every kind has a fresh page, links lead somewhere, examples are accepted."""

import ast
import importlib.util
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pliant.config.loading import load_study
from pliant.registry.discovery import discover

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
WRITTEN = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "examples/data/README.md",
    *sorted(DOCS.glob("*.md")),
    *sorted(DOCS.glob("families/*.md")),
]
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
            assert field.description, f"{name} has no description"


def test_the_generated_pages_are_fresh():
    result = subprocess.run(
        [sys.executable, str(DOCS / "generate.py"), "--check"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout


def test_the_freshness_check_can_fail(monkeypatch, capsys):
    """A page whose text differs and a page that is not there are both named."""
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.pages(REGISTRY)
    for component in SHIPPED:
        assert DOCS / "reference" / component.interface / f"{component.kind}.md" in made
    changed, missing = next(iter(made)), DOCS / "reference" / "no_such_page.md"
    stale = {changed: made[changed] + "one line more", missing: "a page"}
    monkeypatch.setattr(module, "pages", lambda registry: {**made, **stale})
    monkeypatch.setattr(sys, "argv", ["generate.py", "--check"])
    assert module.main() == 1
    assert {Path(line.split(" is missing")[0]) for line in capsys.readouterr().out.splitlines()} == set(stale)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.name)
def test_studies_in_the_docs_are_accepted(page, tmp_path):
    for number, text in enumerate(blocks(page, "yaml")):
        if not text.startswith("pliant: 1") or "\nplugins:" in text:
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
    from pliant.cli.verbs import VERBS

    for text in blocks(page, "console"):
        for verb in re.findall(r"^\$ pliant (\S+)", text, re.MULTILINE):
            assert verb in VERBS


def test_the_plugin_of_the_docs_passes_conformance(tmp_path, monkeypatch):
    """The code blocks of write_a_plugin.md, typed in as they stand."""
    from pliant.registry.component import INTERFACES
    from pliant.testing.suite import run_checks

    page = DOCS / "write_a_plugin.md"
    files = dict(zip(("config", "effect", "manifest"), blocks(page, "python"), strict=False))
    package = tmp_path / "my_effect"
    package.mkdir()
    (package / "__init__.py").write_text('"""My effect."""\n', encoding="utf-8")
    for name, text in files.items():
        (package / f"{name}.py").write_text(text, encoding="utf-8")
        assert f"`src/my_effect/{name}.py`" in page.read_text(encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    (component,) = importlib.import_module("my_effect.manifest").pliant_components()
    assert component.interface in INTERFACES
    outcomes = run_checks(component)
    assert [o.message for o in outcomes if o.status != "passed"] == []
    assert len(outcomes) > 10
    (entry,) = re.findall(r"^(\S+) = \"my_effect.manifest\"", "\n".join(blocks(page, "toml")), re.MULTILINE)
    assert entry == "my_effect"


def typed_in(folder, monkeypatch, name, interface):
    """The component of a generated package, with the page's block typed over its implementation."""
    from pliant.cli.plugins import create_package

    page, file = DOCS / "write_a_plugin.md", f"src/{name.replace('-', '_')}/{interface}.py"
    cls = "".join(word.capitalize() for word in name.split("-"))
    (block,) = (text for text in blocks(page, "python") if f"class {cls}(" in text)
    assert f"`{file}`" in page.read_text(encoding="utf-8")
    create_package(name, folder, interface)
    (folder / name / file).write_text(block, encoding="utf-8")
    monkeypatch.syspath_prepend(folder / name / "src")
    (component,) = importlib.import_module(f"{name.replace('-', '_')}.manifest").pliant_components()
    return component


def built(component, **keys):
    return component.build(component.config_model().model_validate({"kind": component.kind, **keys}))


def test_the_task_with_contact_of_the_docs_pushes_a_ball(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    from pliant.pipeline.simulate import run_task
    from pliant.testing.samples import sample_finger
    from pliant.testing.suite import run_checks

    component = typed_in(tmp_path, monkeypatch, "my-push", "task")
    assert [o.message for o in run_checks(component) if o.status == "failed"] == []
    finger = sample_finger(modules=6)
    way = {}
    for pressure in (0.0, 10e3):
        task = built(component, pressure_pa=pressure)
        way[pressure] = run_task(built(REGISTRY.get("physics", "mujoco")), task, (), finger).metrics["way_m"]
    assert way[0.0] < 1e-4
    assert way[10e3] > 5e-3


def test_the_engine_of_the_docs_agrees(tmp_path, monkeypatch):
    from pliant.pipeline.simulate import run_task
    from pliant.testing.samples import sample_finger
    from pliant.testing.suite import run_checks

    component = typed_in(tmp_path, monkeypatch, "my-engine", "physics")
    outcomes = run_checks(component)
    assert [o.message for o in outcomes if o.status == "failed"] == []
    assert len([o for o in outcomes if o.status == "passed"]) > 20
    task = built(REGISTRY.get("task", "tip_load"), pressure="15 kPa", payload="13 g")
    engines = (component, REGISTRY.get("physics", "quasistatic"))
    here, there = (run_task(built(engine), task, (), sample_finger()).final for engine in engines)
    np.testing.assert_allclose(here.markers_m, there.markers_m, atol=1e-8)


def test_the_effect_of_the_docs_runs_from_outside_the_tree(tmp_path, monkeypatch):
    """The file and the study of write_an_effect.md, typed in as they stand, and its commands."""
    from typer.testing import CliRunner

    from pliant.cli.verbs import app

    page = DOCS / "write_an_effect.md"
    effect, _ = blocks(page, "python")
    (study,) = blocks(page, "yaml")
    (tmp_path / "stiffening.py").write_text(effect, encoding="utf-8")
    (tmp_path / "own.yaml").write_text(study, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    said = {}
    for command in re.findall(r"^\$ pliant ([^#\n]*)", "\n".join(blocks(page, "console")), re.M):
        done = CliRunner().invoke(app, shlex.split(command))
        assert done.exit_code == 0, done.output
        said[command.split()[0]] = done.output
    assert list(said) == ["simulate", "plugins", "check"]
    assert "stiffening.py" in said["plugins"]
    assert "0 failed, 0 skipped" in said["check"]
    # τ(p, u) with E scaled by 1 + 2 u² is in balance at each joint.
    u = float(re.search(r"max_joint_angle_rad +([\d.]+)", said["simulate"])[1])
    law = 1.637e-6 * 15e3 - 1.704e-6 * 15e3 * u - (1 + 2 * u * u) * (0.1012 * u * u / 2 + 0.0245 * u)
    assert abs(law) < 1e-6
    assert len([line for line in effect.splitlines() if line.strip()]) <= 25


def test_the_memory_of_the_docs_wears_a_joint_down():
    """The second function of write_an_effect.md, in the term that the text names."""
    from pliant.records.history import History
    from pliant.records.term import LawTerm
    from pliant.testing.histories import follow_joint
    from pliant.testing.samples import sample_chain

    page = DOCS / "write_an_effect.md"
    made = {"LawTerm": LawTerm}
    exec(blocks(page, "python")[1], made)
    (text,) = re.findall(r"`(LawTerm\(.*?\))`\.", page.read_text(encoding="utf-8"))
    chain = sample_chain(modules=1, gravity=(0, 0, 0)).with_(terms=(eval(text, made),))
    history = History.of(
        {"pressure_pa": 7.5e3 * (1 - np.cos(np.linspace(0, 6 * np.pi, 61)))}, np.arange(61.0)
    )
    (plain,) = follow_joint(chain, [history])
    assert plain[10] < plain[30] < plain[50]
    component = REGISTRY.get("physics", "quasistatic")
    engine = component.build(component.config_model()(kind="quasistatic"))
    ((run,), _) = engine.follow(chain, [history])
    np.testing.assert_allclose(run.joint_angles[:, 0, 0], plain, atol=1e-6)


def test_refusals_in_the_docs_are_what_the_command_says(tmp_path, monkeypatch):
    """`$ pliant …` followed by a quoted error."""
    from typer.testing import CliRunner

    from pliant.cli.verbs import app

    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    found = 0
    for page in WRITTEN:
        text = page.read_text(encoding="utf-8")
        for command, quoted in re.findall(r"\$ pliant ([^\n]*)\n```\n\n((?:> [^\n]*\n)+)", text):
            said = CliRunner().invoke(app, shlex.split(command))
            assert said.exit_code == 2
            assert " ".join(said.stderr.split()) == " ".join(re.sub("^> ", "", quoted, flags=re.M).split())
            found += 1
    assert found


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_rows_of_a_table_have_as_many_cells_as_its_head(page):
    width = 0
    for line in page.read_text(encoding="utf-8").splitlines():
        cells = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        if width and cells:
            assert cells == width, line
        width = cells


def test_keys_inside_a_block_are_documented_as_they_are_written():
    text = (DOCS / "reference" / "surrogate" / "polynomial.md").read_text(encoding="utf-8")
    assert "### coefficients" in text
    assert "| `k_n` |  | required |" in text
    assert "| `form` |  | `adaptive` | adaptive, study |" in text


def test_defaults_are_written_as_in_a_study():
    for page in sorted(DOCS.glob("reference/**/*.md")):
        for cell in re.findall(r"^\| `[^|]*` \|[^|]*\| `([^|]*)` \|", page.read_text(encoding="utf-8"), re.M):
            assert not re.search(r"[('\")]|True|False", cell), f"{page.name}: {cell}"
