"""Sweeps: every design once, by any worker; a failed design is a record; nothing is solved twice."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
from tests.pliant_designs import sweep_bench as bench

from pliant import api
from pliant.errors import NotReachedError, UserError
from pliant.execution.progress import Silent
from pliant.fem_tables.reading import read_table
from pliant.pipeline import remote
from pliant_designs import sweep
from pliant_designs.sweep_designs import sweep_designs
from pliant_designs.sweep_jobs import SweepJob, solve
from pliant_designs.sweep_table import write_sweep_table

GRID = "{radius: [5 mm, 6 mm], length: [9 mm, 11 mm]}"


@pytest.fixture
def log(tmp_path, monkeypatch):
    """Return the file to which the springs write every state that they solve."""
    path = tmp_path / "solved.log"
    monkeypatch.setenv("SPRINGS_LOG", str(path))
    return path


class WatchedSweep(Silent):
    """A progress that records its calls."""

    def __init__(self):
        self.notes, self.within, self.count, self.total = [], [], 0, 0

    def begin(self, title, total, done=0):
        self.total, self.count, self.first = total, done, done
        return self

    def advance(self, steps=1):
        self.count += steps

    def describe(self, text):
        self.within.append(text)

    def note(self, text):
        self.notes.append(text)


@pytest.mark.parametrize(
    ("sweep", "name", "values"),
    [
        ("{radius: {low: 5 mm, high: 6 mm, count: 3}}", "radius_m", [5e-3, 5.5e-3, 6e-3]),
        ("{folds: {low: 1, high: 5, count: 3}}", "folds", [1, 3, 5]),
        ("{family.folds: [2]}", "folds", [2]),
        ("{radius_m: [0.004]}", "radius_m", [0.004]),
        ("{material.shear_modulus: [200 kPa, 1e5]}", "material.shear_modulus_pa", [2e5, 1e5]),
        ("{material: {density: [1000 kg/m^3]}}", "material.density_kg_m3", [1000]),
        ("{defect: [none, stuck]}", "defect", ["none", "stuck"]),
    ],
)
def test_ways_to_write_a_sweep(tmp_path, sweep, name, values):
    designs = sweep_designs(bench.opened(tmp_path, sweep).study)
    assert [d.changes[name] for d in designs] == values


def test_a_design_table_is_read_row_by_row(tmp_path):
    (tmp_path / "designs.csv").write_text("# chosen by hand\nradius,length\n5 mm,9 mm\n\n0.006,11 mm\n")
    designs = sweep_designs(bench.opened(tmp_path, "{designs: designs.csv}").study)
    assert [(d.family.radius_m, d.family.length_m) for d in designs] == [
        (pytest.approx(5e-3), pytest.approx(9e-3)),
        (6e-3, pytest.approx(11e-3)),
    ]


def test_what_cannot_be_had_is_a_record_with_its_cause(tmp_path):
    opened = bench.opened(
        tmp_path, "{radius: [5 mm, 10 mm], defect: [none, stuck, raises, exits, some_states]}"
    )
    run = api.sweep(opened, workers=1)
    assert bench.statuses(run) == ["done", "not_reached", "error", "error", "done"] + ["refused"] * 5
    causes = [outcome.cause for outcome in run.outcomes]
    assert "Newton stopped" in causes[1]
    assert causes[2] == "ZeroDivisionError: division by zero"
    assert causes[3] == "SystemExit: 7"
    assert "short by 1 mm" in causes[5]
    assert run.outcomes[4].n_failed > 0
    assert {f["cause"] for f in run.outcomes[4].failed} == {"Newton stopped"}
    with pytest.raises(NotReachedError, match="design 2 has no FEM data"):
        run.outcomes[2].data()


def test_what_every_design_would_say_is_said_once(tmp_path):
    watched = WatchedSweep()
    flat = "material={kind: mooney_rivlin, c10: 200 kPa, c01: -80 kPa}"
    api.sweep(bench.opened(tmp_path, "{radius: [4 mm, 5 mm]}", flat, progress=watched), workers=1)
    assert len([note for note in watched.notes if "stable" in note]) == 1


def test_two_sweeps_at_once_share_the_work(tmp_path, log):
    opened = [
        bench.opened(tmp_path, "{radius: [4 mm, 5 mm, 6 mm, 7 mm]}", "fem.delay_s=0.01") for _ in range(2)
    ]
    with ThreadPoolExecutor(2) as both:
        runs = list(both.map(lambda study: api.sweep(study, workers=1), opened))
    counts = bench.solved(log)
    assert set(counts.values()) == {1}
    assert bench.same(*(bench.table(run) for run in runs))
    assert bench.statuses(runs[0]) == bench.statuses(runs[1]) == ["done"] * 4


@pytest.mark.slow
def test_a_design_that_kills_its_worker_twice_is_recorded_and_the_others_are_solved(tmp_path, log):
    run = api.sweep(bench.opened(tmp_path, "{folds: [1, 2], defect: [dies, none, dies_once]}"), workers=2)
    assert bench.statuses(run) == ["crashed", "done", "done"] * 2
    assert "was killed" in run.outcomes[0].cause
    again = [state for state in bench.solved_again(log) if "/none " in state]
    assert len(again) <= 2  # each of the two may be interrupted once by a dying neighbour


def job(opened, folder, **changes):
    """Return a job for the first design, with a progress folder that exists."""
    family, material, fem = (
        getattr(opened.study, name).canonical() for name in ("family", "material", "fem")
    )
    configs = {"family": family, "material": material, "fem": fem}
    (folder / "progress").mkdir()
    plain = SweepJob(
        0, configs, (str(bench.PLUGIN),), str(folder / "store"), str(folder / "progress"), "0" * 32
    )
    return replace(plain, **changes)


HOLDER = """\
import sys, time
from filelock import FileLock
lock = FileLock(sys.argv[1])
lock.acquire()
print("held", flush=True)
time.sleep(60)
"""


def test_the_lock_from_a_killed_process_is_free(tmp_path):
    from pliant.store.store import ArtifactStore

    (tmp_path / "fem").mkdir()
    store, place = ArtifactStore(tmp_path), str(tmp_path / "fem" / "abc.lock")
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, place], stdout=subprocess.PIPE)
    assert holder.stdout.readline() == b"held\n"
    assert store.computed_elsewhere("fem", "abc")
    holder.kill()
    holder.wait()
    holder.stdout.close()
    assert not store.computed_elsewhere("fem", "abc")


def test_interrupted_within_a_design_it_goes_on_from_the_last_state(tmp_path, log, monkeypatch):
    whole = bench.table(api.sweep(bench.opened(tmp_path, GRID, store="whole"), workers=1))
    log.unlink()
    opened = bench.opened(tmp_path, GRID)

    class Impatient(WatchedSweep):
        def describe(self, text):
            super().describe(text)
            if sum(bench.solved(log).values()) == 13:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        api.sweep(replace(opened, context=replace(opened.context, progress=Impatient())), workers=1)
    assert sum(bench.solved(log).values()) == 13
    run = api.sweep(opened, workers=1)
    assert set(bench.solved(log).values()) == {1}
    assert bench.same(whole, bench.table(run))


def test_the_table_has_the_states_from_all_designs(tmp_path):
    sweep = "{radius: [4 mm, 5 mm, 10 mm], material.shear_modulus: [240 kPa, 300 kPa]}"
    run = api.sweep(bench.opened(tmp_path, sweep), workers=1)
    write_sweep_table(run, tmp_path / "fem.csv")
    lines = [line.split(",") for line in (tmp_path / "fem.csv").read_text().splitlines()]
    rows = [dict(zip(lines[0], line, strict=True)) for line in lines[1:]]
    assert len(rows) == sum(outcome.n_states for outcome in run.outcomes)
    for outcome in run.done():
        own = [row for row in rows if row["design"] == str(outcome.design.number)]
        np.testing.assert_array_equal([float(row["moment_n_m"]) for row in own], outcome.data().tau[:, 0])
        for name in ("radius_m", "length_m", "material.shear_modulus_pa"):
            assert {float(row[name]) for row in own} == {outcome.design.parameters[name]}
    assert len(read_table(tmp_path / "fem.csv")) == len(rows)


@pytest.mark.slow
def test_a_sweep_may_be_driven_from_a_thread(tmp_path):
    done = []
    thread = threading.Thread(
        target=lambda: done.append(api.sweep(bench.opened(tmp_path, GRID), workers=2)), daemon=True
    )
    thread.start()
    thread.join(60)
    assert bench.statuses(done[0]) == ["done"] * 4


def tried(folder, log, name, **crew):
    log.unlink(missing_ok=True)
    run = api.sweep(bench.opened(folder, GRID, store=name), **crew)
    assert bench.statuses(run) == ["done"] * 4
    return bench.table(run), bench.pids(log)


@pytest.mark.slow
def test_threads_and_processes_agree_with_this_process_bit_for_bit_and_a_second_sweep_solves_nothing(
    tmp_path, log
):
    serial, here = tried(tmp_path, log, "serial", workers=1)
    assert here == {str(os.getpid())}
    with ThreadPoolExecutor(3) as threads:
        assert bench.same(serial, tried(tmp_path, log, "threads", executor=threads)[0])
    processes, others = tried(tmp_path, log, "processes", workers=2)
    assert bench.same(serial, processes) and str(os.getpid()) not in others
    log.unlink()
    watched = WatchedSweep()
    second = api.sweep(bench.opened(tmp_path, GRID, store="serial", progress=watched), workers=2)
    assert bench.solved(log) == {} and all(outcome.cached for outcome in second.outcomes)
    assert (watched.first, watched.total) == (4, 4)
    larger = "{radius: [4 mm, 5 mm, 6 mm, 10 mm], length: [9 mm, 11 mm]}"
    run = api.sweep(bench.opened(tmp_path, larger, store="serial", progress=watched), workers=1)
    assert [outcome.cached for outcome in run.outcomes] == [False] * 2 + [True] * 4 + [False] * 2
    assert {state.split("/")[0] for state in bench.solved(log)} == {"0.004", "0.01"}
    assert (watched.count, watched.total) == (7, 7)  # one is refused
    assert any("state 3 of" in text for text in watched.within)


@pytest.mark.slow
def test_given_pools_and_dask_agree_bit_for_bit_and_a_pool_that_breaks_says_so(tmp_path, log):
    distributed = pytest.importorskip("distributed")
    serial, _ = tried(tmp_path, log, "serial", workers=1)
    with ProcessPoolExecutor(1, get_context("spawn")) as given:
        assert bench.same(serial, tried(tmp_path, log, "given", executor=given)[0])
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as local, distributed.Client(local) as client:
        by_dask, remote = tried(tmp_path, log, "dask", executor=client.get_executor())
    assert bench.same(serial, by_dask) and str(os.getpid()) not in remote
    opened = bench.opened(tmp_path, "{defect: [dies]}")
    with ProcessPoolExecutor(1, get_context("spawn")) as pool, pytest.raises(NotReachedError, match="broke"):
        api.sweep(opened, pool)


def test_a_worker_with_other_code_stops_the_sweep_with_its_sentence(tmp_path):
    answer = solve(job(bench.opened(tmp_path, GRID), tmp_path))
    assert answer.status == "stop" and "another version" in answer.cause


@pytest.fixture
def far(tmp_path, monkeypatch):
    """Return a function that solves as on a host that does not see the driver's store; its own is `far`."""
    monkeypatch.setattr(remote, "SEEN_WITHIN_S", 0.0)
    monkeypatch.setenv("PLIANT_STORE", str(tmp_path / "far"))

    def elsewhere(job, say=None):
        return solve(replace(job, store="/nowhere", progress="/nowhere/progress"))

    monkeypatch.setattr(sweep, "solve", elsewhere)
    return elsewhere


