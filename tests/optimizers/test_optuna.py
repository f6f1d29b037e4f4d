"""Optuna: samplers, fronts, exact resumption, storages, its dashboard."""

from __future__ import annotations

import importlib.util
import json
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tests.optimizers.optimizer_searches as searches
from pydantic import ValidationError
from tests.optimizers.optimizer_searches import (
    MIXED,
    NAN,
    best,
    box,
    require_goes_on,
    resumed,
    scored,
    search,
)

from pliant.errors import MissingDependencyError, UserError
from pliant_search.conformance import CORNER, IDEAL, TWO_ENDS, hypervolume, two_ends
from pliant_search.optimizer import Space, Variable
from pliant_search.optimizers.config import OptunaConfig

optuna = pytest.importorskip("optuna")
from pliant_search.optimizers.optuna.optimizer import Optuna  # noqa: E402 - needs optuna

CMAES = pytest.param("cmaes", marks=pytest.mark.skipif(not importlib.util.find_spec("cmaes"), reason="cmaes"))
SAMPLERS = [
    "tpe",
    "nsga2",
    "random",
    "qmc",
    CMAES,
    pytest.param(
        "gp",
        marks=[pytest.mark.slow, pytest.mark.skipif(not importlib.util.find_spec("torch"), reason="torch")],
    ),
]


def started(space: Space, seed: int = 1, **config: Any) -> Optuna:
    optimizer = Optuna(OptunaConfig(**config))
    optimizer.start(space, seed)
    return optimizer


def patchy(values: Any) -> tuple[float, float]:
    """Return the mixed problem's result; some parts are refused, some fail."""
    if values["n"] % 7 == 0:
        return NAN, 0.3
    return (NAN if values["n"] % 5 == 0 else searches.mixed(values)), 0.0


def test_tpe_finds_a_mixed_optimum_sooner_than_chance() -> None:
    candidate, outcome = best(search(started(MIXED), searches.mixed, 160))
    assert candidate.values["c"] == "v"
    assert outcome.objective < 0.1  # 1 of 900 random draws


@pytest.mark.parametrize("sampler", ["tpe", CMAES])
def test_finds_an_optimum_on_a_constraint(sampler: str) -> None:
    done = search(started(box(2), sampler=sampler), searches.line, 160)
    assert best(done)[1].objective < -1.2
    assert np.mean([o.violation > 0 for _, o in done[-40:]]) < np.mean(
        [o.violation > 0 for _, o in done[:40]]
    )


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_goes_on_after_an_interruption_as_if_there_was_none(sampler: str) -> None:
    before, more = (8, 4) if sampler == "gp" else (24, 48)  # a proposal of gp takes a second
    optimizer = started(MIXED, sampler=sampler, startup=5 if sampler in ("tpe", "gp") else 10)
    search(optimizer, patchy, before)
    waiting = optimizer.ask(3)
    optimizer.tell([scored(waiting[1], patchy)])
    require_goes_on(optimizer, [scored(waiting[2], patchy), scored(waiting[0], patchy)], patchy, more)


def test_several_objectives_give_a_front() -> None:
    """The sampler is nsga2; the conformance suite tests fronts of tpe."""
    optimizer = started(TWO_ENDS, sampler="nsga2", population=16)
    points: list[tuple[float, ...]] = []
    while len(points) < 160:
        outcomes = [two_ends(c) for c in optimizer.ask(optimizer.batch)]
        optimizer.tell(outcomes)
        points += [o.objectives for o in outcomes]
    first, last = (hypervolume(np.array(p), CORNER) for p in (points[:48], points[-48:]))
    assert last > first + 0.3 * (IDEAL - first), (first, last)


def test_failures_are_survived_and_avoided() -> None:
    """Half of the box fails; elsewhere all values are equal, so that only failures can be learned."""
    done = search(started(box(2)), lambda v: NAN if v["x0"] < 0.5 else 1.0, 160)  # type: ignore[operator]
    assert sum(o.objective != o.objective for _, o in done[-60:]) < 20


