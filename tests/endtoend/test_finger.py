"""The whole way: geometry → FEM → law → finger in the engines → report; cached, interrupted, edited."""

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

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "first_finger"
SMALL = ["fem.pressures=4", "fem.angles=5", "fem.check_states=4"]
HAS_PYBULLET = importlib.util.find_spec("pybullet") is not None


def pliant(*arguments, cwd, check=True, **environment):
    command = [sys.executable, "-m", "pliant", *map(str, arguments)]
    env = {**os.environ, **{k: str(v) for k, v in environment.items()}}
    result = subprocess.run(
        command, cwd=cwd, env=env, capture_output=True, text=True, timeout=300, check=False
    )
    assert not check or result.returncode == 0, result.stderr
    return result


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The two studies of `make demo`, with fewer states; shared by the tests of this file."""
    folder = tmp_path_factory.mktemp("runs")
    results = {}
    for name in ("finger", "loaded"):
        pliant("run", EXAMPLES / f"{name}.yaml", *SMALL, "--out", name, "--json", f"{name}.json", cwd=folder)
        results[name] = json.loads((folder / f"{name}.json").read_text())
    return folder, results


def test_engines_agree_on_a_finger_that_bends_and_sags_and_nothing_is_computed_twice(runs):
    folder, results = runs
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
    pliant("run", EXAMPLES / "finger.yaml", *SMALL, "--out", "finger", "--json", "again.json", cwd=folder)
    again = json.loads((folder / "again.json").read_text())
    assert all(stage["cached"] for name in ("fem", "fit", "simulate") for stage in again[name]["stages"])


def test_an_interrupted_fem_goes_on_where_it_was(tmp_path):
    arguments = [sys.executable, "-m", "pliant", "fem", str(EXAMPLES / "finger.yaml"), *SMALL]
    process = subprocess.Popen(arguments, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    index = []
    deadline = time.monotonic() + 120
    while len(index) < 4 and time.monotonic() < deadline:
        time.sleep(0.1)
        found = list(tmp_path.glob(".pliant/store/fem/*.partial/states.json"))
        index = json.loads(found[0].read_text()) if found else []
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "run the same command to go on" in " ".join(err.split())
    assert not (tmp_path / "runs").exists() or not list((tmp_path / "runs").rglob("*.csv"))
    (partial,) = tmp_path.glob(".pliant/store/fem/*.partial")
    kept = json.loads((partial / "states.json").read_text())
    assert len(kept) >= 4
    resumed = pliant("fem", EXAMPLES / "finger.yaml", *SMALL, "--json", "out.json", cwd=tmp_path)
    assert f"going on from {len(kept)}/" in resumed.stderr
    result = json.loads((tmp_path / "out.json").read_text())
    assert result["n_states"] == 4 + 4 * 5 + 4


def test_a_process_that_waits_goes_on_where_the_killed_one_stopped(tmp_path):
    store = tmp_path / "my störe"
    call = [
        sys.executable,
        "-m",
        "pliant",
        "fem",
        str(EXAMPLES / "finger.yaml"),
        *SMALL,
        "--store",
        str(store),
    ]
    places = [tmp_path / "first", tmp_path / "second"]
    for place in places:
        place.mkdir()

    def start(place):
        return subprocess.Popen(
            call, cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, encoding="utf-8"
        )

    def finished_states():
        found = list(store.glob("fem/*.partial/states.json"))
        return json.loads(found[0].read_text()) if found else {}

    first = start(places[0])
    deadline = time.monotonic() + 120
    while len(finished_states()) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    second = start(places[1])
    time.sleep(0.5)
    first.kill()
    first.communicate(timeout=60)
    kept = finished_states()
    assert len(kept) >= 2
    _, err = second.communicate(timeout=300)
    assert second.returncode == 0, err
    assert "damaged" not in err
    assert f"going on from {len(kept)}/" in err
    assert (places[1] / "runs" / "first-finger" / "fem.csv").is_file()
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

CONTRACT = 2


@hookimpl
def pliant_components():
    return [Component("effect", "leaky", "edited_plugin.effect:LeakyConfig", "edited_plugin.effect:Leaky", "test")]
"""


@pytest.fixture
def edited_plugin(tmp_path):
    """A third-party package on the path, as pip would leave it."""
    site = tmp_path / "site"
    package, info = site / "edited_plugin", site / "edited_plugin-1.0.dist-info"
    package.mkdir(parents=True)
    info.mkdir()
    for name, text in {"__init__": "", "effect": EFFECT, "helper": HELPER, "manifest": MANIFEST}.items():
        (package / f"{name}.py").write_text(textwrap.dedent(text))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: edited-plugin\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pliant]\nedited = edited_plugin.manifest\n")
    return package


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
        call = ["run", study, "--json", "out.json"]
        pliant(*call, cwd=tmp_path, PYTHONPATH=edited_plugin.parent, PYTHONDONTWRITEBYTECODE=1)
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
