"""The files of smallest_plugins.md, copied unchanged: short, found, and correct by the conformance suites."""

import importlib.metadata
import json

import numpy as np
import pytest
from tests.docs.pages import blocks, page_text
from typer.testing import CliRunner

from pliant.cli.verbs import VERBS, app
from pliant.interfaces.physics import (
    BatchBackend,
    ExportBackend,
    HistoryBackend,
    MountBackend,
    SceneBackend,
    SceneExportBackend,
)
from pliant.records.rollout import Inputs
from pliant.registry import manifests
from pliant.registry.command import commands
from pliant.registry.discovery import discover
from pliant.registry.files import with_files
from pliant.testing import run_checks
from pliant.testing.samples import sample_finger

PAGE = page_text("smallest_plugins")
EFFECT, ENGINE, SURROGATE, OPTIMIZER, MANIFEST, VERB = blocks(PAGE, "python")
FILES = {
    ("effect", "cubic_rise"): (EFFECT, 20),
    ("physics", "root"): (ENGINE, 60),
    ("surrogate", "linear"): (SURROGATE, 50),
    ("optimizer", "climb"): (OPTIMIZER, 40),
}
STUDY = """
name: two-modules
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 2, module_length: 11 mm}
"""


def terminal_lines(*texts):
    return len([line for text in texts for line in text.splitlines() if line.strip()])


@pytest.fixture(scope="module")
def components(tmp_path_factory):
    folder = tmp_path_factory.mktemp("smallest")
    files = []
    for (_, kind), (text, _) in FILES.items():
        files.append(folder / f"{kind}.py")
        files[-1].write_text(text, encoding="utf-8")
    return {(c.interface, c.kind): c for c in with_files(discover(), files).components}


@pytest.mark.parametrize(("key", "most"), [(key, most) for key, (_, most) in FILES.items()])
def test_each_file_is_short(key, most):
    assert terminal_lines(FILES[key][0]) <= most


@pytest.mark.parametrize("key", [key for key in FILES if key[0] in ("surrogate", "optimizer")])
def test_a_quick_one_keeps_its_contract(components, key):
    outcomes = run_checks(components[key])
    assert [o.message for o in outcomes if o.status == "failed"] == []
    assert len([o for o in outcomes if o.status == "passed"]) > 10


@pytest.mark.slow
@pytest.mark.parametrize("key", [key for key in FILES if key[0] in ("effect", "physics")])
def test_a_slow_one_keeps_its_contract(components, key):
    outcomes = run_checks(components[key])
    assert [o.message for o in outcomes if o.status == "failed"] == []
    assert len([o for o in outcomes if o.status == "passed"]) > 10


def make_engine(components, kind):
    component = components["physics", kind]
    return component.build(component.config_model()(kind=kind))


def test_the_engine_has_three_methods_and_agrees_with_ours(components):
    root, ours = (make_engine(components, kind) for kind in ("root", "quasistatic"))
    own = {name for name in vars(type(root)) if not name.startswith("_")} - {"capabilities"}
    with root.build(sample_finger()) as simulation:
        own |= {name for name in ("apply", "settle") if name in vars(type(simulation))}
        for name in ("step", "snapshot", "restore", "markers"):
            assert name not in vars(type(simulation))
    assert own == {"build", "apply", "settle"}
    ends = []
    for engine in (root, ours):
        with engine.build(sample_finger()) as simulation:
            simulation.apply(Inputs({"pressure_pa": 15e3}))
            ends.append(simulation.settle())
    np.testing.assert_allclose(ends[0].markers_m, ends[1].markers_m, atol=1e-8)


def test_what_an_engine_can_do_its_methods_say(components):
    every = (HistoryBackend, SceneBackend, ExportBackend, SceneExportBackend, MountBackend, BatchBackend)
    has = {
        kind: {protocol for protocol in every if isinstance(make_engine(components, kind), protocol)}
        for kind in ("root", "quasistatic", "mujoco")
    }
    assert has == {"root": set(), "quasistatic": {HistoryBackend, BatchBackend}, "mujoco": set(every)}


@pytest.mark.parametrize(
    ("blocks_of_study", "verb", "sentence"),
    [
        ("task: {kind: grasp, object: egg, pressure: 15 kPa}", "simulate", "physics 'root' has no contacts"),
        (
            "task: {kind: free_bending, pressure: 5 kPa}\neffects: [{kind: viscoelastic, share: 0.2}]",
            "simulate",
            "physics 'root' does not follow effects with rate or memory",
        ),
        (
            "measurements: {file: bench.csv}",
            "compare",
            "physics 'root' cannot follow measured histories",
        ),
    ],
)
def test_what_the_engine_cannot_do_is_one_sentence(workplace, blocks_of_study, verb, sentence):
    (workplace / "root_engine.py").write_text(ENGINE, encoding="utf-8")
    (workplace / "bench.csv").write_text("time_s,pressure_pa,angle_rad\n0,0,0\n1,5e3,0.2\n2,1e4,0.4\n3,0,0\n")
    study = workplace / "study.yaml"
    study.write_text(
        f"plugins: [root_engine.py]\nphysics: root\n{STUDY}{blocks_of_study}\n", encoding="utf-8"
    )
    done = CliRunner().invoke(app, [verb, str(study)])
    assert done.exit_code == 2, done.output
    assert sentence in " ".join(done.stderr.split())


def test_the_command_is_found_by_its_entry_point(workplace, monkeypatch):
    package = workplace / "count_joints"
    package.mkdir()
    (package / "__init__.py").write_text(MANIFEST, encoding="utf-8")
    (package / "verb.py").write_text(VERB, encoding="utf-8")
    assert terminal_lines(MANIFEST, VERB) <= 30
    monkeypatch.syspath_prepend(workplace)
    entry = importlib.metadata.EntryPoint("count_joints", "count_joints", manifests.GROUP)
    known = importlib.metadata.entry_points(group=manifests.GROUP)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [*known, entry])
    command = commands()["count-joints"]
    assert command.help == "Print the number of joints of a study's chain."
    monkeypatch.setitem(VERBS, command.name, command)
    (workplace / "study.yaml").write_text(STUDY, encoding="utf-8")
    done = CliRunner().invoke(app, ["count-joints", "study.yaml", "--json", "counted.json"])
    assert done.exit_code == 0, done.output
    assert json.loads((workplace / "counted.json").read_text())["joints"] == 2