def test_begins_with_the_guess_itself() -> None:
    guess = {"a": 0.25, "n": 12, "c": "w", "d": 1}
    first, second = started(Space(MIXED.variables, start=guess)).ask(2)
    assert dict(first.values) == guess
    assert dict(second.values) != guess


def test_a_batch_is_not_one_candidate_many_times() -> None:
    optimizer = started(box(3))
    search(optimizer, searches.sphere, 40)
    asked = np.array([list(c.values.values()) for c in optimizer.ask(8)])
    assert len(np.unique(asked.round(9), axis=0)) == 8


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sqlite:///{}/s.db", "journal:{}/s.log"])
def test_a_storage_shows_every_trial_once_through_an_interruption(kind: str, tmp_path: Path) -> None:
    place = kind.format(tmp_path)
    optimizer = started(MIXED, storage=place, study="finger")
    search(optimizer, patchy, 16)
    saved = json.dumps(optimizer.state())
    search(optimizer, patchy, 8)  # reported and written, and then the process dies before it saves its state
    again = Optuna(optimizer.config)
    again.restore(json.loads(saved))
    done = search(again, patchy, 16)
    study = optuna.load_study(study_name="finger", storage=opened(place))
    shown = {t.user_attrs["candidate"]: t for t in study.trials}
    assert len(study.trials) == len(shown) == 32
    for candidate, outcome in done:
        trial = shown[candidate.number]
        assert trial.params == candidate.values
        assert trial.user_attrs["violation"] == outcome.violation
        failed = outcome.objective != outcome.objective and not outcome.violation
        assert trial.user_attrs["failed"] == failed
        assert trial.state.name == ("FAIL" if failed else "PRUNED" if outcome.violation else "COMPLETE")
        assert failed or outcome.violation or trial.value == outcome.objective


def opened(place: str) -> Any:
    if place.startswith("sqlite"):
        return place
    backend = optuna.storages.journal.JournalFileBackend(place.partition(":")[2])
    return optuna.storages.JournalStorage(backend)


def test_every_search_has_its_own_study(tmp_path: Path) -> None:
    place = f"journal:{tmp_path}/s.log"
    for seed in (1, 2, 3):
        search(started(box(2), seed, storage=place), searches.sphere, 8)
    summaries = optuna.get_all_study_summaries(opened(place))
    assert {s.study_name: s.n_trials for s in summaries} == {"pliant": 8, "pliant-2": 8, "pliant-3": 8}


def test_a_lost_storage_is_written_anew_and_another_searchs_study_is_refused(tmp_path: Path) -> None:
    place = f"journal:{tmp_path}/s.log"
    optimizer = started(box(2), storage=place)
    search(optimizer, searches.sphere, 16)
    (tmp_path / "s.log").unlink()
    resumed(optimizer)
    assert len(optuna.load_study(study_name=None, storage=opened(place)).trials) == 16
    (tmp_path / "s.log").unlink()
    started(box(2), storage=place)
    with pytest.raises(UserError, match="'pliant' belongs to another search"):
        resumed(optimizer)


def test_storages_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.db").write_text("no database, but long enough to be taken for one " * 20)
    for file, says in (("absent/s.db", r"'.*absent' .* does not exist"), ("text.db", "cannot be used")):
        with pytest.raises(UserError, match=says):
            started(box(2), storage=f"sqlite:///{tmp_path}/{file}")


@pytest.mark.parametrize(
    ("block", "says"),
    [
        ({"storage": "search.db"}, "write sqlite:///search.db or journal:search.log"),
        ({"sampler": "tpe", "population": 20}, "'population' is for nsga2 and cmaes, not for tpe"),
        ({"sampler": "qmc", "startup": 20}, "'startup' is for tpe and gp, not for qmc"),
        ({"sampler": "grid"}, "nsga2"),
    ],
)
def test_wrong_blocks_are_refused(block: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        OptunaConfig(**block)


def test_a_sampler_names_the_package_that_it_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "cmaes" else real(name, *a)
    )
    with pytest.raises(MissingDependencyError, match="'cmaes' needs cmaes: pip install cmaes"):
        started(box(2), sampler="cmaes")


