"""How late the live page of an experiment gets a sample.

    python -m benchmarks.bench.live_view
    python -m benchmarks.bench.live_view --quick     10 s of samples instead of 60 s

The folder of an experiment has eleven finished runs with verdicts, and a twelfth whose samples come in at 100 Hz, from
its beginning and after five minutes. The page's server runs in a process of its own; this program asks it as the page
does, 100 ms after each answer. The latency of a sample is the time from its line on disk to the answer that has it; the
browser's drawing is not part of it, nor the first answer, which opens the page.
"""

from __future__ import annotations

import json
import multiprocessing
import socket
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import ROOT, Bar, make_parser, write

from pliant import api
from pliant.report.diagnosis import diagnosis_json
from pliant_app.server import experiment_application, serve_until_interrupted
from pliant_bench.bench import BenchProtocol, BenchSample
from pliant_bench.loop.folder import ExperimentFolder, RoundFolder, SampleLog

PERIOD_S, ASKED_S, FINISHED_RUNS = 0.01, 0.1, 11
LATENCY_S = 0.2
TOKEN = "benchmark"
STUDY = ROOT / "examples" / "hidden_effect" / "finger.yaml"
PLAN: dict[str, Any] = {
    "kind": "chosen",
    "why": "",
    "expected_nats": 1.0,
    "purpose": "decide",
    "exposes": [],
    "minutes": 5.0,
    "specimen": "1",
    "setting": {},
}


def protocol(duration_s: float) -> BenchProtocol:
    """Return a slow wave of pressure at 100 Hz."""
    time_s = PERIOD_S * np.arange(round(duration_s / PERIOD_S) + 1, dtype=float)
    path = 7.5e3 * (1.0 - np.cos(2.0 * np.pi * np.round(duration_s / 10.0) * time_s / time_s[-1]))
    return BenchProtocol("run", "a slow wave", time_s, {"pressure_pa": path})


def verdict(store: Path) -> dict[str, Any]:
    """Return the verdict of a diagnosis of an example, as an experiment writes it."""
    opened = api.open_study(STUDY, store=store)
    diagnosis = api.diagnose(opened, api.read_measurement(opened))
    return {**diagnosis_json(diagnosis), "sentence": "", "obtained_nats": 1.0}


def experiment(path: Path, found: dict[str, Any], duration_s: float) -> tuple[ExperimentFolder, RoundFolder]:
    """Return a folder with finished runs, and its last run."""
    folder = ExperimentFolder(path)
    folder.begin({"study": "latency"})
    for _ in range(FINISHED_RUNS):
        one = folder.next_round()
        one.write_plan(protocol(60.0), PLAN)
        one.write("recording", {"ending": "complete", "words": "a slow wave", "minutes": 1.0})
        one.write("verdict", found)
    last = folder.next_round()
    last.write_plan(protocol(duration_s), PLAN)
    return folder, last


def record(path: Path, asked: BenchProtocol, before: int, count: int, ready: Any) -> None:
    """Write `before` samples at once and `count` at 100 Hz; the time at which each is on disk is its reading."""
    log = SampleLog(path, asked, ("angle_rad",))
    begun = time.monotonic()
    for k in range(before + count):
        if k == before:
            ready.set()
            begun = time.monotonic()
        if k >= before:
            time.sleep(max(begun + PERIOD_S * (k - before) - time.monotonic(), 0.0))
        due = asked.time_s[k]
        pressure = {"pressure_pa": asked.commands["pressure_pa"][k]}
        log.write(BenchSample(k, due, due, pressure, {"angle_rad": time.monotonic() % 1e4}))
    log.close()


def serve(folder: ExperimentFolder, bound: socket.socket) -> None:
    """Serve the live page."""
    serve_until_interrupted(experiment_application(folder, TOKEN), bound)


def latencies(folder: ExperimentFolder, last: RoundFolder, before: int, count: int) -> np.ndarray:
    """Return the latency of each sample written after the first answer, which opens the page, s."""
    fork = multiprocessing.get_context("fork")
    ready = fork.Event()
    with socket.create_server(("127.0.0.1", 0)) as bound:
        address = f"http://127.0.0.1:{bound.getsockname()[1]}/api/state"
        server = fork.Process(target=serve, args=(folder, bound), daemon=True)
        server.start()
        bench = fork.Process(
            target=record, args=(last.samples, last.read_protocol(), before, count, ready), daemon=True
        )
        bench.start()
        ready.wait()
        seen, have, run, opened = [], before, FINISHED_RUNS + 1, None
        while have < before + count:
            asked = urllib.request.Request(f"{address}?run={run}&since={have}&models=0")
            asked.add_header("x-pliant-token", TOKEN)
            with urllib.request.urlopen(asked) as reply:
                state = json.load(reply)["run"]
            now = time.monotonic() % 1e4
            opened = now if opened is None else opened
            written = np.deg2rad(state["series"]["angle_rad"])
            seen += (now - written[written > opened]).tolist()
            have = state["count"]
            time.sleep(ASKED_S)
        bench.join()
        server.terminate()
        server.join()
    return np.array(seen)


def main() -> None:
    """Measure, print, write benchmarks/out/bench_live_view.json."""
    quick = make_parser(__doc__, "shorter runs").parse_args().quick
    count = 1000 if quick else 6000
    results = {}
    with tempfile.TemporaryDirectory() as parent:
        found = verdict(Path(parent) / "store")
        for name, before in (("from the beginning", 0), ("after five minutes", 30_000)):
            whole_s = PERIOD_S * (before + count)
            folder, last = experiment(Path(parent) / name.replace(" ", "_"), found, whole_s)
            late_s = latencies(folder, last, before, count)
            results[name] = {
                "samples": len(late_s),
                "median_ms": 1e3 * float(np.median(late_s)),
                "quantile_999_ms": 1e3 * float(np.quantile(late_s, 0.999)),
                "largest_ms": 1e3 * float(late_s.max()),
                "verdict_kb": folder.rounds()[0].path.joinpath("verdict.json").stat().st_size / 1e3,
            }
            print(name, {key: round(value, 1) for key, value in results[name].items()})
    bars = [
        Bar(
            f"latency of 99.9 % of the samples, {name}",
            1e-3 * one["quantile_999_ms"],
            LATENCY_S,
            "ms",
            scale=1e3,
        )
        for name, one in results.items()
    ]
    write("bench_live_view", results, bars)


if __name__ == "__main__":
    main()
