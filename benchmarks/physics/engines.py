"""All engines, the published formulation and a Cosserat rod on the same helix in one run, as ratios.

    python -m benchmarks.physics.engines      prints, and writes benchmarks/out/physics_engines.json

20 g hang at the tip. Every case runs once in every round, so that the machine's load hits all alike; ratios are
medians over the rounds of the baseline's time by the case's. The baseline is the published formulation as a bare
script (`published.py`): 1 s of ramp and 1 s of hold, one network call per joint and axis. Times are CPU seconds of
one thread, which are those of the clock on an idle machine.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from benchmarks.output import Bar, ratio, write
from benchmarks.physics import cosserat, published
from benchmarks.physics.helix import LOADS_KG, helix, helix_law, inputs, linear_law
from benchmarks.physics.histories import Ended, away_mm, residual_n_m, roll_history, run_history
from benchmarks.physics.network import NetworkLaw, fit_errors, network_law

from pliant.errors import MissingDependencyError
from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.surrogates.polynomial.axes import AxesLaw

LOAD_KG = 0.020
ROUNDS = 3
BASELINE = "published formulation: bare script, networks"
COLD = "quasi-static, cold start"
PRESET = "  the same as `preset: published`, polynomial"
# Quick cases are repeated within a round, and their median is the round's time.
QUICK_REPEATS = 25
MUJOCO_STEPS_S = (2e-3, 10e-3, 12.5e-3, 1 / 64, 20e-3)
CLOSE_MM = 0.1


@dataclass(frozen=True, eq=False)
class Uncompiled(JointLaw):
    """A law without a scalar form, so that the quasi-static engine takes its numpy path."""

    inner: AxesLaw
    axes: tuple[str, ...] = ("x", "y", "z")
    joint: Any = "spherical"
    actuation_name: str = "pressure_pa"
    domain: Any = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "domain", self.inner.domain)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        return self.inner.evaluate(actuation, deformation)

    def scalar(self) -> ScalarLaw | None:
        return None

    def record(self) -> LawRecord:
        return self.inner.record()


class Cases:
    """Every contestant, as a function that runs it once and tells where it ended."""

    def __init__(self) -> None:
        self.law = helix_law()
        self.networks: NetworkLaw = network_law(self.law)
        self.chain = helix(self.law)
        quasistatic = Quasistatic(QuasistaticConfig())
        self.named: dict[str, Callable[[], Ended]] = {
            BASELINE: lambda: self.script(self.networks.efforts),
            "  the same, polynomial, all joints in one call": lambda: self.script(self.polynomial),
            PRESET: self.preset,
            COLD: lambda: settled(quasistatic, self.chain, False),
            "quasi-static, building the chain's model included": lambda: settled(
                quasistatic, self.chain, True
            ),
            "quasi-static, numpy instead of compiled": lambda: settled(
                Quasistatic(QuasistaticConfig()), helix(Uncompiled(self.law)), False
            ),
        }
        for step in MUJOCO_STEPS_S:
            name = f"mujoco, the same history, steps of {1e3 * step:.4g} ms"
            self.named[name] = partial(self.mujoco, step)
        by_step = "mujoco, the same in a Python loop, steps of 12.5 ms"
        self.named[by_step] = lambda: run_history(
            Mujoco(MujocoConfig(timestep_s=12.5e-3)), self.chain, LOAD_KG, 12.5e-3
        )
        self.named["mujoco, settle"] = lambda: settled(Mujoco(MujocoConfig()), self.chain, False)
        self.named["pybullet, settle"] = lambda: settled(Pybullet(PybulletConfig()), self.chain, False)

    def script(self, efforts: published.Efforts) -> Ended:
        done = published.run(self.chain, efforts, LOAD_KG)
        return Ended(done.angles_rad, done.markers_m, done.cpu_s)

    def polynomial(self, pressure_pa: float, angles_rad: Array) -> Array:
        return self.law.evaluate(np.full(len(angles_rad), pressure_pa), angles_rad).tau

    def preset(self) -> Ended:
        backend = Pybullet(PybulletConfig(preset="published"))
        return run_history(backend, self.chain, LOAD_KG, published.STEP_S)

    def mujoco(self, step_s: float) -> Ended:
        return roll_history(Mujoco(MujocoConfig(timestep_s=step_s)), self.chain, LOAD_KG, step_s)


def settled(backend: PhysicsBackend, chain: ChainModel, with_build: bool) -> Ended:
    """The equilibrium from the straight chain, `apply` and `settle` counted, `build` if asked."""
    start = time.process_time()
    with backend.build(chain) as simulation:
        if not with_build:
            start = time.process_time()
        simulation.apply(inputs(LOAD_KG))
        final = simulation.settle()
        return Ended(final.joint_angles, final.markers_m, time.process_time() - start)


def main() -> None:
    """Warm up, run the rounds, print the tables."""
    cases = Cases()
    errors = fit_errors(cases.law, cases.networks)
    print(
        "networks 2-64-64-1: RMS error of the range "
        + ", ".join(f"{a} {100 * e:.2f} %" for a, e in errors.items())
    )
    equilibrium = settled(Quasistatic(QuasistaticConfig()), cases.chain, False)
    for name, case in cases.named.items():  # compiles, and fills caches
        if not name.startswith(("pub", "  ")):
            case()
    ends, seconds = rounds(cases.named)
    bars, rows = table(cases.chain, equilibrium, ends, seconds)
    rods = rod_rows(seconds[BASELINE])
    histories, history_bar = mujoco_histories(cases, seconds[BASELINE])
    results = {"cases": rows, "rod": rods, "mujoco_histories": histories, "network_errors": errors}
    write("physics_engines", results, [*bars, history_bar])


def rounds(cases: Mapping[str, Callable[[], Ended]]) -> tuple[dict[str, Ended], dict[str, list[float]]]:
    """Where each case ends, and its seconds in every round."""
    ends: dict[str, Ended] = {}
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(ROUNDS):
        for name, case in cases.items():
            if name == PRESET and number:  # half a minute, and no ratio hangs on it
                continue
            ends[name] = case()
            quick = ends[name].cpu_s < 0.05
            again = [case().cpu_s for _ in range(QUICK_REPEATS if quick else 0)]
            seconds[name].append(statistics.median([ends[name].cpu_s, *again]))
    return ends, seconds


def table(
    chain: ChainModel, equilibrium: Ended, ends: Mapping[str, Ended], seconds: Mapping[str, list[float]]
) -> tuple[list[Bar], dict[str, Any]]:
    """Prints and returns every case; the bar on the quasi-static engine."""
    print(f"{'20 g at the tip, 15 kPa':52s} {'CPU s':>9} {'ratio':>9} {'residual N·m':>13} {'away mm':>9}")
    rows: dict[str, Any] = {}
    for name, end in ends.items():
        residual = residual_n_m(chain, end.angles_rad, LOAD_KG)
        row = {
            "median_s": statistics.median(seconds[name]),
            "ratio": ratio(seconds[BASELINE], seconds[name]),
            "residual_n_m": residual,
            "away_mm": away_mm(end.markers_m, equilibrium.markers_m),
            "seconds": seconds[name],
        }
        rows[name] = row
        print(
            f"{name:52s} {row['median_s']:9.2g} {row['ratio']:9.1f} {residual:13.1e} {row['away_mm']:9.2g}",
            flush=True,
        )
    cold = rows[COLD]
    bars = [
        Bar(
            "quasi-static, cold start, against the published 2 s run", cold["ratio"], 1e4, "×", at_most=False
        ),
        Bar("its residual by the common statics", cold["residual_n_m"], 1e-9, "N·m", at_most=True),
    ]
    return bars, rows


def rod_rows(baseline: list[float]) -> dict[str, Any]:
    """PyElastica, tuned for speed, on the linear-law helix without its end cylinder, and the engines on the same."""
    law = linear_law()
    chain = helix(law, end_cylinder=False)
    cosserat.settle_rod(law, LOAD_KG, cosserat.COMPILING)
    quasistatic = Quasistatic(QuasistaticConfig())
    settled(quasistatic, chain, False)
    rows: dict[str, Any] = {"PyElastica": [], "quasi-static": []}
    for _ in range(ROUNDS):
        rod = cosserat.settle_rod(law, LOAD_KG, cosserat.FAST)
        rows["PyElastica"].append(rod.settled_after_s(1e-4))
        quick = [settled(quasistatic, chain, False).cpu_s for _ in range(QUICK_REPEATS)]
        rows["quasi-static"].append(statistics.median(quick))
    times = ratio(rows["PyElastica"], rows["quasi-static"])
    rod_s = statistics.median(rows["PyElastica"])
    print(
        f"linear law: PyElastica has its tip within 0.1 mm of rest after {rod_s:.2g} s, {times:.0f} × the "
        f"quasi-static engine and 1/{statistics.median(baseline) / rod_s:.0f} of the baseline"
    )
    return {**rows, "rod_over_quasistatic": times}


def mujoco_histories(cases: Cases, baseline: list[float]) -> tuple[list[dict[str, Any]], Bar]:
    """MuJoCo's 2 s run under all loads at every step; the bar is on the fastest step that is close under all."""
    print(
        "MuJoCo with its defaults but for the step: mm from equilibrium after the same 2 s (ratio to the baseline)"
    )
    print(f"{'step':>8} " + "".join(f"{1e3 * load:14.0f} g" for load in LOADS_KG))
    rest = {load: _rest(cases.chain, load) for load in LOADS_KG}
    rows, reached = [], 0.0
    for step in MUJOCO_STEPS_S:
        backend = Mujoco(MujocoConfig(timestep_s=step))
        cells = []
        for load in LOADS_KG:
            runs = [roll_history(backend, cases.chain, load, step) for _ in range(2 * ROUNDS + 1)]
            wall = statistics.median(run.cpu_s for run in runs)
            away = away_mm(runs[-1].markers_m, rest[load])
            cells.append(
                {
                    "load_kg": load,
                    "step_s": step,
                    "cpu_s": wall,
                    "away_mm": away,
                    "ratio": statistics.median(baseline) / wall,
                }
            )
        rows += cells
        print(
            f"{1e3 * step:5.3g} ms " + "".join(f"{c['away_mm']:8.3f} ({c['ratio']:5.0f})" for c in cells),
            flush=True,
        )
        if all(cell["away_mm"] <= CLOSE_MM for cell in cells):
            reached = max(reached, min(cell["ratio"] for cell in cells))
    text = "MuJoCo, the same history, within 0.1 mm under every load, slowest load"
    return rows, Bar(text, reached, 500.0, "×", at_most=False)


def _rest(chain: ChainModel, load_kg: float) -> Array:
    with Quasistatic(QuasistaticConfig()).build(chain) as still:
        still.apply(inputs(load_kg))
        return still.settle().markers_m


if __name__ == "__main__":
    try:
        main()
    except MissingDependencyError as error:
        print(f"skipped, for all ratios are to PyBullet: {error}")