def test_messages_and_their_level_are_left_alone(capfd: pytest.CaptureFixture[str]) -> None:
    before = optuna.logging.get_verbosity()
    samplers = ["tpe", "qmc", *(["cmaes"] if importlib.util.find_spec("cmaes") else [])]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for sampler in samplers:
            search(started(box(2), sampler=sampler), searches.sphere, 24)
    assert optuna.logging.get_verbosity() == before
    assert capfd.readouterr().err == ""


def test_exports_a_journal_that_optuna_reads(tmp_path: Path) -> None:
    optimizer = started(TWO_ENDS)
    optimizer.tell([two_ends(c) for c in optimizer.ask(12)])
    (path,) = optimizer.export(tmp_path)
    study = optuna.load_study(study_name="pliant", storage=opened(f"journal:{path}"))
    assert [len(t.values) for t in study.trials] == [2] * 12


@pytest.mark.slow
def test_the_dashboard_serves_the_study(tmp_path: Path) -> None:
    """optuna-dashboard reads the file that the plugin wrote and answers by its HTTP interface."""
    program = shutil.which("optuna-dashboard", path=str(Path(sys.executable).parent)) or shutil.which(
        "optuna-dashboard"
    )
    if program is None:
        pytest.skip("optuna-dashboard is not installed")
    place = f"sqlite:///{tmp_path}/search.db"
    search(started(Space((Variable("wall", "real", 1, 2),)), storage=place, study="egg"), lambda v: 1.0, 8)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = subprocess.Popen(
        [program, place, "--port", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        (summary,) = answer(f"http://127.0.0.1:{port}/api/studies")["study_summaries"]
        assert summary["study_name"] == "egg"
        study = answer(f"http://127.0.0.1:{port}/api/studies/{summary['study_id']}?after=0")
        assert len(study["trials"]) == 8
        assert study["trials"][0]["params"][0]["name"] == "wall"
    finally:
        server.terminate()
        server.wait(20)


def answer(url: str) -> Any:
    """Return the JSON at that address, once the server is running."""
    for _ in range(300):
        try:
            with urllib.request.urlopen(url, timeout=10) as response:
                return json.load(response)
        except (ConnectionError, OSError):
            time.sleep(0.2)
    raise AssertionError(f"{url} does not answer")


@pytest.mark.parametrize("sampler", [CMAES, "qmc"])
def test_choices_that_a_sampler_draws_at_random_are_said(sampler: str) -> None:
    """optuna/optuna#1569 and #6188: Optuna warns of it, and its messages are silenced here."""
    optimizer = Optuna(OptunaConfig(sampler=sampler))
    (said,) = optimizer.space_remarks(searches.MIXED)
    assert "learns no choices: c, d are drawn at random" in said
    assert not optimizer.space_remarks(searches.box(2))
    assert not Optuna(OptunaConfig()).space_remarks(searches.MIXED)


@pytest.mark.parametrize("sampler", [CMAES, "tpe"])
def test_one_whole_number_alone_is_learned(sampler: str) -> None:
    """optuna/optuna#5520: CMA-ES of one variable was a random search."""
    space = Space((Variable("n", "integer", 1, 400),))
    done = searches.search(started(space, sampler=sampler), lambda v: (v["n"] - 301) ** 2, 60)  # type: ignore
    late = [candidate.values["n"] for candidate, _ in done[-20:]]
    assert abs(searches.best(done)[0].values["n"] - 301) <= 3  # type: ignore[operator]
    assert np.median([abs(n - 301) for n in late]) < 50  # type: ignore[operator]
