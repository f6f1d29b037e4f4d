"""Runs of the menu, done by a set's own truth after its own runs: what a bench would record if it did as proposed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from benchmarks.evidence import noise
from benchmarks.evidence.protocols import Run, protocol
from benchmarks.evidence.robots import PRESSURE_MAX_PA, ROBOTS, Robot
from benchmarks.evidence.sets import MeasuredSet, SetSpec, follow, noise_sizes, to_csv
from benchmarks.evidence.strengths import draw

from pliant.experiments.planned_run import PlannedRun


def bench_run(run: PlannedRun, robot: Robot, number: int = 1) -> Run:
    """The menu's run as the bench does it: same inputs, loads and conditions; `number` names a new specimen."""
    history = run.history
    assert history.time_s is not None
    roll, pitch, yaw = (float(angle) for angle in history.base_angles_rad[0])
    return Run(
        run.name,
        f"new {number}" if run.new_specimen else history.specimen,
        history.actuation[robot.drive] * (PRESSURE_MAX_PA / robot.drive_max),
        history.moment_n_m,
        temperature_c=float(history.temperature_c[0]),
        base_angles_rad=(roll, pitch, yaw),
        valve_open=history.valve_open,
        second=bool(run.adds),
        time_s=history.time_s,
    )


def added_csv(spec: SetSpec, made: MeasuredSet, runs: Sequence[PlannedRun], seed: int = 0) -> str:
    """The CSV of these runs alone, recorded after those of the set: `pliant diagnose --data set.csv --data added.csv`.

    The truth, its strength and the noise's size are those of the set; the noise is new, and the same for the same
    seed.
    """
    robot, before = ROBOTS[spec.robot], protocol(spec.protocol, ROBOTS[spec.robot])
    truth = draw(spec.kind, spec.engine, robot, spec.split, spec.generator())
    added = [bench_run(run, robot, number) for number, run in enumerate(runs, 1)]
    every = (*before, *added)
    rng = np.random.default_rng([seed, *spec.generator().integers(0, 2**31, 4)])
    slips = rng.standard_normal(len(every))
    read = follow(spec.engine, robot, every, truth.at(*made.label["strengths"]), slips)[len(before) :]
    sigma = noise_sizes(read) | made.sigma
    names = list(dict.fromkeys(name for run in read for name in run))
    drawn = {
        name: noise.draw(noise.SPECTRA[spec.split], [run.time_s for run in added], rng) for name in names
    }
    noisy = [
        {name: values + sigma[name] * drawn[name][k] for name, values in run.items()}
        for k, run in enumerate(read)
    ]
    return to_csv(tuple(added), noisy, robot)