def test_artifacts_from_a_host_without_the_store_come_back_unchanged(tmp_path, log, far):
    found = api.sweep(bench.opened(tmp_path, GRID), workers=1)
    assert bench.statuses(found) == ["done"] * 4
    for outcome in found.outcomes:
        assert outcome.folder.parent == tmp_path / "store" / "fem"
        there = tmp_path / "far" / "fem" / outcome.key
        assert {p.name: p.read_bytes() for p in there.iterdir()} == {
            p.name: p.read_bytes() for p in outcome.folder.iterdir()
        }
    log.unlink()
    assert all(one.cached for one in api.sweep(bench.opened(tmp_path, GRID), workers=1).outcomes)
    shutil.rmtree(tmp_path / "store")
    api.sweep(bench.opened(tmp_path, GRID), workers=1)
    assert bench.solved(log) == {}  # the host has kept its artifacts


def test_what_a_far_worker_sends_is_checked(tmp_path, log, far, monkeypatch):
    def damaged(job, say=None):
        answer = far(job)
        return replace(answer, parcel=answer.parcel[: len(answer.parcel) // 2])

    monkeypatch.setattr(sweep, "solve", damaged)
    with pytest.raises(UserError, match="cannot be read here"):
        api.sweep(bench.opened(tmp_path, GRID), workers=1)
    assert not list((tmp_path / "store" / "fem").glob("*"))


DRIVER = """\
import sys
from pliant import api
if __name__ == "__main__":
    api.sweep(api.open_study(sys.argv[1], ["fem.delay_s=0.2"], store=sys.argv[2]), workers=2)
"""


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="POSIX signals")
def test_no_worker_outlives_a_killed_driver(tmp_path, log):
    script = tmp_path / "driver.py"
    script.write_text(DRIVER)
    path = bench.study(tmp_path, GRID)
    driver = subprocess.Popen([sys.executable, script, path, tmp_path / "store"], start_new_session=True)
    wait_until(lambda: sum(bench.solved(log).values()) >= 3)
    workers = {int(pid) for pid in bench.pids(log)}
    assert driver.pid not in workers
    os.kill(driver.pid, signal.SIGKILL)
    driver.wait()
    wait_until(lambda: not any(alive(pid) for pid in workers))


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat") as file:  # noqa: PTH123
        return file.read().rpartition(")")[2].split()[0] != "Z"


def wait_until(condition, seconds=30):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)
