"""Experiments that are killed at random moments and resumed: same verdict, no sample lost.

    python -m benchmarks.bench.killed --kills 100

Each trial runs `pliant experiment`'s loop on the simulated bench in a process of its own, kills it with SIGKILL after a
random share of the time that an uninterrupted loop takes, resumes it in another process, and compares. The result is
in benchmarks/out/bench_killed.json.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant import api
from pliant_bench.choose import SearchEffort
from pliant_bench.loop.experiment import Experiment
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.person import Nobody
from pliant_bench.loop.planner import TellingPlanner, model_inputs
from pliant_bench.loop.rounds import run_rounds

OUT = Path(__file__).parents[1] / "out" / "bench_killed.json"
KINDS = ("viscous_damping", "sensor_scale", "friction_hysteresis")
EFFORT = SearchEffort(random=8, elsewhere=2, settings=1, generations=1, children=4)
JOINT = """\
pliant: 1
name: {name}
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {{k_n: 1.637e-06, m_a: -1.704e-06, m_e: 0.1012, b_e: 0.0245}}
law_error: 0.5 %
chain: {{modules: 1, module_length: 80 mm, module_mass: 40 g}}
physics: quasistatic
task: {{kind: free_bending, pressure: 15 kPa}}
"""
BENCH = """\
bench: {kind: simulated, truth: truth.yaml, noise: {angle_rad: 0.3 deg}, speed: 20}
experiment:
  inputs: {pressure_pa: {low: 0 kPa, high: 15 kPa, rate: 15 kPa/s}}
  period: 0.1 s
  longest_run: 60 s
  silence: 100 s
  rounds: 2
"""
TRUTH = "effects: [{kind: viscous_damping, time: 0.3 s}]\n"


def do_experiment(study: Path, folder: Path) -> None:
    """Run or resume the loop of an experiment to its end."""
    opened = api.open_study(study, store=study.parent / "store")
    settings, bench = opened.study.experiment, opened.context.build("bench", opened.study.bench)
    bench.connect()
    experiment = ExperimentFolder(folder)
    experiment.begin({"study": opened.study.name})
    planner = TellingPlanner(opened, settings, bench, EFFORT)
    run_rounds(
        Experiment(opened, settings, bench, experiment, model_inputs(opened), KINDS, planner, Nobody())
    )


def killed_after(study: Path, folder: Path, seconds: float) -> bool:
    """Run the loop in a process and kill it after so many seconds; return whether it was still running."""
    process = _process(study, folder)
    process.join(seconds)
    alive = process.is_alive()
    if alive and process.pid is not None:
        os.kill(process.pid, signal.SIGKILL)
    process.join()
    return alive


def finished(study: Path, folder: Path) -> float:
    """Run the loop in a process to its end; return the seconds it took."""
    started = time.perf_counter()
    process = _process(study, folder)
    process.join()
    if process.exitcode != 0:
        raise RuntimeError(f"the experiment in {folder} ended with {process.exitcode}")
    return time.perf_counter() - started


def _process(study: Path, folder: Path) -> Any:
    process = multiprocessing.get_context("fork").Process(target=do_experiment, args=(study, folder))
    process.start()
    return process


def conclusion(folder: Path) -> tuple[str, tuple[str, ...]]:
    """Return the last verdict and its effects."""
    verdicts = [one for f in ExperimentFolder(folder).rounds() if (one := f.read("verdict")) is not None]
    return verdicts[-1]["verdict"], tuple(verdicts[-1]["selected"])


def sample_rows(folder: Path) -> dict[int, list[str]]:
    """Return the whole lines of every sample file by the number of its run."""
    rounds = ExperimentFolder(folder).rounds()
    texts = {one.number: one.samples.read_text() for one in rounds if one.samples.exists()}
    return {number: text[: text.rfind("\n") + 1].splitlines() for number, text in texts.items()}


def trials(kills: int, seed: int) -> dict[str, Any]:
    """Return how many of the killed experiments ended with the same verdict, and how many lost a sample."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as text:
        root = Path(text)
        study = root / "study.yaml"
        study.write_text(JOINT.format(name="joint") + BENCH)
        (root / "truth.yaml").write_text(JOINT.format(name="truth") + TRUTH)
        do_experiment(study, root / "warm")  # compiles before the processes are forked
        whole_s = finished(study, root / "whole")
        same = lost = done = interrupted_runs = 0
        while done < kills:
            folder = root / f"killed_{done}"
            if not killed_after(study, folder, whole_s * rng.uniform()):
                continue
            done += 1
            before = sample_rows(folder)
            finished(study, folder)
            after = sample_rows(folder)
            lost += any(after[number][: len(rows)] != rows for number, rows in before.items())
            same += conclusion(folder) == conclusion(root / "whole")
            ends = [(one.read("recording") or {})["ending"] for one in ExperimentFolder(folder).rounds()]
            interrupted_runs += "lost" in ends
            print(f"{done}/{kills}: {same} with the same verdict, {lost} with lost samples", flush=True)
    return {
        "kills": kills,
        "seed": seed,
        "same_verdict": same,
        "lost_samples": lost,
        "killed_within_a_run": interrupted_runs,
        "whole_s": whole_s,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print and write the result."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    result = trials(asked.kills, asked.seed)
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
