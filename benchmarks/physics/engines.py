"""All engines, the published formulation and a Cosserat rod on the same helix in one run, as ratios.

    python -m benchmarks.physics.engines      prints, and writes benchmarks/out/physics_engines.json

20 g hang at the tip. Every case runs once in every round, so that the machine's load hits all alike; ratios are
medians over the rounds of the baseline's time by the case's. The baseline is the published formulation as a bare
script (`published.py`): 1 s of ramp and 1 s of hold, one network call per joint and axis. Times are CPU seconds of
one thread, which are those of the clock on an idle machine.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from benchmarks.output import Bar, engine, known, largest_mm, ratio, settle, write
from benchmarks.physics import cosserat, published
from benchmarks.physics.helix import (
    LOADS_KG,
    Ended,
    helix,
    helix_law,
    inputs,
    law_efforts,
    linear_law,
    residual_n_m,
    roll_history,
    run_history,
)

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw, LawRecord
from pliant_plugins.surrogates.polynomial.axes import AxesLaw

LOAD_KG = 0.020
ROUNDS = 3
BASELINE = "published formulation: bare script, networks"
COLD = "quasi-static, cold start"
POLYNOMIAL = "  the same, polynomial, all joints in one call"
PRESET = "  the same as `preset: published`, polynomial"
# Quick cases are repeated within a round, and their median is the round's time.
QUICK_REPEATS = 25
MUJOCO_STEPS_S = (2e-3, 10e-3, 12.5e-3, 1 / 64, 20e-3)
CLOSE_MM = 0.1


class Uncompiled(JointLaw):
    """A law without a scalar form, so that the quasi-static engine takes its numpy path."""

    joint = "spherical"

    def __init__(self, inner: AxesLaw) -> None:
        self.inner, self.axes, self.domain = inner, inner.axes, inner.domain
        self.actuation_name = inner.actuation_name

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        return self.inner.evaluate(actuation, deformation)

    def record(self) -> LawRecord:
        return self.inner.record()


def settled(backend: PhysicsBackend, chain: ChainModel, with_build: bool = False) -> Ended:
    """Settle from the straight chain; the time includes `apply` and `settle`, and `build` if requested."""
    start = time.process_time()
    final, cpu_s = settle(backend, chain, inputs(LOAD_KG))
    whole = time.process_time() - start
    return Ended(final.joint_angles, final.markers_m, whole if with_build else cpu_s)


def cases(law: AxesLaw, networks: published.NetworkLaw, chain: ChainModel) -> dict[str, Callable[[], Ended]]:
    """Return every case as a function that runs it once and returns the final state."""
    still, by_step = engine("quasistatic"), "mujoco, the same in a Python loop, steps of 12.5 ms"
    named: dict[str, Callable[[], Ended]] = {
        BASELINE: partial(published.run, chain, networks.efforts, LOAD_KG),
        POLYNOMIAL: partial(published.run, chain, law_efforts(law), LOAD_KG),
        PRESET: lambda: run_history(engine("pybullet", preset="published"), chain, LOAD_KG, published.STEP_S),
        COLD: partial(settled, still, chain),
        "quasi-static, building the chain's model included": partial(settled, still, chain, True),
        "quasi-static, numpy instead of compiled": lambda: settled(still, helix(Uncompiled(law))),
    }
    for step in MUJOCO_STEPS_S:
        backend = engine("mujoco", timestep_s=step)
        name = f"mujoco, the same history, steps of {1e3 * step:.4g} ms"
        named[name] = partial(roll_history, backend, chain, LOAD_KG, step)
    named[by_step] = partial(run_history, engine("mujoco", timestep_s=12.5e-3), chain, LOAD_KG, 12.5e-3)
    for kind in ("mujoco", "pybullet"):
        named[f"{kind}, settle"] = partial(settled, engine(kind), chain)
    return named


def main() -> None:
    law = helix_law()
    networks, chain = published.network_law(law), helix(law)
    errors = published.fit_errors(law, networks)
    shown = ", ".join(f"{a} {100 * e:.2f} %" for a, e in errors.items())
    print(f"networks 2-64-64-1: RMS error of the range {shown}")
    equilibrium = settled(engine("quasistatic"), chain)
    named = cases(law, networks, chain)
    for name, case in named.items():  # compiles, and fills caches
        if not name.startswith(("pub", "  ")):
            case()
    ends, seconds = rounds(named)
    bars, rows = table(chain, equilibrium, ends, seconds)
    rods = rod_rows(seconds[BASELINE])
    histories, history_bar = mujoco_histories(chain, seconds[BASELINE])
    results = {"cases": rows, "rod": rods, "mujoco_histories": histories, "network_errors": errors}
    write("physics_engines", results, [*bars, history_bar])


def rounds(named: Mapping[str, Callable[[], Ended]]) -> tuple[dict[str, Ended], dict[str, list[float]]]:
    """Run all rounds; return each case's final state and its seconds in every round."""
    ends: dict[str, Ended] = {}
    seconds: dict[str, list[float]] = {name: [] for name in named}
    for number in range(ROUNDS):
        for name, case in named.items():
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
    """Print and return every case and the bar on the quasi-static engine."""
    print(f"{'20 g at the tip, 15 kPa':52s} {'CPU s':>9} {'ratio':>9} {'residual N·m':>13} {'away mm':>9}")
    rows: dict[str, Any] = {}
    for name, end in ends.items():
        rows[name] = row = {
            "median_s": statistics.median(seconds[name]),
            "ratio": ratio(seconds[BASELINE], seconds[name]),
            "residual_n_m": residual_n_m(chain, end.angles_rad, LOAD_KG),
            "away_mm": largest_mm(end.markers_m, equilibrium.markers_m),
            "seconds": seconds[name],
        }
        cells = f"{row['residual_n_m']:13.1e} {row['away_mm']:9.2g}"
        print(f"{name:52s} {row['median_s']:9.2g} {row['ratio']:9.1f} {cells}", flush=True)
    cold, against = rows[COLD], "quasi-static, cold start, against the published 2 s run"
    return [
        Bar(against, cold["ratio"], 1e4, "×", at_most=False),
        Bar("its residual by the common statics", cold["residual_n_m"], 1e-9, "N·m"),
    ], rows


