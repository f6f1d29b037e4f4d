"""Each fault of a model's file or of its recording is one sentence with exit code 2, and writes nothing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.pliant_systems.hinge import MODEL, write_bench
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.errors import UserError
from pliant.interfaces.model import Channel
from pliant.measurements.system_reading import read_system_measurement


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return write_bench(tmp_path, n=20)


def refused(study: Path, *says: str, verb: str = "compare", code: int = 2) -> None:
    """Require this exit code and these words, without a traceback and without a report."""
    out = study.parent / "out"
    done = CliRunner().invoke(
        app, [verb, str(study), "--out", str(out), "--store", str(study.parent / "store")]
    )
    text = " ".join(done.output.split())
    assert done.exit_code == code, text
    for words in says:
        assert words in text, text
    assert "Traceback" not in text
    assert not list(out.rglob("*.html"))


def changed(study: Path, pattern: str, new: str) -> None:
    text, n = re.subn(pattern, lambda match: new, MODEL, count=1, flags=re.S)
    assert n == 1
    (study.parent / "hinge.py").write_text(text)


def test_no_file(study: Path) -> None:
    (study.parent / "hinge.py").unlink()
    refused(study, "hinge.py: no such file")


def test_not_python(study: Path) -> None:
    (study.parent / "hinge.py").write_text("INPUTS = (\n")
    refused(study, "hinge.py, line 1: this is not Python")


def test_raises_when_it_is_loaded(study: Path) -> None:
    (study.parent / "hinge.py").write_text("x = 1\nraise OSError('no licence')\n")
    refused(study, "hinge.py, line 2: the file fails when it is loaded (OSError: no licence)")


@pytest.mark.parametrize(
    ("pattern", "new", "says"),
    [
        (r"INPUTS = [^\n]*", "", "the model has no INPUTS; it needs INPUTS, OUTPUTS and simulate"),
        (r"OUTPUTS = [^\n]*", "", "the model has no OUTPUTS"),
        (r"def simulate", "def other", "the model has no simulate"),
        (r"def simulate.*", "simulate = 3", "simulate is 3, no function"),
        (r"INPUTS = [^\n]*", "INPUTS = 'torque_n_m'", "INPUTS is 'torque_n_m'; write a tuple of names"),
        (r"INPUTS = [^\n]*", "INPUTS = ()", "INPUTS is (); write a tuple of names"),
        (r"INPUTS = [^\n]*", "INPUTS = ('time_s',)", "INPUTS has 'time_s', which cannot be a channel's name"),
        (
            r"INPUTS = [^\n]*",
            "INPUTS = {'torque_n_m': 3}",
            "INPUTS['torque_n_m'] is 3; write (lowest, highest)",
        ),
        (r"INPUTS = [^\n]*", "INPUTS = {'torque_n_m': (2, -2)}", "is (2, -2); write (lowest, highest)"),
        (r"OUTPUTS = [^\n]*", "OUTPUTS = ('torque_n_m',)", "'torque_n_m' is in INPUTS and in OUTPUTS"),
        (r"OUTPUTS = [^\n]*", "OUTPUTS = ('angle_rad', 'angle_rad')", "OUTPUTS has 'angle_rad' twice"),
        (r"PARAMETERS = [^\n]*", "PARAMETERS = 3", "PARAMETERS is 3; write a dict of names"),
        (
            r"MISSING = [^\n]*",
            "MISSING = {'coulomb': 0.1}",
            "MISSING['coulomb'] is 0.1; write (value, lowest",
        ),
        (
            r"MISSING = [^\n]*",
            "MISSING = {'coulomb': (0, 1)}",
            "MISSING['coulomb'] is (0, 1); write (value, lowest",
        ),
        (
            r"MISSING = [^\n]*",
            "MISSING = {'coulomb': (0, 2, 1)}",
            "is (0, 2, 1); write (value, lowest plausible",
        ),
        (
            r"MISSING = [^\n]*",
            "MISSING = {'coulomb': (0, 0, float('nan'))}",
            "write (value, lowest plausible",
        ),
        (r"MISSING = [^\n]*", "MISSING = {'coulomb': (0, 0, 'x')}", "write (value, lowest plausible"),
        (r"MISSING = [^\n]*", "MISSING = {'coulomb': (0, 0, 1, 2)}", "write (value, lowest plausible"),
        (
            r"MISSING = [^\n]*",
            "MISSING = {'damping': (0, 0, 1)}",
            "'damping' is in PARAMETERS and in MISSING",
        ),
        (
            r"MISSING = ",
            "DERIVATIVES = 'numpy'\nMISSING = ",
            "DERIVATIVES is 'numpy'; write 'jax' or 'torch'",
        ),
    ],
)
def test_wrong_entries(study: Path, pattern: str, new: str, says: str) -> None:
    changed(study, pattern, new)
    refused(study, says, verb="diagnose")


RETURN = r"    return \{.*"


@pytest.mark.parametrize(
    ("pattern", "new", "says"),
    [
        (r"    k, c, f", "    1 / 0\n    k, c, f", "line 11: simulate fails in run 'r0' (ZeroDivisionError"),
        (r"    k, c, f", "    raise SystemExit(0)\n    k, c, f", "simulate fails in run 'r0' (SystemExit"),
        (RETURN, "    return [1.0]", "simulate returns a list; return a dict of arrays by output"),
        (RETURN, "    pass", "simulate returns None; return a dict"),
        (
            RETURN,
            "    return {'angle': found[:, 0]}",
            "simulate returns no 'angle_rad', which OUTPUTS has; it returns",
        ),
        (RETURN, "    return {'angle_rad': found[:, 0]}", "simulate returns no 'speed_rad_s'"),
        (
            RETURN,
            "    return {'angle_rad': found, 'speed_rad_s': found[:, 1]}",
            "'angle_rad' of shape (20, 2)",
        ),
        (
            RETURN,
            "    return {'angle_rad': 'x', 'speed_rad_s': 0}",
            "'angle_rad' as a str that is no array of numbers",
        ),
        (r"time_s, inputs, parameters\)", "time_s, inputs)", "simulate fails in run 'r0' (TypeError"),
    ],
)
def test_wrong_answers(study: Path, pattern: str, new: str, says: str) -> None:
    changed(study, pattern, new)
    refused(study, says, verb="diagnose")


def test_readings_that_are_never_finite(study: Path) -> None:
    changed(study, RETURN, "    return {'angle_rad': found[:, 0] * np.nan, 'speed_rad_s': found[:, 1]}")
    refused(
        study, "the model has no finite reading in any measured run", "Simulate one run with the model alone"
    )


def test_a_unit_in_a_column_of_a_channel_without_one(tmp_path: Path) -> None:
    (tmp_path / "bench.csv").write_text("time_s,pull_n,angle_rad\n0,1,0.1\n1,2,0.2\n")
    with pytest.raises(
        UserError, match=r"'pull', an input of the model, has no known unit.*'rename: {pull_n: pull}'"
    ):
        read_system_measurement(
            tmp_path / "bench.csv", None, [Channel("pull")], [Channel("angle_rad", "rad")]
        )


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_readings_that_are_finite_at_the_beginning_only(study: Path, verb: str) -> None:
    late = "    found[5:] = np.nan\n    return {'angle_rad': found[:, 0], 'speed_rad_s': found[:, 1]}"
    changed(study, RETURN, late)
    refused(study, "no finite reading in", "it diverges there, or returns NaN", verb=verb)


def test_a_shape_that_changes_with_a_parameter_is_named(study: Path) -> None:
    """The effect is left out with the reason, the others are judged."""
    short = "    short = found[: 20 - int(k != 2.0)]\n    return {'angle_rad': short[:, 0], 'speed_rad_s': short[:, 1]}"
    changed(study, RETURN, short)
    arguments = [
        "diagnose",
        str(study),
        "--out",
        str(study.parent / "out"),
        "--store",
        str(study.parent / "store"),
    ]
    done = CliRunner().invoke(app, [*arguments, "--effect", "parameter@stiffness", "--effect", "supply_lag"])
    text = " ".join(done.output.split())
    assert done.exit_code == 0, text
    assert "'parameter@stiffness' was left out" in text
    assert "'angle_rad' of shape (19,) in run 'r0', which has 20 samples" in text


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("torque_n_m", "moment_x", "no column is 'torque_n_m', input 'torque_n_m' of the model"),
        ("angle_rad", "bend", "no column is an output of the model, which has angle_rad, speed_rad_s"),
        ("time_s", "clock", "no column is 'time_s', the clock of the model"),
        ("r0,0.040,", "r0,0.010,", "line 4: the time of run 'r0' does not increase; sort its rows"),
        (
            "\nr1,0.000,",
            "\nr1,0.000,9",
            "'torque_n_m' is 9",
        ),
    ],
)
def test_wrong_recordings(study: Path, old: str, new: str, says: str) -> None:
    file = study.parent / "bench.csv"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    refused(study, says)


def test_a_short_row(study: Path) -> None:
    file = study.parent / "bench.csv"
    rows = file.read_text().split("\n")
    rows[5] = ",".join(rows[5].split(",")[:2])
    file.write_text("\n".join(rows))
    refused(study, "line 6", "2 cells")


def test_an_input_without_a_value(study: Path) -> None:
    file = study.parent / "bench.csv"
    rows = file.read_text().split("\n")
    run, clock, _, angle = rows[5].split(",")
    rows[5] = f"{run},{clock},,{angle}"
    file.write_text("\n".join(rows))
    refused(study, "line 6: input 'torque_n_m' has no value there")


@pytest.mark.parametrize(
    ("effect", "says"),
    [
        ("{kind: parameter@stifness, value: 3}", "PARAMETERS has no 'stifness'; did you mean 'stiffness'"),
        ("{kind: state@damping, value: 3}", "MISSING has no 'damping'"),
        ("{kind: actuation_gain@voltage, factor: 1.1}", "acts on no input: the model has torque_n_m"),
        ("{kind: misaligned_frame}", "turns vectors, and no output is one of x, y and z"),
        ("{kind: stiffness, factor: 1.1}", "stiffness"),
    ],
)
def test_wrong_effects_of_a_study(study: Path, effect: str, says: str) -> None:
    study.write_text(study.read_text() + f"effects: [{effect}]\n")
    refused(study, says)


def test_blocks_of_a_chain(study: Path) -> None:
    study.write_text(study.read_text() + "physics: quasistatic\n")
    refused(study, "'model' stands for the whole robot; leave out physics")
