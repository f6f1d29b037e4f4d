"""The `workers` key of a study: allowed values, what overrides it, and results that do not depend on it."""

import json

import pytest
from tests.config.test_loading import REGISTRY, STUDY, problem, write

from pliant.config.loading import load_study
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.workbench import RunContext
from pliant.store.store import ArtifactStore
from pliant_designs import sweep

__all__ = ["write"]
ADDRESS = "tcp://host:8786"


@pytest.mark.parametrize(
    ("written", "who"),
    [
        ("2", 2),
        ("{count: 2}", 2),
        ("processes", None),
        (f"{{kind: dask, address: '{ADDRESS}'}}", ADDRESS),
    ],
)
def test_the_study_says_who_works_and_a_command_overrules_it(write, written, who):
    study = load_study(write(f"{STUDY}workers: {written}\n"), REGISTRY)
    assert study.resolve_workers(None) == who and study.resolve_workers(3) == 3
    assert load_study(write(STUDY), REGISTRY).resolve_workers(None, 1) == 1


def test_one_word_on_the_command_line(write):
    path = write(f"{STUDY}workers: 2\n")
    assert load_study(path, REGISTRY, ["workers=4"]).resolve_workers(None) == 4
    dask = ["workers.kind=dask", f"workers.address={ADDRESS}"]
    assert load_study(write(STUDY), REGISTRY, dask).resolve_workers(None) == ADDRESS


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("0", "greater than or equal to 1"),
        ("true", "workers"),
        ("dask", "'address'"),
        ("{kind: dask, address: here, count: 2}", "'count'"),
        ("{address: here}", "kind: dask"),
        ("{kind: slurm}", "dask"),
    ],
)
def test_what_cannot_work_is_said_with_its_line(write, written, said):
    text = problem(write(f"{STUDY}workers: {written}\n"))
    assert "workers" in text and said in text and "line 14" in text


def test_a_worker_has_no_workers(write, tmp_path):
    study = load_study(write(f"{STUDY}workers: 2\n"), REGISTRY)
    context = RunContext(REGISTRY, ArtifactStore(tmp_path / "store"))
    assert "workers" not in json.loads(RemoteStudy.from_study(context, study).study)


def test_a_sweep_is_done_by_them(write, tmp_path, monkeypatch):
    seen = []

    def begun(workers, most):
        seen.append(workers)
        raise KeyboardInterrupt

    monkeypatch.setattr(sweep, "executor_for", begun)
    study = load_study(write(f"{STUDY}sweep: {{wall: [1.4 mm, 1.6 mm]}}\nworkers: 2\n"), REGISTRY)
    context = RunContext(REGISTRY, ArtifactStore(tmp_path / "store", study.name))
    with pytest.raises(KeyboardInterrupt):
        sweep.sweep_study(context, study)
    assert seen == [2]
