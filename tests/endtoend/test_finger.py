"""From geometry by FEM, law and engines to the report: cached, interrupted, edited."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from tests.command import called

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "first_finger"
TINY = ["fem.pressures=2", "fem.angles=4", "fem.check_states=1"]
HAS_PYBULLET = importlib.util.find_spec("pybullet") is not None


def pliant(*arguments):
    """Call a verb in this process."""
    called(*arguments).done()


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return the two studies of `make demo`, with fewer states; shared by the tests of this file."""
    folder, results = tmp_path_factory.mktemp("runs"), {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name in ("finger", "loaded"):
            pliant("run", EXAMPLES / f"{name}.yaml", *TINY, "--out", name, "--json", f"{name}.json")
            results[name] = json.loads((folder / f"{name}.json").read_text())
    return folder, results


def test_engines_agree_on_a_finger_that_bends_and_sags_and_nothing_is_computed_twice(runs, monkeypatch):
    folder, results = runs
    monkeypatch.chdir(folder)
    for result in results.values():
        assert result["largest_marker_distance_m"] < 1e-6  # published: 4e-7
        skipped = {e["kind"]: e["skipped"] for e in result["cross_check"] if "skipped" in e}
        assert list(skipped) == ([] if HAS_PYBULLET else ["pybullet"])
        for engine in (result["simulate"], *(e for e in result["cross_check"] if "skipped" not in e)):
            assert engine["converged"] and engine["residual"] < 1e-6
    assert results["finger"]["fit"]["heldout"]["worst_of_range"] < 0.005
    free, loaded = (np.array(results[name]["simulate"]["tip_m"]) for name in ("finger", "loaded"))
    assert free[0] > 0.04 and loaded[2] < free[2] - 0.01 and abs(free[1]) < 1e-9
    assert all(results["loaded"][stage]["stages"][0]["cached"] for stage in ("fem", "fit"))
    header = (folder / "finger" / "fem.csv").read_text().splitlines()[0].split(",")
    assert header[:3] == ["pressure_pa", "axis", "angle_rad"] and "wall_m" in header
    page = (folder / "loaded" / "report.html").read_text()
    assert "loaded-finger" in page and 'src="http' not in page
    assert list((folder / "loaded" / "pictures").glob("*.png"))
    pliant("run", EXAMPLES / "finger.yaml", *TINY, "--out", "finger", "--json", "again.json")
    again = json.loads((folder / "again.json").read_text())
    assert all(stage["cached"] for name in ("fem", "fit", "simulate") for stage in again[name]["stages"])


@pytest.mark.slow
def test_interrupted_and_killed_a_fem_goes_on_where_it_was_also_for_one_that_waits(tmp_path):
    """SIGINT stops the first process, SIGKILL the second; the third waits for the second and finishes the table."""
    store = tmp_path / "my störe"
    call = [
        sys.executable,
        "-m",
        "pliant",
        "fem",
        str(EXAMPLES / "finger.yaml"),
        *TINY,
        "--store",
        str(store),
    ]

    def start(name):
        (tmp_path / name).mkdir()
        return subprocess.Popen(
            [*call, "--json", "out.json"], cwd=tmp_path / name, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True, encoding="utf-8",
        )  # fmt: skip

    def solved(process, least):
        """Wait until at least `least` states are finished and return their number."""
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline and process.poll() is None:
            found = list(store.glob("fem/*.partial/states.json"))
            count = len(json.loads(found[0].read_text())) if found else 0
            if count >= least:
                return count
            time.sleep(0.05)
        raise AssertionError(process.communicate()[1])

    first = start("first")
    solved(first, 2)
    first.send_signal(signal.SIGINT)
    _, err = first.communicate(timeout=300)
    assert first.returncode == 130, err
    assert "run the same command to continue" in " ".join(err.split())
    assert not list((tmp_path / "first").rglob("*.csv"))
    (partial,) = store.glob("fem/*.partial/states.json")
    interrupted = len(json.loads(partial.read_text()))
    assert interrupted >= 2
    second = start("second")
    solved(second, interrupted + 1)
    third = start("third")
    time.sleep(0.5)
    second.kill()
    assert f"going on from {interrupted}/" in second.communicate(timeout=60)[1]
    kept = len(json.loads(partial.read_text()))
    _, err = third.communicate(timeout=300)
    assert third.returncode == 0, err
    assert "damaged" not in err
    assert f"going on from {kept}/" in err
    assert json.loads((tmp_path / "third" / "out.json").read_text())["n_states"] == 2 + 2 * 4 + 1
    assert (tmp_path / "third" / "runs" / "first-finger" / "fem.csv").is_file()
    (key,) = (p.name for p in (store / "fem").iterdir() if p.is_dir())
    assert {p.name for p in (store / "fem").iterdir()} == {key, f"{key}.lock"}


EFFECT = """
from typing import ClassVar, Literal

from pliant.interfaces.effect import Effect, EffectConfig, parameter
from edited_plugin import helper


class LeakyConfig(EffectConfig):
    kind: Literal["leaky"] = "leaky"
    share: float = parameter(unit="1", neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.3))


class Leaky(Effect):
    place: ClassVar = "input"

    def apply(self, model):
        return model.with_(inputs=(*model.inputs, helper.scaled(1 - self.config.share)))
"""
HELPER = """
import dataclasses


def scaled(factor):
    def change(inputs):
        return dataclasses.replace(inputs, actuation={k: factor * v for k, v in inputs.actuation.items()})
    return change
"""
MANIFEST = """
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_components():
    return [Component("effect", "leaky", "edited_plugin.effect:LeakyConfig", "edited_plugin.effect:Leaky", "test")]
"""


@pytest.fixture
def edited_plugin(tmp_path):
    """Return a third-party package on the path, as pip installs it."""
    site = tmp_path / "site"
    package, info = site / "edited_plugin", site / "edited_plugin-1.0.dist-info"
    package.mkdir(parents=True)
    info.mkdir()
    for name, text in {"__init__": "", "effect": EFFECT, "helper": HELPER, "manifest": MANIFEST}.items():
        (package / f"{name}.py").write_text(textwrap.dedent(text))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: edited-plugin\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pliant]\nedited = edited_plugin.manifest\n")
    return package


