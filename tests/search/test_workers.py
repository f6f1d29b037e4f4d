"""Workers: several processes give the result of one; dead workers are replaced; a job that kills workers has failed."""

from concurrent.futures import ProcessPoolExecutor

import pytest
from tests.search.toy_search import ToyEvaluator, make_setup, searched, told

from pliant.errors import NotReachedError, UserError
from pliant.execution.jobs import KILLED, Failure, Finished
from pliant.pipeline import remote
from pliant.pipeline.remote import RemoteStudy
from pliant_search import workers
from pliant_search.optimizer import Trial
from pliant_search.run.journal import Generation
from pliant_search.stage_keys import MODULES
from pliant_search.workers import Setup, finished_trial, work

VALUES = {"a": 0.5, "b": 0.0, "n": 2}


def test_a_candidate_that_kills_its_worker_has_failed():
    lost = Finished(0, Trial(3, VALUES), failure=Failure(KILLED))
    assert finished_trial(lost) == Trial(3, VALUES, state="failed", cause=KILLED)


def test_an_executor_that_breaks_is_said_and_what_was_told_is_kept(tmp_path):
    with (
        ProcessPoolExecutor(1) as pool,
        pytest.raises(NotReachedError, match="run the command again to continue"),
    ):
        searched(tmp_path / "a", executor=pool, deadly=1.2, killed=str(tmp_path / "killed"))
    assert told(searched(tmp_path / "a")) == told(searched(tmp_path / "b"))


def test_a_worker_builds_its_evaluator_once():
    first = work(make_setup(delay_s=0.0), Trial(0, VALUES))
    assert first.objectives == ToyEvaluator().evaluate(VALUES).objectives
    kept = workers._KEPT.evaluator
    work(make_setup(delay_s=0.0), Trial(1, VALUES))
    assert workers._KEPT.evaluator is kept
    work(make_setup(delay_s=1e-4), Trial(1, VALUES))
    assert workers._KEPT.evaluator is not kept


def test_a_worker_with_other_code_says_so():
    with pytest.raises(UserError, match="another version"):
        work(Setup(RemoteStudy("{}", (), "/", MODULES, "abc")), Trial(0, VALUES))


def test_a_host_that_does_not_see_the_store_has_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr(remote, "SEEN_WITHIN_S", 0.0)
    monkeypatch.setenv("PLIANT_STORE", str(tmp_path))
    bench, study = RemoteStudy('{"pliant": 1, "name": "far"}', (), "/nowhere").open()
    assert (bench.store.root, study.name) == (tmp_path, "far")


def test_an_outcome_survives_its_journal():
    own = ("ok", (1 / 3, 2.0), 0.25, "why", {"m": 1e-300}, {"c": {"m": 2.0}}, (1.0,), 7, 0.5)
    row = Trial(3, {"a": 0.1 + 0.2, "n": 2, "k": "x"}, 1, *own)
    generation = Generation(4, 6, (row,), 2.5)
    assert Generation.from_line(generation.line().encode()) == generation
