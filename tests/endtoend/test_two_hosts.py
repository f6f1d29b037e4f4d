"""Two hosts without a common file system: a worker in a separate network and mount namespace, including kills.

The worker's host has another address, and an empty file system where the driver's folder is. Needs root, `ip` and
`unshare`, as CI has them.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest
from tests.cli.search_study import STUDY
from tests.pliant_designs import sweep_bench as bench

from pliant import api

GRID = "{radius: [5 mm, 6 mm], length: [9 mm, 11 mm]}"
NAME, DRIVER, WORKER, PORT = "pliant-host", "10.211.7.1", "10.211.7.2", 8797
TOOLS = ("ip", "unshare", "mount", "sh")


def call(*command: str) -> bool:
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def hosts() -> bool:
    """Create the namespace and its network link; return False where that is not allowed."""
    if os.name != "posix" or os.geteuid() != 0 or not all(map(shutil.which, TOOLS)):
        return False
    here = ("ip", "netns", "exec", NAME, "ip")
    steps = [
        ("ip", "netns", "add", NAME),
        ("ip", "link", "add", "pliant-v0", "type", "veth", "peer", "name", "pliant-v1"),
        ("ip", "link", "set", "pliant-v1", "netns", NAME),
        ("ip", "addr", "add", f"{DRIVER}/24", "dev", "pliant-v0"),
        ("ip", "link", "set", "pliant-v0", "up"),
        (*here, "addr", "add", f"{WORKER}/24", "dev", "pliant-v1"),
        (*here, "link", "set", "pliant-v1", "up"),
        (*here, "link", "set", "lo", "up"),
    ]
    return all(call(*step) for step in steps)


@dataclass
class Hosts:
    """The scheduler's address, the driver's folder, the worker's store, and how to start a worker there."""

    address: str
    folder: Path
    store: Path
    worker: Callable[[], subprocess.Popen[bytes]]


@pytest.fixture
def two_hosts(tmp_path: Path) -> Iterator[Hosts]:
    pytest.importorskip("distributed")
    folder, store = tmp_path / "driver", tmp_path / "worker" / "store"
    folder.mkdir()
    store.mkdir(parents=True)
    running: list[subprocess.Popen[bytes]] = []
    address = f"tcp://{DRIVER}:{PORT}"
    paths = os.pathsep.join(path for path in sys.path if path)

    def start(*command: str) -> subprocess.Popen[bytes]:
        environment = {**os.environ, "PYTHONPATH": paths, "PLIANT_STORE": str(store)}
        with (tmp_path / "dask.log").open("ab") as log:
            running.append(
                subprocess.Popen(command, env=environment, stdout=log, stderr=log, start_new_session=True)
            )
        return running[-1]

    def worker() -> subprocess.Popen[bytes]:
        dask = f"{sys.executable} -m distributed.cli.dask_worker {address} --nthreads 1 --no-dashboard"
        place = f"--local-directory {tmp_path / 'worker'}"
        hidden = f"mount -t tmpfs none {folder} && exec {dask} {place}"
        return start("ip", "netns", "exec", NAME, "unshare", "--mount", "sh", "-c", hidden)

    try:
        if not hosts():
            pytest.skip("needs root, ip and unshare: no network namespace can be made here")
        start(sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", DRIVER, "--port", str(PORT))
        yield Hosts(address, folder, store, worker)
    finally:
        for process in running:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        call("ip", "netns", "del", NAME)
        call("ip", "link", "del", "pliant-v0")


@pytest.mark.slow
def test_a_sweep_whose_worker_is_killed_and_a_search_equal_those_in_one_process(two_hosts: Hosts) -> None:
    """The sweep is complete, with the designs that the killed worker had finished; the search finds the same."""
    apart = two_hosts.folder / "apart"
    apart.mkdir()
    alone = bench.table(api.sweep(bench.opened(apart, GRID), workers=1))
    search = two_hosts.folder / "toy.yaml"
    search.write_text(STUDY)
    best = api.optimize(api.open_study(search, store=apart / "store"), workers=1)

    worker = two_hosts.worker()
    opened = bench.opened(two_hosts.folder, GRID, "fem.delay_s=0.3")
    driver = subprocess.Popen(
        [sys.executable, "-m", "pliant", "fem", two_hosts.folder / "springs.yaml", "fem.delay_s=0.3"]
        + ["--scheduler", two_hosts.address, "--store", two_hosts.folder / "store", "--quiet"],
        cwd=two_hosts.folder,
    )
    until = time.monotonic() + 60.0
    while not list(two_hosts.store.glob("fem/*/manifest.json")) and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(worker.pid, signal.SIGKILL)
    two_hosts.worker()
    assert driver.wait(120) == 0
    found = api.sweep(opened, workers=1)
    assert all(outcome.cached for outcome in found.outcomes) and bench.same(alone, bench.table(found))
    far = api.optimize(api.open_study(search, store=two_hosts.folder / "store"), two_hosts.address)
    for one, other in zip(far.best, best.best, strict=True):
        assert (one.values, one.objectives, one.metrics) == (other.values, other.objectives, other.metrics)
