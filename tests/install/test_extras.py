"""Extras: a missing library gives a sentence with the command that installs it, and the base works alone."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.errors import MissingDependencyError
from pliant.registry.discovery import discover
from pliant.testing import run_checks

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
SHIPPED = [c for c in discover().components if c.package.startswith("pliant ") and (c.requires or c.lazy)]
# Extra → what the extra of that name, or the base, installed before MuJoCo, scikit-fem and trimesh left the base.
BEFORE = {
    "fast": {"pypardiso", "scikit-fem"},
    "pybullet": {"pybullet"},
    "gym": {"gymnasium", "mujoco", "trimesh"},
    "video": {"imageio-ffmpeg", "mujoco"},
    "ngsolve": {"ngsolve"},
    "fields": {"meshio", "scikit-fem"},
    "cluster": {"dask", "scikit-fem"},
    "meta": {"scikit-learn"},
    "neural": {"torch"},
    "search": {"cma", "optuna"},
    "ppo": {"gymnasium", "torch", "stable-baselines3", "tensorboard", "mujoco"},
    "peers": {"pyelastica"},
    "all": {
        "pypardiso",
        "pybullet",
        "gymnasium",
        "ngsolve",
        "meshio",
        "dask",
        "scikit-learn",
        "cma",
        "optuna",
    }
    | {"scikit-fem", "mujoco", "trimesh"},
}
# Without dask: pint asks for it when it is imported, and a finder can report absence only by an error.
HEAVY = (
    *("skfem", "pypardiso", "ngsolve", "meshio", "mujoco", "pybullet", "trimesh", "gymnasium"),
    *("sklearn", "cma", "optuna", "torch", "stable_baselines3", "tensorboard", "imageio_ffmpeg"),
)
CALLS = {
    ("fem", "finger.yaml"): "fem 'skfem' needs skfem: pip install 'pliant[fem]'.",
    (
        "run",
        "finger.yaml",
        "fem={kind: ngsolve, pressure_max: 15 kPa}",
    ): "fem 'ngsolve' needs ngsolve: pip install 'pliant[ngsolve]'.",
    (
        "simulate",
        "law.yaml",
        "physics=mujoco",
    ): "physics 'mujoco' needs mujoco: pip install 'pliant[mujoco]'.",
    ("render", "law.yaml", "--out", "a.gif"): "viewer 'mujoco' needs mujoco: pip install 'pliant[mujoco]'.",
    ("fit", "solver-table/bellow.csv", "--kind", "neural"): "pip install 'pliant[neural]'.",
    ("optimize", "searched.yaml", "optimizer.kind=cmaes"): "optimizer 'cmaes' needs cma: pip install "
    "'pliant[search]'.",
    (
        "optimize",
        "searched.yaml",
        "optimizer.kind=ppo",
    ): "optimizer 'ppo' needs stable_baselines3: pip install 'pliant[ppo]'.",
}
LAW = """\
pliant: 1
name: law
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 1.6e-6, m_a: -1.7e-6, m_e: 0.1, b_e: 0.025}}
chain: {modules: 2, module_length: 11 mm, gravity: [0, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 10 kPa}
"""
SEARCHED = """\
extends: law.yaml
search:
  variables: {task.pressure: {low: 2 kPa, high: 14 kPa}}
  objective: abs(tip_x - 10 mm)
  budget: 4
optimizer: {kind: cmaes}
"""
NOTES = """\
rename: {"p (kPa)": pressure_pa, "theta (deg)": angle_rad, "M (N*mm)": moment_n_m}
angle: half_module
"""


class Hidden:
    """A finder that reports some libraries as not installed."""

    modules: tuple[str, ...] = ()

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name.partition(".")[0] in self.modules:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


@pytest.fixture
def hide(monkeypatch):
    """Make libraries missing."""
    finder = Hidden()
    sys.meta_path.insert(0, finder)  # in place: imports meanwhile may add finders

    def hidden(*modules):
        finder.modules = modules
        for module in modules:
            monkeypatch.delitem(sys.modules, module, raising=False)

    yield hidden
    sys.meta_path.remove(finder)


def brought(extra: str) -> set[str]:
    """Return the distributions that an extra requires, through extras that it names, whatever their conditions."""
    found: set[str] = set()
    for text in EXTRAS[extra]:
        asked = Requirement(text)
        if asked.name == "pliant":
            found.update(*map(brought, asked.extras))
        else:
            found.add(asked.name)
    return found


def base() -> set[str]:
    return {Requirement(text).name for text in PROJECT["dependencies"]}


@pytest.mark.parametrize("extra", BEFORE)
def test_an_extra_brings_at_least_what_it_brought(extra):
    assert BEFORE[extra] <= brought(extra)


def test_the_base_has_nothing_from_the_extras():
    ours = set().union(*(brought(extra) for extra in EXTRAS if extra not in ("dev", "docs", "peers")))
    assert base() & ours == set()


def test_the_page_names_every_extra_for_users():
    rows = re.findall(r"^\| (`.*?`) \|", (ROOT / "docs" / "install.md").read_text("utf-8"), re.M)
    named = {name for row in rows for name in re.findall(r"`([\w-]+)`", row)}
    assert set(EXTRAS) - {"dev", "docs", "peers"} <= named


@pytest.mark.parametrize("component", SHIPPED, ids=lambda c: f"{c.interface}-{c.kind}")
def test_what_a_component_misses_is_a_sentence_whose_command_brings_it(component, hide):
    modules = (*component.requires, *component.lazy)
    hide(*modules)
    config = component.config_model().model_validate({"kind": component.kind, **component.smallest_block()})
    assert component.missing(lazy=True) == modules[0]
    if component.requires:
        with pytest.raises(MissingDependencyError) as refused:
            component.build(config)
        assert str(refused.value) == f"{component.label} needs {modules[0]}: {component.install}."
    if component.kind == "pybullet" and sys.version_info >= (3, 12):
        assert "use Python 3.11" in component.install
        return
    [extra] = re.fullmatch(r"pip install 'pliant\[(\w+)\]'", component.install).groups()
    known = packages_distributions()
    for module in modules:
        assert {canonicalize_name(name) for name in known.get(module, [module])} & brought(extra), module


@pytest.mark.parametrize(
    "component",
    [c for c in SHIPPED if c.requires and c.kind != "ngsolve"],
    ids=lambda c: f"{c.interface}-{c.kind}",
)
def test_checks_on_a_component_without_its_library_are_skipped(component, hide):
    hide(*component.requires)
    outcomes = run_checks(component)
    assert [outcome.message for outcome in outcomes if outcome.status == "failed"] == []
    assert any(component.install in outcome.message for outcome in outcomes if outcome.status == "skipped")


@pytest.fixture
def call(tmp_path, monkeypatch, hide):
    """Call the command in a folder of studies where no heavy library can be imported."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    hide(*HEAVY)
    run = lambda *arguments: CliRunner().invoke(app, [*arguments])  # noqa: E731
    assert (
        run("example", "solver-table").exit_code
        == run("example", "first-finger", "--out", ".").exit_code
        == 0
    )
    Path("solver-table/bellow.yaml").write_text(NOTES)
    Path("law.yaml").write_text(LAW)
    Path("searched.yaml").write_text(SEARCHED)
    return run


@pytest.mark.parametrize("arguments", CALLS, ids=lambda words: "-".join(words[:3]))
def test_a_command_that_misses_a_library_ends_with_its_sentence(arguments, call):
    done = call(*arguments)
    assert (done.exit_code, done.stderr.strip().endswith(CALLS[arguments])) == (2, True), (
        done.stderr,
        done.exception,
    )


@pytest.mark.slow
def test_laws_chains_and_files_need_no_extra(call):
    for arguments in (
        ("simulate", "law.yaml"),
        ("fit", "solver-table/bellow.csv", "--out", "fitted"),
        ("plugins",),
        ("check", "effect", "stiffness"),
    ):
        done = call(*arguments)
        assert done.exit_code == 0, done.output
