"""The journal: a search interrupted anywhere has the result of an uninterrupted one."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.search.toy_search import Narrowing, StopError, ToyProblem, Watched, searched, told

from pliant_search.run import loop
from pliant_search.run.journal import Journal, keep_journals, take_journals

EACH = ({"s": 0}, {"s": 1}, {"s": 2})


def lines(folder, name="branch-0"):
    return (folder / f"{name}.jsonl").read_bytes().splitlines(keepends=True)


@pytest.fixture
def whole(tmp_path):
    return told(searched(tmp_path / "whole", branches=EACH))


@pytest.mark.parametrize(("after", "often"), [(0, True), (17, False), (45, True), (80, False), (118, True)])
def test_a_search_that_is_ended_goes_on_to_the_same_result(tmp_path, whole, after, often, monkeypatch):
    monkeypatch.setattr(loop, "SNAPSHOT_EVERY_S", 0.0 if often else 1e9)
    with pytest.raises(StopError):
        searched(tmp_path / "a", branches=EACH, progress=Watched(after=after))
    assert told(searched(tmp_path / "a", branches=EACH)) == whole


def test_what_was_evaluated_is_not_evaluated_again(tmp_path, whole):
    with pytest.raises(StopError):
        searched(tmp_path / "a", branches=EACH, progress=Watched(after=50))
    kept = sum(
        len(json.loads(line)["rows"]) for k in range(2) for line in lines(tmp_path / "a", f"branch-{k}")
    )
    log = tmp_path / "log"
    assert told(searched(tmp_path / "a", branches=EACH, log=str(log))) == whole
    assert len(log.read_text().splitlines()) == 120 - kept
    log.unlink()
    bar = Watched()
    assert told(searched(tmp_path / "a", branches=EACH, log=str(log), progress=bar)) == whole
    assert not log.exists()
    assert bar.done == bar.total == 120  # known, all of it


def test_a_torn_line_is_dropped(tmp_path, whole):
    searched(tmp_path / "a", branches=EACH)
    file = tmp_path / "a/branch-0.jsonl"
    for cut in (1, 40, 300):
        text = file.read_bytes()
        file.write_bytes(text[:-cut])
        assert told(searched(tmp_path / "a", branches=EACH)) == whole
        assert len(lines(tmp_path / "a")) == 7


def test_rubbish_within_the_journal_costs_what_follows_it_only(tmp_path, whole):
    searched(tmp_path / "a", branches=EACH)
    file = tmp_path / "a/branch-1.jsonl"
    own = lines(tmp_path / "a", "branch-1")
    file.write_bytes(b"".join([*own[:3], b"{rubbish}\n", *own[4:]]))
    log = tmp_path / "log"
    assert told(searched(tmp_path / "a", branches=EACH, log=str(log))) == whole
    assert len(log.read_text().splitlines()) == 40 - 18


def test_a_state_that_is_rubbish_or_ahead_in_the_journal_is_passed_over(tmp_path, whole):
    searched(tmp_path / "a", branches=EACH, budget=24)
    assert json.loads((tmp_path / "a/branch-0.state.json").read_text())["batches"] == 4
    (tmp_path / "a/branch-2.state.json").write_text('{"batches": 2')
    Journal(tmp_path / "a", "branch-0").keep(2)
    assert told(searched(tmp_path / "a", branches=EACH)) == whole


def test_a_state_from_dropped_batches_does_not_come_back(tmp_path):
    searched(tmp_path / "a", budget=30)  # leaves a state after five whole batches
    searched(tmp_path / "a", budget=25)  # the fifth is another one now, of one candidate
    (again,) = searched(tmp_path / "a", budget=25)
    (fresh,) = searched(tmp_path / "b", budget=25)
    assert again.optimizer.state() == fresh.optimizer.state()


def shifted():
    return Narrowing(shift=1e-9)


class Fresh(Narrowing):
    """An optimizer that cannot read earlier states."""

    def restore(self, state):
        raise KeyError("sigma")


@pytest.mark.parametrize(("make", "why"), [(shifted, "other candidates"), (Fresh, "KeyError: 'sigma'")])
def test_an_optimizer_that_has_changed_begins_anew_and_says_so(tmp_path, make, why):
    searched(tmp_path / "a", budget=24)
    if make is shifted:
        (tmp_path / "a/branch-0.state.json").unlink()
    bar = Watched()
    again = told(searched(tmp_path / "a", budget=24, make=make, progress=bar))
    assert again == told(searched(tmp_path / "b", budget=24, make=make))
    (note,) = bar.notes
    assert "begins anew" in note
    assert why in note


@pytest.mark.parametrize(("first", "then"), [(20, 50), (24, 50), (50, 20), (50, 24), (24, 25)])
def test_another_budget_goes_on_from_a_finished_search(tmp_path, first, then):
    searched(tmp_path / "a", budget=first)
    keep_journals(tmp_path / "a", tmp_path / "kept/one")
    (tmp_path / "b").mkdir()
    assert take_journals(tmp_path / "kept/one", tmp_path / "b")
    log = tmp_path / "log"
    more = searched(tmp_path / "b", budget=then, log=str(log))
    assert told(more) == told(searched(tmp_path / "c", budget=then))
    again = len(log.read_text().splitlines()) if log.exists() else 0
    assert again == max(0, then - first // 6 * 6) if then > first else again <= then % 6
    assert not take_journals(tmp_path / "kept/one", tmp_path / "b")  # it has a separate journal now


def test_until_is_seen_again_in_the_journal(tmp_path):
    searched(tmp_path / "a", budget=100)
    problem = ToyProblem(good=0.1)
    (again,) = searched(tmp_path / "a", budget=100, problem=problem)
    assert again.stopped == "until"
    assert told([again]) == told(searched(tmp_path / "b", budget=100, problem=problem))


def test_the_time_over_all_sessions_adds_up(tmp_path):
    with pytest.raises(StopError):
        searched(tmp_path / "a", delay_s=0.004, progress=Watched(after=30))
    before = json.loads(lines(tmp_path / "a")[-1])["wall_s"]
    (branch,) = searched(tmp_path / "a", delay_s=0.004)
    assert before > 0.05
    assert branch.wall_s > before


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="POSIX signals")
def test_killed_at_random_moments_it_ends_the_same(tmp_path, whole):
    settings = {"branches": list(EACH), "delay_s": 0.01}
    root = Path(__file__).parents[2]
    call = [
        sys.executable,
        "-m",
        "tests.search.toy_search",
        str(tmp_path / "a"),
        "1",
        json.dumps(settings),
    ]
    draw = random.Random(1)
    for _ in range(2):
        journals = tmp_path / "a"
        before = sum(file.stat().st_size for file in journals.glob("*.jsonl")) if journals.exists() else 0
        process = subprocess.Popen(call, cwd=root, start_new_session=True)
        until = time.monotonic() + 60
        while (
            sum(file.stat().st_size for file in journals.glob("*.jsonl")) == before and process.poll() is None
        ):
            assert time.monotonic() < until
            time.sleep(0.01)
        time.sleep(draw.uniform(0.0, 0.2))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert told(searched(tmp_path / "a", branches=EACH)) == whole
