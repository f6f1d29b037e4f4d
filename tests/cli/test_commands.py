"""The verbs: results as JSON, exit codes, cached stages, interruption."""

import json
import math
import os
import signal
import subprocess
import sys

import pytest

from pliant.cli.verbs import VERBS


def test_simulate_prints_and_writes_the_contracts_keys(pliant, write, read, stated):
    call = pliant("simulate", write(stated), "--json", "out.json").done()
    found = read("out.json")
    assert (found["pliant"], found["command"]) == ("0.1.0", "simulate")
    keys = "tip_m markers_m joint_angles_rad converged residual wall_s outside_domain metrics"
    assert set(keys.split()) <= set(found)
    assert found["joint_angles_rad"] == pytest.approx([0.359718] * 8, abs=1e-6)
    assert found["tip_m"] == pytest.approx([0.059451, 0, -0.007889], abs=1e-6)
    assert len(found["markers_m"]) == 10
    assert "settled" in call.out
    alone = pliant("simulate", write(stated), "--json", "-")  # standard output contains nothing else
    assert json.loads(alone.out)["command"] == "simulate"


def test_quiet_says_nothing(pliant, write, stated):
    call = pliant("simulate", write(stated), "--quiet")
    assert (call.code, call.out, call.err) == (0, "", "")


@pytest.mark.parametrize("engine", ["quasistatic", "mujoco", "pybullet"])
def test_one_word_swaps_the_engine(pliant, write, read, stated, engine):
    if engine == "pybullet":
        pytest.importorskip("pybullet", reason="PyBullet has wheels up to Python 3.11 only")
    assert pliant("simulate", write(stated), f"physics.kind={engine}", "--json", "out.json").code == 0
    assert read("out.json")["tip_m"] == pytest.approx([0.059451, 0, -0.007889], abs=2e-6)


def test_a_second_run_recomputes_nothing_and_another_pressure_does(run_json, write, stated):
    study = write(stated)
    first, second = (run_json("run", study, "cross_check=[mujoco]") for _ in range(2))
    assert not first["simulate"]["stages"][0]["cached"]
    for engine in (second["simulate"], *second["cross_check"]):
        assert engine["stages"][0]["cached"]
    assert first["simulate"]["tip_m"] == second["simulate"]["tip_m"]
    assert not run_json("simulate", study, "task.pressure=12 kPa")["stages"][0]["cached"]


def test_run_leaves_a_folder_that_report_can_read_unless_it_is_damaged(pliant, write, workplace, stated):
    pliant("run", write(stated)).done()
    folder = workplace / "runs" / "stated"
    assert {"run.json", "study.json", "report.html", "data"} <= {p.name for p in folder.iterdir()}
    made = (folder / "report.html").read_text()
    (folder / "report.html").unlink()
    (workplace / ".pliant").rename(workplace / "elsewhere")
    pliant("report", folder).done()
    assert (folder / "report.html").read_text() == made
    (folder / "data/simulate0_quasistatic/arrays.npz").write_bytes(b"x")
    pliant("report", folder).refused("is damaged")


def test_what_no_stage_reads_is_said(pliant, write, stated):
    call = pliant("simulate", write(stated + "noise: {pressure: 0.5 kPa}\n"))
    assert call.code == 0
    assert "noise: read, but not used" in call.err


def test_an_effect_changes_the_answer(pliant, write, read, stated):
    study = write(stated + "effects: [{kind: pressure_offset, offset: -1 kPa}]\n")
    pliant("simulate", study, "--json", "less.json")
    pliant("simulate", study, "effects=[]", "task.pressure=14 kPa", "--json", "same.json")
    assert read("less.json")["tip_m"] == pytest.approx(read("same.json")["tip_m"], abs=1e-9)


def test_a_law_that_cannot_settle_exits_with_3(pliant, write, stated):
    unstable = stated.replace("b_e: 0.0245", "b_e: -0.5").replace("m_e: 0.1012", "m_e: 0")
    call = pliant("simulate", write(unstable))
    assert call.code == 3


def test_plugins_lists_kinds_and_schema_is_a_schema(pliant, read):
    call = pliant("plugins", "--json", "p.json")
    assert "bellow_bending" in call.out
    assert read("p.json")["failed"] == []
    assert json.loads(pliant("schema").out)["$schema"].startswith("https://json-schema.org")
    pliant("schema", "--json", "s.json", "--quiet")
    assert read("s.json")["schema"]["properties"]["physics"]["oneOf"]


def test_plugins_into_a_pipe_is_plain_text(pliant, monkeypatch):
    """A missing package is reported in words; rich's tags and escapes do not appear."""
    monkeypatch.setattr(
        "pliant.registry.component.Component.missing",
        lambda self, lazy=False: "optuna" if self.kind == "optuna" else None,
    )
    text = " ".join(pliant("plugins").out.split())
    assert "(unavailable: needs optuna: pip install 'pliant[search]')" in text
    assert "[yellow]" not in text
    assert "[/]" not in text
    assert "\\[" not in text


