"""`pliant plan`, and the file of the next run that `pliant diagnose` writes."""

from __future__ import annotations

import pytest
from tests.cli.joint_study import JOINT as STUDY
from tests.diagnosis.quick import effect, joint, measured, ramp
from tests.experiments.test_protocol_file import filled

from pliant.measurements.writing import write_measurement

TASK = "task: {kind: free_bending, pressure: 15 kPa}\n"
OWN = """\
protocols:
  - {run: passive_load_steps, load: 4 mN*m, minutes: 7}
  - {run: slow_cycles, period: 40 s}
"""
FEW = ("--effect", "stiffness", "--effect", "actuation_gain", "--effect", "supply_lag")


@pytest.fixture
def bench(write, workplace):
    """Return a study, and data of a sweep that cannot distinguish a stiffness from a gain."""
    histories = [ramp(f"slow{k}", 500.0, 1.0, (6e3, 0.0)) for k in range(2)]
    write_measurement(measured(joint(), histories, effect("stiffness"), seed=4), workplace / "bench.csv")
    return write(STUDY)


def test_after_data_the_runs_that_decide_are_written(pliant, bench, read, workplace) -> None:
    call = pliant("plan", bench, "--data", "bench.csv", "--out", "plan", "--json", "out.json", *FEW).done()
    found = read("out.json")
    assert found["command"] == "plan"
    assert found["verdict"] == "ambiguous"
    assert 1 <= len(found["runs"]) <= 2
    first = found["runs"][0]
    assert {"run", "name", "why", "separates", "minutes", "expected", "ranked", "file"} == set(first)
    assert [["stiffness"], ["actuation_gain"]] in first["separates"] or [
        ["actuation_gain"],
        ["stiffness"],
    ] in first["separates"]
    assert first["name"] in call.out and "questions a minute" in call.out
    for run in found["runs"]:
        assert (workplace / run["file"]).read_text().startswith(f"# Run '{run['name']}'")


@pytest.mark.slow
def test_the_file_for_diagnose_is_filled_in_and_read_with_the_old_one(pliant, bench, read, workplace) -> None:
    pliant("diagnose", bench, "--data", "bench.csv", "--out", "out", "--json", "out.json", *FEW).done()
    proposed = read("out.json")["next_experiment"]
    assert proposed["file"] == "out/next_run.csv"
    filled(workplace / "out/next_run.csv", ["angle_rad"], 0.0)
    pliant(
        "diagnose", bench, "--data", "bench.csv", "--data", "out/next_run.csv", "--json", "two.json", *FEW
    ).done()
    both = read("two.json")
    assert both["data"] == "bench.csv + next_run.csv"
    assert both["n_samples"] > read("out.json")["n_samples"]


def test_before_data_it_is_the_fewest_runs(pliant, write, read, workplace) -> None:
    study = write(STUDY + TASK)
    call = pliant("plan", study, "--json", "out.json", "--out", "plan", *FEW).done()
    found = read("out.json")
    assert {"menu", "runs", "minutes", "classes", "not_shown", "not_tried"} <= set(found)
    assert found["minutes"] == pytest.approx(sum(run["minutes"] for run in found["runs"]))
    assert found["runs"][-1]["groups"] == 3
    assert {"stiffness", "actuation_gain", "supply_lag"} == set(found["menu"][0]["snr"])
    assert all((workplace / run["file"]).is_file() for run in found["runs"])
    assert "change / noise" in call.out and "stiffness" in call.out


def test_protocols_in_the_study_are_the_menu(pliant, write, read) -> None:
    call = pliant("plan", write(STUDY + TASK + OWN), "--json", "out.json", "--out", "plan", *FEW)
    assert call.code == 0 and "not used" not in call.err, call.err
    menu = {run["name"]: run["minutes"] for run in read("out.json")["menu"]}
    assert menu == {"passive_load_steps": 7.0, "slow_cycles": pytest.approx(3.3)}


@pytest.mark.parametrize(
    ("text", "arguments", "says"),
    [
        (STUDY, (), "states no domain"),
        (STUDY + TASK + "protocols: [{run: slow_cycle}]\n", (), "did you mean 'slow_cycles'"),
        (STUDY + TASK, ("--runs", "0"), "runs is 0"),
        (STUDY + TASK, ("--minutes", "-1"), "above 0"),
        (STUDY + TASK, ("--effect", "stifness"), "did you mean 'stiffness'"),
        (STUDY + TASK, ("--data", "none.csv"), "none.csv"),
        (STUDY + TASK, ("--data", "bench.csv", "--minutes", "1"), "shortest run takes"),
    ],
)
def test_wrong_input_is_a_sentence(pliant, bench, write, text, arguments, says) -> None:
    pliant(
        "plan", write(text, "other.yaml"), *(FEW if "--effect" not in arguments else ()), *arguments
    ).refused(says)
