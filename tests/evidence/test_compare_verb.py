"""`pliant compare` from the command line: a study, a CSV, a table, a page, JSON."""

import json
from functools import partial

import numpy as np
import pytest
from tests.command import called
from tests.evidence.compare_data import colour, profile

from pliant import api
from pliant.evidence.comparison_sentences import interpret

STUDY = """\
pliant: 1
name: one-joint
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 1, module_length: 11 mm, gravity: [0, 0, 0]}
measurements: {file: bench.csv}
"""
CONTRACT = {"pliant", "command", "outputs", "rmse_over_floor", "runs", "worst", "n_samples", "n_effective"}


def bend(pressure, moment):
    """Return the stated law's equilibrium angle, by Newton's method."""
    u = np.zeros_like(pressure)
    for _ in range(40):
        effort = 1.637e-6 * pressure - 1.704e-6 * pressure * u - 0.1012 * u * abs(u) / 2 - 0.0245 * u - moment
        u = u + effort / (1.704e-6 * pressure + 0.1012 * abs(u) + 0.0245)
    return u


def bench_csv(shift=0.0, repeats=2):
    rng, rows = np.random.default_rng(3), ["run,time_s,pressure_pa,moment_n_m,angle_rad"]
    for moment in (0.0, 0.002):
        for again in range(repeats):
            time, pressure = profile(2e3, 8.0, 0.2)
            falling = np.gradient(pressure, time) < -1
            angle = bend(pressure, moment) + shift * falling + colour(rng, len(time), 0.004, 0.5)
            name = f"M{1e3 * moment:g}{'ab'[again]}"
            rows += [
                f"{name},{t:.2f},{p:.1f},{moment},{a:.6f}"
                for t, p, a in zip(time, pressure, angle, strict=True)
            ]
    return "\n".join(rows) + "\n"


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(STUDY)
    (tmp_path / "bench.csv").write_text(bench_csv(0.02))

    return partial(called, "compare")


def test_a_wrong_model_is_shown_where_it_is_wrong(call, tmp_path):
    result = call("study.yaml", "--json", "result.json", "--out", "page").done()
    found = json.loads((tmp_path / "result.json").read_text())
    assert set(found) >= CONTRACT and found["command"] == "compare"
    assert found["rmse_over_floor"] > 1.5
    assert found["worst"][0]["condition"] == "falling pressure"
    assert "falling pressure" in result.out
    assert "off by" in result.out
    assert "<img" in (tmp_path / "page" / "report.html").read_text()
    assert (tmp_path / "page" / "pictures" / "runs.png").is_file()


@pytest.mark.slow
def test_other_data_and_overrides(call, tmp_path):
    (tmp_path / "clean.csv").write_text(bench_csv())
    right = api.compare(api.open_study("study.yaml"), "clean.csv")
    assert interpret(right).startswith("Within the noise")
    said = call("study.yaml", "surrogate.coefficients.b_e=0.020", "--data", "clean.csv", "--json", "r.json")
    assert said.code == 0 and "Within the noise" not in said.out
    assert json.loads((tmp_path / "r.json").read_text())["rmse_over_floor"] > 2 * right.rmse_over_floor


@pytest.mark.slow
def test_what_cannot_be_judged_is_no_failure(call, tmp_path):
    (tmp_path / "once.csv").write_text(bench_csv(repeats=1))
    result = call("study.yaml", "--data", "once.csv", "--json", "-").done()
    found = json.loads(result.out)
    assert found["judged"] is False
    assert "no run was repeated" in found["interpretation"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["study.yaml", "--data", "nowhere.csv"], "nowhere.csv"),
        (["study.yaml", "measurements=null"], "names no measurements"),
        (["study.yaml", "--data", "words.csv"], "words.csv"),
        (["study.yaml", "--data", "strain.csv"], "elongation_strain"),
        (["study.yaml", "physics=pybullet"], "quasistatic"),
    ],
)
def test_wrong_input_is_one_message(call, tmp_path, arguments, said):
    (tmp_path / "words.csv").write_text("run,time_s,pressure_pa,angle_rad\na,0,zero,0.1\n")
    (tmp_path / "strain.csv").write_text("run,time_s,pressure_pa,elongation_strain\na,0,0,0.1\na,1,10,0.2\n")
    call(*arguments).refused(said)