def test_check_runs_the_conformance_suite(pliant, read):
    pliant("check", "material", "neo_hookean", "--json", "c.json").done()
    assert read("c.json")["failed"] == 0
    assert read("c.json")["passed"] >= 5


@pytest.mark.parametrize(
    "verb", [verb for verb in VERBS if verb not in ("view", "app")]
)  # these verbs open a window
def test_every_verb_has_help(pliant, verb):
    assert pliant("--version").out.strip() == "pliant 0.1.0"
    for option in ("-h", "--help"):
        assert "--json" in pliant(verb, option).done().out


BENCH = """\
name: bench
surrogate: {kind: polynomial, data: bench.csv}
chain: {modules: 3, module_length: 11 mm, gravity: [0, 0, 0]}
task: {kind: free_bending, pressure: 10 kPa}
"""


def bench_table(folder, sign=1.0):
    """Return states of the worked law in the format of a bench's table."""
    lines = ["pressure_pa,angle_rad,moment_n_m"]
    for pressure in range(0, 15001, 3000):
        for u in (-0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4):
            moment = 1.637e-6 * pressure - 1.704e-6 * pressure * u - (0.1012 * u * abs(u) / 2 + 0.0245 * u)
            lines.append(f"{pressure},{u},{sign * moment!r}")
    (folder / "bench.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.parametrize(("sign", "stable"), [(1.0, True), (-1.0, False)])
def test_a_table_with_reversed_moments_is_noticed(pliant, write, read, workplace, sign, stable):
    bench_table(workplace, sign)
    call = pliant("fit", write(BENCH), "--json", "out.json").done()
    assert read("out.json")["stable"] is stable
    assert ("is the sign reversed?" in call.out) is not stable


@pytest.mark.parametrize("slow", ["pydantic", "typer", "rich"])
def test_ctrl_c_while_still_importing(tmp_path, slow):
    """Importing takes a third of a second; an interrupt during it gives no traceback either."""
    (tmp_path / f"{slow}.py").write_text(f"import os, signal\nos.kill(os.getpid(), {int(signal.SIGINT)})\n")
    call = subprocess.run(
        [sys.executable, "-m", "pliant", "plugins"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (call.returncode, call.stdout) == (130, "")
    assert call.stderr == "interrupted before anything began.\n"


def test_a_home_folder_in_the_stores_variable(pliant, write, workplace, stated, monkeypatch):
    monkeypatch.setenv("HOME", str(workplace / "home"))
    monkeypatch.setenv("PLIANT_STORE", "~/cache")
    assert pliant("simulate", write(stated), "--quiet").code == 0
    assert (workplace / "home" / "cache" / "simulate").is_dir()
    assert not (workplace / "~").exists()


FAR = """\
pliant: 1
name: far
surrogate:
  kind: polynomial
  form: study
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 1, module_length: 11 mm, module_mass: 9 g, gravity: [0, 0, 0]}
task: {kind: free_bending, pressure: -10 kPa}
"""


def test_what_did_not_settle_shows_the_last_state_that_held(pliant, write, read) -> None:
    """Newton's last step is at hundreds of radians; the terminal and the metrics report the level before it."""
    call = pliant("simulate", write(FAR, "far.yaml"), "--json", "out.json").done(3)
    found = read("out.json")
    assert not found["converged"] and abs(found["joint_angles_rad"][0]) > 10
    (held,) = found["last_held"]["joint_angles_rad"][0]
    assert found["metrics"]["bend_angle_rad"] == held and -0.3 < held < 0
    assert found["last_held"]["actuation"] == [-1000.0]
    assert "NOT CONVERGED" in call.out and "of the last state that held" in call.out
    assert f"in the last state that held it bends −{-math.degrees(held):.1f}°" in call.out
    assert f"{found['joint_angles_rad'][0]:.6g}" not in call.out


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (["task.payload=10 g"], ["weighs nothing"]),
        (["task.payload=10"], ["weighs nothing", "10 kg on a chain of 9 g: is it 10 g?"]),
        (["task.payload=10", "chain.gravity=[0, 0, -9.81]"], ["is it 10 g?"]),
        (["task.payload=10 g", "chain.gravity=[0, 0, -9.81]"], []),
        (["chain.payload=10 g"], ["weighs nothing"]),
    ],
)
def test_a_payload_that_weighs_nothing_or_far_too_much_is_asked_about(
    pliant, write, read, changes, says
) -> None:
    loaded = ("task.kind=tip_load", "task.pressure=2 kPa", *changes)
    call = pliant("simulate", write(FAR, "far.yaml"), *loaded, "--json", "out.json").done()
    remarks = [one for one in read("out.json")["remarks"] if "payload" in one and "turn the tip" not in one]
    assert len(remarks) == len(says)
    assert all(word in remark and remark in call.out for word, remark in zip(says, remarks, strict=True))
