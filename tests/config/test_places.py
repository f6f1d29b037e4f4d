"""Messages after a study was read name the file and line of the value, whichever study it comes from."""

from pathlib import Path

import pytest

from pliant.config.loading import load_study
from pliant.config.places import Places
from pliant.errors import UserError
from pliant.measurements.files import read_measurements
from pliant.registry.discovery import discover

BASE = """\
pliant: 1
name: base
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 3.5e-5, m_a: 0, m_e: 0, b_e: 1}}
chain: {modules: 1, module_length: 80 mm, gravity: [0, 0, 0]}
measurements:
  file: bench.csv
  rename: {tip angle: angle_rad}
"""
OWN = "pliant: 1\nname: own\nextends: base.yaml\n"
TABLE = "time_s,pressure_kpa,tip angle [deg]\n0,0,0\n1,5,10\n2,10,20\n3,5,11\n4,0,1\n"


def message(folder: Path, base: str, own: str = "", override: str = "") -> str:
    """Return the message from reading the recording of a study that extends another; bench.yaml is a third study."""
    (folder / "bench.csv").write_text(TABLE)
    (folder / "base.yaml").write_text(BASE + base)
    (folder / "own.yaml").write_text(OWN + own)
    (folder / "bench.yaml").write_text(BASE.replace("name: base", "name: bench"))
    study = load_study(folder / "own.yaml", discover(), [override] if override else [])
    assert study.measurements is not None
    assert isinstance(study.measurements.file, str)
    with pytest.raises(UserError) as error:
        read_measurements(folder / study.measurements.file, study.measurements)
    return str(error.value)


@pytest.mark.parametrize(
    ("key", "problem"),
    [
        ("sigma: {tipangle: 0.3 deg}", "'sigma' has 'tipangle'"),
        ("sigma: {tip angle: 3 mm}", "'3 mm' is a length"),
        ("zero: {foo: 1 deg}", "'zero' has 'foo'"),
        ("zero: {tip angle: 1 kPa}", "'zero' of 'tip angle [deg]'"),
        ("units: {tip angle: kPa}", "the unit 'kPa' is a pressure"),
        ("exclude: [{run: b}]", "'exclude' names run 'b'"),
        ("cycles: {of: foo, low: 1 Pa, high: 2 Pa}", "'cycles' are of 'foo'"),
        ("let_go: foo", "'let_go' names run 'foo'"),
        ("runs: {bench: {payloadx: 1 g}}", "'runs' of 'bench' has 'payloadx'"),
        ("name_pattern: 'bench_{foo}'", "'name_pattern' has '{foo}'"),
        ("outputs: [tip_x_m]", "asks for output 'tip_x_m'"),
        ("marker_offsets: [[0, 0, 1 mm]]\n  markers: [1 mm, 2 mm]", "'marker_offsets' has 1 entries"),
    ],
)
def test_the_file_and_line_for_a_recordings_note(tmp_path: Path, key: str, problem: str):
    of_base = message(tmp_path, f"  {key}\n")
    assert problem in of_base and of_base.startswith(f"{tmp_path / 'base.yaml'}, line 8: "), of_base
    of_own = message(tmp_path, "", f"measurements:\n  {key}\n")
    assert problem in of_own and of_own.startswith(f"{tmp_path / 'own.yaml'}, line 5: "), of_own
    if ":" in key and "\n" not in key:
        name, _, value = key.partition(": ")
        over = message(tmp_path, "", "", f"measurements.{name}={value}")
        assert problem in over and over.startswith("override measurements."), over


def test_an_override_for_a_key_that_a_file_has_is_the_override(tmp_path: Path):
    text = message(tmp_path, "  sigma: {tip angle: 1 deg}\n", "", "measurements.sigma={tip angle: 3 mm}")
    assert text.startswith("override measurements.sigma=")


def test_advice_names_the_study_that_was_read(tmp_path: Path):
    text = message(tmp_path, "", "measurements: {rename: {tip angle: foo}}\n")
    assert "bench.yaml" not in text and text.startswith(f"{tmp_path / 'own.yaml'}, line 4: ")


@pytest.mark.parametrize("file", ["nix.csv", "x*.csv"])
def test_a_recording_that_is_not_there_is_named_with_the_line_that_names_it(tmp_path: Path, file: str):
    text = message(tmp_path, "", f"measurements: {{file: '{file}'}}\n")
    assert text.startswith(f"{tmp_path / 'own.yaml'}, line 4: {tmp_path / file}: "), text


def test_a_key_in_a_message_gets_its_place_where_several_files_hold_keys():
    places = Places(
        {
            ("chain",): "base.yaml, line 4",
            ("chain", "actuators"): "base.yaml, line 7",
            ("effects",): "own.yaml, line 4",
        }
    )
    assert places.located("chain.actuators names x.") == "base.yaml, line 7: chain.actuators names x."
    assert places.located("leave it out of 'effects'.") == "own.yaml, line 4: leave it out of 'effects'."
    assert places.located("own.yaml, line 9: 'effects' …") == "own.yaml, line 9: 'effects' …"
    listed = Places({**places.of_keys, ("protocols",): "base.yaml, line 9"})
    assert listed.located("protocols[0]: '5 N' is a force.").startswith("base.yaml, line 9: protocols[0]")
    assert places.located("nothing is named") == "nothing is named"
    alone = Places({("chain", "actuators"): "base.yaml, line 7"})
    assert alone.located("chain.actuators names x.") == "chain.actuators names x."
