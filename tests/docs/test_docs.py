"""The docs are correct: every kind has a fresh page, links resolve, examples are accepted, their plugins run."""

import ast
import importlib.util
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.docs.pages import DOCS, ROOT, blocks, commands, page_text, run
from typer.testing import CliRunner

from pliant.cli.plugins import create_package
from pliant.cli.verbs import VERBS, app
from pliant.config.loading import load_study
from pliant.meshing.cells import cell_volumes
from pliant.meshing.soundness import found_wrong
from pliant.pipeline.simulate import run_task
from pliant.records.history import History
from pliant.records.term import LawTerm
from pliant.registry.discovery import discover
from pliant.testing import run_checks
from pliant.testing.histories import follow_joint
from pliant.testing.samples import sample_chain, sample_finger

WRITTEN = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "examples/data/README.md")),
    *sorted(DOCS.glob("*.md")),
    *sorted(DOCS.glob("families/*.md")),
]
GENERATED = sorted(DOCS.glob("reference/**/*.md"))
REGISTRY = discover()
SHIPPED = [c for c in REGISTRY.components if c.package.startswith("pliant ")]


@pytest.mark.parametrize("component", SHIPPED, ids=lambda c: f"{c.interface}-{c.kind}-{c.models[0]}")
def test_every_kind_has_a_page_and_every_key_a_description(component):
    of_own_models = component.interface == "effect" and "chain" not in component.models
    page = DOCS / "reference" / component.interface / f"{component.kind}.md"
    page = DOCS / "reference" / "effects_of_models.md" if of_own_models else page
    assert component.kind in page.read_text(encoding="utf-8"), "run 'make docs'"
    fields = component.config_model().model_fields
    assert [name for name, field in fields.items() if name != "kind" and not field.description] == []


def test_the_generated_pages_are_fresh_and_stale_ones_are_named(monkeypatch, capsys):
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(sys, "argv", ["generate.py", "--check"])
    assert module.main() == 0, capsys.readouterr().out
    made = module.pages(REGISTRY)
    changed, missing = next(iter(made)), DOCS / "reference" / "no_such_page.md"
    stale = {changed: made[changed] + "one line more", missing: "a page"}
    monkeypatch.setattr(module, "pages", lambda registry: {**made, **stale})
    capsys.readouterr()
    assert module.main() == 1
    assert {Path(line.split(" is missing")[0]) for line in capsys.readouterr().out.splitlines()} == set(stale)


# Pages about records and fields show defaults in Python's notation.
OF_CODE = ("records", "mechanics", "plugin_basics", "index")


@pytest.mark.parametrize(
    ("page", "says"),
    [
        ("records.md", "#### `evaluate(actuation: Array, deformation: Array) -> Effort`"),
        ("records.md", "function(actuation, deformation, parameters, tau, dtau_dp, dtau_du)"),
        (
            "records.md",
            "#### `half_width(actuation: Array, deformation: Array, level: float = 0.9) -> Array`",
        ),
        ("surrogate/index.md", "| `report` | FitReport | required |"),
        ("physics/index.md", "| `velocity` | Array | required |"),
        ("mechanics.md", "`pliant.mechanics.statics`"),
    ],
)
def test_what_a_plugin_is_made_with_has_a_reference(page, says):
    assert says in (DOCS / "reference" / page).read_text(encoding="utf-8")


@pytest.mark.parametrize("page", [*WRITTEN, *GENERATED], ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere_and_tables_are_whole(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text):
        assert (page.parent / target).exists(), target
    width = 0
    for line in text.splitlines():
        cells = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        assert not (width and cells) or cells == width, line
        width = cells
    if page in GENERATED and page.stem not in OF_CODE:  # defaults are written as in a study
        defaults = re.findall(r"^\| `[^|]*` \|[^|]*\| `([^|]*)` \|", text, re.M)
        assert not [cell for cell in defaults if re.search(r"[('\")]|True|False", cell)]


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.name)
def test_studies_python_and_commands_on_a_page_are_accepted(page, tmp_path):
    text = page.read_text(encoding="utf-8")
    for study in blocks(text, "yaml"):
        if study.startswith("pliant: 1") and "\nplugins:" not in study:
            (tmp_path / "study.yaml").write_text(study)
            assert load_study(tmp_path / "study.yaml", REGISTRY).name
    for code in blocks(text, "python"):
        ast.parse(code)
    assert set(re.findall(r"^\$ pliant (\S+)", "\n".join(blocks(text, "console")), re.M)) <= set(VERBS)