def rod_rows(baseline: list[float]) -> dict[str, Any]:
    """Run PyElastica, tuned for speed, on the linear-law helix without its end cylinder, and the engines."""
    law, still = linear_law(), engine("quasistatic")
    chain = helix(law, end_cylinder=False)
    cosserat.settle_rod(law, LOAD_KG, cosserat.COMPILING)
    settled(still, chain)
    rows: dict[str, Any] = {"PyElastica": [], "quasi-static": []}
    for _ in range(ROUNDS):
        rod = cosserat.settle_rod(law, LOAD_KG, cosserat.FAST)
        rows["PyElastica"].append(rod.settled_after_s(1e-4))
        quick = [settled(still, chain).cpu_s for _ in range(QUICK_REPEATS)]
        rows["quasi-static"].append(statistics.median(quick))
    times, rod_s = ratio(rows["PyElastica"], rows["quasi-static"]), statistics.median(rows["PyElastica"])
    print(
        f"linear law: PyElastica has its tip within 0.1 mm of rest after {rod_s:.2g} s, {times:.0f} × the "
        f"quasi-static engine and 1/{statistics.median(baseline) / rod_s:.0f} of the baseline"
    )
    return {**rows, "rod_over_quasistatic": times}


def mujoco_histories(chain: ChainModel, baseline: list[float]) -> tuple[list[dict[str, Any]], Bar]:
    """Run MuJoCo's 2 s history under all loads at every step; the bar is on the fastest step close under all."""
    print(
        "MuJoCo with its defaults but for the step: mm from equilibrium after the same 2 s (ratio to the baseline)"
    )
    print(f"{'step':>8} " + "".join(f"{1e3 * load:14.0f} g" for load in LOADS_KG))
    still = engine("quasistatic")
    rest = {load: settle(still, chain, inputs(load))[0].markers_m for load in LOADS_KG}
    rows: list[dict[str, Any]] = []
    reached = 0.0
    for step in MUJOCO_STEPS_S:
        backend, cells = engine("mujoco", timestep_s=step), []
        for load in LOADS_KG:
            runs = [roll_history(backend, chain, load, step) for _ in range(2 * ROUNDS + 1)]
            wall = statistics.median(run.cpu_s for run in runs)
            away = largest_mm(runs[-1].markers_m, rest[load])
            times = statistics.median(baseline) / wall
            cells.append({"load_kg": load, "step_s": step, "cpu_s": wall, "away_mm": away, "ratio": times})
        rows += cells
        shown = "".join(f"{c['away_mm']:8.3f} ({c['ratio']:5.0f})" for c in cells)
        print(f"{1e3 * step:5.3g} ms {shown}", flush=True)
        if all(cell["away_mm"] <= CLOSE_MM for cell in cells):
            reached = max(reached, min(cell["ratio"] for cell in cells))
    text = "MuJoCo, the same history, within 0.1 mm under every load, slowest load"
    return rows, Bar(text, reached, 500.0, "×", at_most=False)


if __name__ == "__main__":
    if known("pybullet"):  # all ratios are to it
        main()
