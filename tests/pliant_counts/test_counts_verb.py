"""`pliant compare` with counts, from the command line: MuJoCo grasps, two conditions, two trials each."""

import json

import pytest
from tests.command import called
from tests.pliant_counts.counts_study import HEADER, STUDY

ROWS = "a,egg,15,2,10,10\nb,egg,15,2,9,10\na,cylinder,11,8,10,10\nb,cylinder,11,8,9,10\n"


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(STUDY)
    (tmp_path / "counts.csv").write_text(HEADER + ROWS)

    return called


@pytest.mark.slow
def test_counts_are_simulated_compared_and_kept(call, tmp_path):
    call("compare", "study.yaml", "measurements.trials=3", "--json", "first.json", "--out", "page").done()
    found = json.loads((tmp_path / "first.json").read_text())
    assert found["command"] == "compare" and found["n_samples"] == 40
    egg, cylinder = found["conditions"]
    assert (egg["simulated_successes"], egg["disagrees"]) == (3, False)
    assert (cylinder["simulated_successes"], cylinder["disagrees"]) == (
        0,
        True,
    )  # 170 g at 11 kPa: no gripper can lift it
    assert found["worst"][0]["condition"] == "cylinder, 11 kPa, 8 extra weights"
    assert (tmp_path / "page" / "pictures" / "runs.png").is_file()
    assert "differs" in (tmp_path / "page" / "report.html").read_text()
    stored = sorted((tmp_path / ".pliant" / "store" / "simulate").glob("*/value.json"))
    times = [file.stat().st_mtime_ns for file in stored]
    again = call("compare", "study.yaml", "measurements.trials=3", "--json", "again.json", "--workers", 2)
    assert again.code == 0 and len(stored) == 2
    assert [
        file.stat().st_mtime_ns for file in stored
    ] == times  # nothing is simulated twice, nor in other processes
    second = json.loads((tmp_path / "again.json").read_text())
    assert second["log_likelihood"] == found["log_likelihood"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("task={kind: free_bending, pressure: 15 kPa}", "its task 'free_bending' has no trials"),
        ("task=null", "it has no 'task'"),
        ("physics=quasistatic", "has no contacts"),
        ("measurements.trials=0", "measurements.trials"),
        ("measurements.file=nowhere.csv", "nowhere.csv"),
    ],
)
def test_studies_that_cannot_be_counted(call, change, said):
    call("compare", "study.yaml", change).refused(said)


def test_counts_beside_readings_are_refused_for_a_grasp(call, tmp_path):
    (tmp_path / "counts.csv").write_text("run,time_s,pressure_pa,angle_rad,successes,trials\na,0,0,0,1,2\n")
    call("compare", "study.yaml").refused("two files")