@pytest.mark.parametrize("study", sorted((ROOT / "examples").rglob("*.yaml")), ids=lambda p: p.name)
def test_examples_are_accepted(study):
    assert load_study(study, REGISTRY).name


def test_refusals_in_the_docs_are_what_the_command_says(workplace):
    """`$ pliant …` followed by a quoted error."""
    found = 0
    for page in WRITTEN:
        text = page.read_text(encoding="utf-8")
        for command, quoted in re.findall(r"\$ pliant ([^\n]*)\n```\n\n((?:> [^\n]*\n)+)", text):
            said = CliRunner().invoke(app, shlex.split(command))
            assert said.exit_code == 2
            assert " ".join(said.stderr.split()) == " ".join(re.sub("^> ", "", quoted, flags=re.M).split())
            found += 1
    assert found


def kept_contract(component, fewest):
    outcomes = run_checks(component)
    assert [o.message for o in outcomes if o.status == "failed"] == []
    assert len([o for o in outcomes if o.status == "passed"]) > fewest


def loaded(monkeypatch, path, package):
    monkeypatch.syspath_prepend(path)
    (component,) = importlib.import_module(f"{package}.manifest").pliant_components()
    return component


@pytest.mark.slow
def test_the_plugin_in_the_docs_passes_conformance(tmp_path, monkeypatch):
    """The code blocks of write_a_plugin.md are used unchanged."""
    page = page_text("write_a_plugin")
    package = tmp_path / "my_effect"
    package.mkdir()
    (package / "__init__.py").write_text('"""My effect."""\n', encoding="utf-8")
    for name, text in zip(("config", "effect", "manifest"), blocks(page, "python"), strict=False):
        (package / f"{name}.py").write_text(text, encoding="utf-8")
        assert f"`src/my_effect/{name}.py`" in page
    kept_contract(loaded(monkeypatch, tmp_path, "my_effect"), 10)
    assert re.findall(r"^(\S+) = \"my_effect.manifest\"", "\n".join(blocks(page, "toml")), re.M) == [
        "my_effect"
    ]


def typed_in(folder, monkeypatch, name, interface):
    """Return the component of a generated package whose implementation is replaced by the page's block."""
    page, package = page_text("write_a_plugin"), name.replace("-", "_")
    cls = "".join(word.capitalize() for word in name.split("-"))
    (block,) = (text for text in blocks(page, "python") if f"class {cls}(" in text)
    assert f"`src/{package}/{interface}.py`" in page
    create_package(name, folder, interface)
    (folder / name / "src" / package / f"{interface}.py").write_text(block, encoding="utf-8")
    return loaded(monkeypatch, folder / name / "src", package)


def built(component, **keys):
    return component.build(component.config_model().model_validate({"kind": component.kind, **keys}))


