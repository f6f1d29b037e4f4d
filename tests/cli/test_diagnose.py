"""`pliant diagnose`: text, JSON, candidates, wrong input."""

from __future__ import annotations

import pytest
from tests.cli.joint_study import JOINT as STUDY
from tests.diagnosis.quick import effect, joint, measured, rich
from tests.plugins.test_own_file import EFFECT

from pliant.measurements.writing import write_measurement

FEW = ("--effect", "stiffness", "--effect", "sensor_bias", "--effect", "supply_lag")


@pytest.fixture
def bench(write, workplace):
    """Return a study and data with a hidden sensor bias."""
    write_measurement(measured(joint(), rich(), effect("sensor_bias"), seed=1), workplace / "bench.csv")
    return write(STUDY)


def test_the_missing_effect_is_named_and_written(pliant, bench, read, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    call = pliant("diagnose", bench, "--data", "bench.csv", "--json", "out.json", *FEW).done()
    assert "Missing: sensor_bias." in call.out
    first, *lines = call.out.splitlines()
    assert first.startswith(
        "note: At rest the recording and the model disagree (12 runs): bend angle is read as 1.7°"
    )
    assert lines[-2].startswith("A value in the file is probably wrong")
    end = next(k for k, line in enumerate(lines) if line.startswith("sensor_bias: bias"))
    assert max(map(len, lines[: end + 1])) <= 80  # parameters are printed below the table
    assert lines[0].split() == ["hypothesis", "probability", "left-out", "error", "/", "floor"]
    assert "°" in lines[end] and "rad" not in lines[end]
    assert lines[-1].split() == ["report", "runs/joint-diagnose/report.html"]
    found = read("out.json")
    assert (found["verdict"], found["selected"]) == ("missing_effect", ["sensor_bias"])
    assert sum(h["probability"] for h in found["hypotheses"]) == pytest.approx(1.0)
    best = found["hypotheses"][0]
    assert best["kinds"] == ["sensor_bias"]
    bias = best["parameters"]["sensor_bias.bias_rad"]
    assert bias["value"] == pytest.approx(0.03, abs=0.003)
    assert bias["unit"] == best["heldout"]["angle_rad"]["unit"] == "rad"
    assert {"credible_set", "not_excited", "indistinguishable", "covariates", "next_experiment"} <= set(found)
    assert {entry["kind"] for entry in found["smallest_detectable"]} <= set(FEW)


def test_what_is_asked_again_is_answered_from_the_store(pliant, bench, read, monkeypatch, workplace) -> None:
    asked = ("diagnose", bench, "--data", "bench.csv", "--json", "out.json", *FEW)
    first = pliant(*asked).done()
    found, page = read("out.json"), (workplace / "runs/joint-diagnose/report.html").read_text("utf-8")

    def computed(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr("pliant.api.diagnose_with", computed)
    again = pliant(*asked).done()
    assert again.out == first.out
    assert read("out.json") == found
    assert (workplace / "runs/joint-diagnose/report.html").read_text("utf-8") == page
    with pytest.raises(AssertionError, match="computed again"):  # other candidates need a new computation
        pliant(*asked, "--effect", "backlash")
    with pytest.raises(AssertionError, match="computed again"):  # other readings need one too
        text = (workplace / "bench.csv").read_text("utf-8").splitlines()
        (workplace / "bench.csv").write_text("\n".join(text[:-1]) + "\n", "utf-8")
        pliant(*asked)


@pytest.mark.slow
def test_effects_in_the_study_are_part_in_the_model(pliant, bench, read) -> None:
    known = 'effects=[{"kind": "sensor_bias", "bias_rad": 0.03}]'
    assert pliant("diagnose", bench, known, "--data", "bench.csv", "--json", "out.json", *FEW).code == 0
    assert read("out.json")["verdict"] == "nothing_missing"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--data", "none.csv"), "none.csv"),
        ((), "names no measurements"),
        (("physics=pybullet", "--data", "bench.csv"), "quasistatic"),
        (("--data", "bench.csv", "--effect", "sensor_bais"), "did you mean 'sensor_bias'"),
    ],
)
def test_wrong_input_is_a_sentence(pliant, bench, arguments, says) -> None:
    pliant("diagnose", bench, *arguments).refused(says)


def test_ctrl_c_inside_compiled_code_is_an_interrupt(pliant, bench, monkeypatch) -> None:
    def stopped(*_: object, **__: object) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as interrupt:  # the values that numba computes
            raise SystemError("returned a result with an exception set") from interrupt

    monkeypatch.setattr("pliant.api.diagnose_with", stopped)
    call = pliant("diagnose", bench, "--data", "bench.csv", "--json", "out.json", *FEW).done(130)
    assert "interrupted" in call.err and "Traceback" not in call.err
    assert not (bench.parent / "out.json").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong", "says"),
    [
        ("1.0 + parameters[0] *", "1.0 / (angle - angle) *", "'rise' was left out: "),
        ("parameters[0]", "parameter[0]", "'rise' was left out: "),
    ],
)
def test_a_mistake_in_a_users_effect_is_reported_and_the_others_are_judged(
    pliant, bench, workplace, right, wrong, says
) -> None:
    assert EFFECT.count(right) == 1
    (workplace / "own.py").write_text(EFFECT.replace(right, wrong))
    bench.write_text(bench.read_text() + "plugins: [own.py]\n")
    call = pliant("diagnose", bench, "--data", "bench.csv", "--effect", "rise", *FEW).done()
    assert says in call.out
    assert "Missing: sensor_bias." in call.out
    assert "Traceback" not in call.err


def test_a_parameter_declared_wrongly_is_named_with_its_line(pliant, bench, workplace) -> None:
    assert EFFECT.count("(0.5, 5.0)") == 1
    (workplace / "own.py").write_text(EFFECT.replace("(0.5, 5.0)", "(0.5, 500.0)"))
    bench.write_text(bench.read_text() + "plugins: [own.py]\n")
    pliant("diagnose", bench, "--data", "bench.csv", "--effect", "rise", *FEW).refused(
        "own.py, line 9", "RiseConfig.rise: plausible"
    )


@pytest.mark.slow
def test_effects_that_one_joint_cannot_have_take_one_line(pliant, bench) -> None:
    asked = pliant("diagnose", bench, "--data", "bench.csv", *FEW, "--effect", "inter_module_compliance")
    assert "'inter_module_compliance' was left out:" in " ".join(asked.out.split())
    out = pliant("diagnose", bench, "--data", "bench.csv").out
    assert "was left out:" not in out
    line = next(line for line in out.splitlines() if "cannot have" in line)
    assert "inter_module_compliance" in line and "sensor_bias" not in line
