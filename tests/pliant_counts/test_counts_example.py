"""The example of counts, and the published table as a file of counts."""

import json
from pathlib import Path

import pytest
from benchmarks.real.grasp_counts import TABLE, published, write_counts
from tests.command import called

from pliant.config.loading import load_study
from pliant.registry.discovery import discover
from pliant_counts.comparison import compare_counts
from pliant_counts.counted_study import counted_study
from pliant_counts.parameters import task_parameters

EXAMPLE = Path(__file__).parents[2] / "examples" / "grasp" / "counts.yaml"


def test_the_example_is_read_with_its_ranges():
    study = load_study(EXAMPLE, discover())
    counted = counted_study(study)
    assert [len(c.sets) for c in counted.counts.conditions] == [3] * 5
    assert counted.counts.trials == 150
    names = [parameter.name for parameter in task_parameters(counted, study.measurements.plausible)]
    assert names == ["task.friction", "task.grasp_height_m"]


@pytest.mark.slow
def test_the_hidden_friction_is_among_what_is_left(tmp_path):
    store, result = tmp_path / "store", tmp_path / "result.json"
    words = [
        "diagnose",
        str(EXAMPLE),
        "--effect",
        "actuation_gain",
        "--json",
        str(result),
        "--store",
        str(store),
    ]
    called(*words, "--out", tmp_path / "page", "measurements.trials=6").done()
    found = json.loads(result.read_text())
    assert ["task.friction"] in found["credible_set"]
    friction = next(h for h in found["hypotheses"] if h["kinds"] == ["task.friction"])
    assert friction["parameters"]["task.friction"]["value"] in (0.9, 1.0)  # 1.0 was hidden
    plain = next(h for h in found["hypotheses"] if h["kinds"] == [])
    assert friction["log_evidence"] > plain["log_evidence"]


@pytest.mark.skipif(not TABLE.is_file(), reason=f"{TABLE} is not here")
def test_the_published_simulation_misses_two_conditions(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = load_study(EXAMPLE, discover())
    counts = counted_study(study, write_counts(tmp_path / "table.csv", certain=True)).counts
    assert len(counts.conditions) == 12 and counts.trials == 360
    found = compare_counts(counts, published())
    assert [one.condition.words for one in found.disagreeing] == [
        "cylinder, 13 kPa, 2 extra weights",
        "cylinder, 15 kPa, 3 extra weights",
    ]
    assert not found.contradictory and found.overdispersion < 1.5
    assert (
        len(counted_study(study, write_counts(tmp_path / "near.csv", certain=False)).counts.conditions) == 8
    )