@pytest.mark.slow
def test_the_task_with_contact_in_the_docs_pushes_a_ball(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    component = typed_in(tmp_path, monkeypatch, "my-push", "task")
    kept_contract(component, 0)
    engine, finger = built(REGISTRY.get("physics", "mujoco")), sample_finger(modules=6)
    tasks = (built(component, pressure_pa=pressure) for pressure in (0.0, 10e3))
    still, pushed = (run_task(engine, task, (), finger).metrics["way_m"] for task in tasks)
    assert still < 1e-4
    assert pushed > 5e-3


@pytest.mark.slow
def test_the_family_in_the_docs_bends_either_way(tmp_path, monkeypatch):
    component = typed_in(tmp_path, monkeypatch, "my-twin", "family")
    kept_contract(component, 20)
    solver = built(REGISTRY.get("fem", "skfem")).checked_solver(built(component).problem(), rubber())
    up, down = (solver.free(np.array(levels), solver.rest()).angle_rad for levels in ([8e3, 0.0], [0.0, 8e3]))
    assert abs(up) > 5e-4
    assert up == pytest.approx(-down, rel=1e-6)


@pytest.mark.slow
def test_the_mesh_in_the_docs_from_a_mesher_is_sound(tmp_path, monkeypatch):
    pytest.importorskip("netgen")
    component = typed_in(tmp_path, monkeypatch, "my-twin", "family")
    (block,) = (text for text in blocks(page_text("write_a_plugin"), "python") if "piece_mesh" in text)
    typed = {}
    exec(block, typed)  # the page's own code
    family = built(component)
    monkeypatch.setattr(type(family), "mesh", typed["mesh"])
    monkeypatch.setattr(type(family), "actuation", "pressure_pa")
    problem, c = family.problem(), family.config
    assert found_wrong(problem) == ""
    chamber = (c.width_m / 2 - c.wall_m) * (c.height_m / 2 - c.wall_m - c.floor_m / 2)
    solid = (c.width_m / 2 * c.height_m - chamber) * family.module_length_m / 2
    assert cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum() == pytest.approx(solid, rel=1e-9)


def rubber():
    return built(REGISTRY.get("material", "neo_hookean"), shear_modulus="240 kPa", density="1150 kg/m^3")


@pytest.mark.slow
def test_the_engine_in_the_docs_agrees(tmp_path, monkeypatch):
    component = typed_in(tmp_path, monkeypatch, "my-engine", "physics")
    kept_contract(component, 20)
    task = built(REGISTRY.get("task", "tip_load"), pressure="15 kPa", payload="13 g")
    engines = (component, REGISTRY.get("physics", "quasistatic"))
    here, there = (run_task(built(engine), task, (), sample_finger()).final for engine in engines)
    np.testing.assert_allclose(here.markers_m, there.markers_m, atol=1e-8)


@pytest.fixture
def own_effect(workplace):
    """Return the file and the study of write_an_effect.md, copied unchanged, and the page's commands."""
    page = page_text("write_an_effect")
    (workplace / "stiffening.py").write_text(blocks(page, "python")[0], encoding="utf-8")
    (workplace / "own.yaml").write_text(blocks(page, "yaml")[0], encoding="utf-8")
    return commands(page)


def test_the_effect_in_the_docs_runs_from_outside_the_tree(own_effect):
    simulate, plugins, _ = own_effect
    assert "stiffening.py" in run(plugins)
    # τ(p, u) with E scaled by 1 + 2 u² is in balance at each joint.
    u = np.radians(float(re.search(r"max_joint_angle +([\d.]+)°", run(simulate))[1]))
    law = 1.637e-6 * 15e3 - 1.704e-6 * 15e3 * u - (1 + 2 * u * u) * (0.1012 * u * u / 2 + 0.0245 * u)
    assert abs(law) < 1e-6


@pytest.mark.slow
def test_the_effect_in_the_docs_passes_conformance(own_effect):
    assert "0 failed, 0 skipped" in run(own_effect[2])


def test_the_memory_in_the_docs_wears_a_joint_down():
    """The second function of write_an_effect.md is used in the term that the text names."""
    page = page_text("write_an_effect")
    made = {"LawTerm": LawTerm}
    exec(blocks(page, "python")[1], made)
    (text,) = re.findall(r"`(LawTerm\(.*?\))`\.", page)
    chain = sample_chain(modules=1, gravity=(0, 0, 0)).with_(terms=(eval(text, made),))
    pressure = 7.5e3 * (1 - np.cos(np.linspace(0, 6 * np.pi, 61)))
    history = History.from_arrays({"pressure_pa": pressure}, np.arange(61.0))
    (plain,) = follow_joint(chain, [history])
    assert plain[10] < plain[30] < plain[50]
    ((run_of_engine,), _) = built(REGISTRY.get("physics", "quasistatic")).follow(chain, [history])
    np.testing.assert_allclose(run_of_engine.joint_angles[:, 0, 0], plain, atol=1e-6)
