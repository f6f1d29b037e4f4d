"""The bench's file: written, filled in, read back with the old one."""

from __future__ import annotations

import csv
import shlex
from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import effect, joint, make_predictor, measured, poor, rich

from pliant.config.measurements import MeasurementsConfig
from pliant.errors import UserError
from pliant.experiments.experiment_catalogue import timed_catalogue
from pliant.experiments.planned_run import BenchScale, named_run
from pliant.experiments.protocol_file import write_protocol
from pliant.measurements.files import together
from pliant.measurements.reading import read_measurement
from pliant.measurements.writing import write_measurement

CHAIN = joint()


@pytest.fixture
def old():
    return replace(measured(CHAIN, poor(), effect("stiffness")), source="old.csv")


def filled(path, outputs, value=0.25) -> None:
    """Write a number into every blank reading, as a bench would."""
    lines = path.read_text().splitlines()
    comments = [line for line in lines if line.startswith("#")]
    table = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    for row in table:
        row.update(dict.fromkeys(outputs, str(value)))
    with path.open("w") as file:
        file.write("\n".join(comments) + "\n")
        writer = csv.DictWriter(file, list(table[0]))
        writer.writeheader()
        writer.writerows(table)


@pytest.mark.parametrize("name", [run.name for run in timed_catalogue(BenchScale.from_chain(CHAIN, 15e3))])
def test_what_was_ordered_is_what_is_read_back(tmp_path, old, name) -> None:
    run = named_run(timed_catalogue(BenchScale.from_measurement(CHAIN, old)), name)
    path = tmp_path / "next_run.csv"
    write_protocol(path, run, old.outputs, measurement=old)
    filled(path, (*old.outputs, *run.adds))
    (back,) = read_measurement(path).runs
    history, ordered = back.history, run.history
    assert back.name == name
    assert history.specimen == ordered.specimen
    np.testing.assert_allclose(history.time_s, ordered.time_s, atol=1e-6)
    for key in ("moment_n_m", "tip_force_n", "temperature_c", "base_angles_rad"):
        np.testing.assert_allclose(getattr(history, key), getattr(ordered, key), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(history.actuation["pressure_pa"], ordered.actuation["pressure_pa"], rtol=1e-6)
    assert (history.valve_open is None) == (ordered.valve_open is None)
    assert set(back.outputs) == {*old.outputs, *run.adds}


def test_the_order_stands_above_the_table(tmp_path, old) -> None:
    run = named_run(timed_catalogue(BenchScale.from_measurement(CHAIN, old)), "warm")
    write_protocol(tmp_path / "n.csv", run, old.outputs, measurement=old, study="finger.yaml")
    text = (tmp_path / "n.csv").read_text()
    assert "15 K warmer" in text and "Temperature 37 °C" in text and "needs a warm chamber" in text
    assert f"pliant diagnose finger.yaml --data old.csv --data {tmp_path / 'n.csv'}" in text


def test_the_way_on_names_every_file_as_it_is_typed(tmp_path, old) -> None:
    run = named_run(timed_catalogue(BenchScale.from_measurement(CHAIN, old)), "warm")
    data = ("bench/a.csv", "bench/two words.csv")
    write_protocol(tmp_path / "n.csv", run, old.outputs, measurement=old, study="finger.yaml", data=data)
    said = next(line for line in (tmp_path / "n.csv").read_text().splitlines() if "Then:" in line)
    words = shlex.split(said.partition("Then: ")[2])
    assert words == [
        "pliant",
        "diagnose",
        "finger.yaml",
        *(w for d in (*data, tmp_path / "n.csv") for w in ("--data", str(d))),
    ]


def test_names_that_are_taken_are_not_given_again(tmp_path, old) -> None:
    runs = timed_catalogue(BenchScale.from_measurement(CHAIN, old))
    taken = [old.runs[0].history.with_(run="virgin", specimen="new"), *(r.history for r in old.runs[1:])]
    before = replace(old, runs=tuple(replace(r, history=h) for r, h in zip(old.runs, taken, strict=True)))
    write_protocol(tmp_path / "n.csv", named_run(runs, "virgin"), old.outputs, measurement=before)
    filled(tmp_path / "n.csv", old.outputs)
    (back,) = read_measurement(tmp_path / "n.csv").runs
    assert (back.name, back.history.specimen) == ("virgin 2", "new 2")


def test_a_study_that_renames_columns_and_units_reads_the_new_file_as_the_old_one(tmp_path, old) -> None:
    settings = MeasurementsConfig(
        file="x.csv", rename={"bend": "angle_rad", "p": "pressure_pa"}, units={"bend": "deg", "p": "kPa"}
    )
    run = named_run(timed_catalogue(BenchScale.from_measurement(CHAIN, old)), "holds")
    path = tmp_path / "n.csv"
    write_protocol(path, run, old.outputs, measurement=old, notes=settings)
    assert ",p," in path.read_text()
    filled(path, ["bend"], 90.0)
    (back,) = read_measurement(path, settings=settings).runs
    np.testing.assert_allclose(
        back.history.actuation["pressure_pa"], run.history.actuation["pressure_pa"], rtol=1e-6
    )
    np.testing.assert_allclose(back.outputs["angle_rad"], np.pi / 2)


HEADED = {
    "time_s": ("Zeit [ms]", "ms"),
    "pressure_pa": ("pressure_mbar", "mbar"),
    "angle_rad": ("Angle (deg)", "deg"),
}


def in_its_own_units(measurement):
    """Return the measurement as if its file had been in ms, mbar and degrees."""
    written = {name: unit for name, (_, unit) in HEADED.items()}
    headed = {name: heading for name, (heading, _) in HEADED.items()}
    return replace(measurement, written=written, headed=headed)


@pytest.mark.parametrize("name", ["slow_cycles", "load_steps", "base_on_its_side", "second_sensor"])
def test_the_file_is_in_the_old_units_and_read_again(tmp_path, old, name) -> None:
    runs = timed_catalogue(BenchScale.from_measurement(CHAIN, old))
    run = next((run for run in runs if run.name == name), runs[0])
    path = tmp_path / "n.csv"
    write_protocol(path, run, old.outputs, measurement=in_its_own_units(old))
    text = path.read_text()
    header = next(line for line in text.splitlines() if not line.startswith("#"))
    assert {"Zeit [ms]", "pressure_mbar", "Angle (deg)"} <= set(header.split(","))
    assert "Read Angle (deg)" in text and not any(name in header for name in HEADED)
    filled(path, ["Angle (deg)"], 90.0)
    (back,) = read_measurement(path).runs
    np.testing.assert_allclose(back.history.time_s, run.history.time_s, atol=1e-6)
    np.testing.assert_allclose(
        back.history.actuation["pressure_pa"], run.history.actuation["pressure_pa"], rtol=1e-6
    )
    np.testing.assert_allclose(back.history.base_angles_rad, run.history.base_angles_rad, rtol=1e-6)
    np.testing.assert_allclose(back.outputs["angle_rad"], np.pi / 2)


def test_headings_that_the_study_renames_are_kept(tmp_path, old) -> None:
    settings = MeasurementsConfig(file="x.csv", rename={"Zeit [ms]": "time_s"}, units={"Zeit [ms]": "ms"})
    run = timed_catalogue(BenchScale.from_measurement(CHAIN, old))[0]
    write_protocol(tmp_path / "n.csv", run, old.outputs, measurement=in_its_own_units(old), notes=settings)
    filled(tmp_path / "n.csv", ["Angle (deg)"])
    (back,) = read_measurement(tmp_path / "n.csv", settings=settings).runs
    assert "Zeit [ms]" in (tmp_path / "n.csv").read_text()
    np.testing.assert_allclose(back.history.time_s, run.history.time_s, atol=1e-6)


def test_a_folder_that_is_not_there_is_a_sentence(tmp_path, old) -> None:
    run = timed_catalogue(BenchScale.from_measurement(CHAIN, old))[0]
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        write_protocol(blocked / "n.csv", run, old.outputs)


def test_files_are_one_measurement_in_their_order() -> None:
    first = replace(measured(CHAIN, rich(1), effect("mullins")), source="a.csv")
    second = replace(measured(CHAIN, poor(1), outputs=("angle_rad", "tip_x_m")), source="b.csv")
    found = together([first, second])
    assert found.source == "a.csv + b.csv"
    assert found.outputs == ("angle_rad", "tip_x_m")
    assert len(found.runs) == len(first.runs) + 1
    assert np.isnan(found.runs[0].outputs["tip_x_m"]).all()
    names = [run.name for run in found.runs]
    assert names[-1] == "b slow0" and len(set(names)) == len(names)
    readings = make_predictor(CHAIN, found).predict()
    np.testing.assert_allclose(
        readings[-1]["angle_rad"], make_predictor(CHAIN, second).predict()[0]["angle_rad"], rtol=1e-9
    )


def test_files_with_other_inputs_are_refused(tmp_path) -> None:
    first = replace(measured(CHAIN, poor()), source="a.csv")
    opposed = [
        run.history.with_(actuation={"pressure_1_pa": run.history.actuation["pressure_pa"]})
        for run in first.runs
    ]
    other = replace(
        first,
        source="b.csv",
        runs=tuple(replace(r, history=h) for r, h in zip(first.runs, opposed, strict=True)),
    )
    with pytest.raises(UserError, match="need the same inputs"):
        together([first, other])
    arms = (replace(first, marker_arms_m=(0.1,)), replace(first, source="c.csv", marker_arms_m=(0.2,)))
    with pytest.raises(UserError, match="same 'markers'"):
        together(arms)
    write_measurement(first, tmp_path / "a.csv")
    one = read_measurement(tmp_path / "a.csv")
    assert together([one]) is one