@pytest.mark.slow
def test_editing_a_plugins_helper_recomputes_exactly_what_depends_on_it(tmp_path, edited_plugin):
    table = tmp_path / "law.csv"
    rows = [
        f"{p},{u},{1.6e-6 * p - 0.03 * u - 1e-6 * p * u}"
        for p in range(0, 15001, 3000)
        for u in (0, 0.2, 0.4)
    ]
    table.write_text("\n".join(["pressure_pa,angle_rad,moment_n_m", *rows]))
    study = tmp_path / "study.yaml"
    study.write_text(
        "name: edited\nsurrogate: {kind: polynomial, data: law.csv}\n"
        "chain: {modules: 3, module_length: 11 mm, gravity: [0, 0, 0]}\nphysics: quasistatic\n"
        "task: {kind: free_bending, pressure: 10 kPa}\neffects: [leaky]\n"
    )

    def cached():
        paths = {"PYTHONPATH": f"{edited_plugin.parent}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
        call = [sys.executable, "-m", "pliant", "run", str(study), "--json", "out.json"]
        env = {**os.environ, **paths, "PYTHONDONTWRITEBYTECODE": "1"}
        subprocess.run(call, cwd=tmp_path, env=env, capture_output=True, timeout=300, check=True)
        result = json.loads((tmp_path / "out.json").read_text())
        fit, simulation = (result[stage]["stages"][0]["cached"] for stage in ("fit", "simulate"))
        return fit, simulation, result["simulate"]["tip_m"]

    fit, simulation, before = cached()
    assert (fit, simulation) == (False, False)
    helper = edited_plugin / "helper.py"
    helper.write_text(helper.read_text().replace("factor * v", "factor * v * 1.1"))
    fit, simulation, after = cached()
    assert (fit, simulation) == (True, False)
    assert after != before
    helper.write_text(helper.read_text() + "\n# only a comment\n")
    assert cached()[:2] == (True, True)
