"""A clamped silicone beam that is released, with and without 52 g at its tip: free swings against a calibrated rubber.

python -m benchmarks.real.silicone_beam     prints, and writes benchmarks/out/silicone_beam.json

Stated: 94 mm from base to tip markers, 1070 kg/m³, E 263.8 kPa as its authors' simulation found it. Not stated: the
section, the camera's pose, and how the beam was held: it is at rest and straight before it falls, and is assumed to be
held there at its end. The instant of release is when the first marker has moved by 0.3 mm, by the same rule in every
run: it is an input of the free swing and is not scored. Stiffness and mass follow from the two sags of the training
runs. Every marker has a separate zero in every run. The pneumatic arm of the same folder (`arm_…`) has no record of its
pressure over time and is not used.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.real import splits
from benchmarks.real.five import run_bench_script
from benchmarks.real.measured_bench import MeasuredBench
from benchmarks.real.splits import Part

from pliant.records.measurement import Measurement

LENGTH_M, JOINTS, LOAD_KG, GRAVITY = 94e-3, 4, 52e-3, 9.81
MOVED_M = 3e-4
CHAIN = """
pliant: 1
name: silicone-beam
surrogate: {kind: polynomial, form: study, odd: true, coefficients: {k_n: 1e-9, m_a: 0, m_e: 0, b_e: {stiffness}}}
chain:
  modules: 4
  module_length: 23.5 mm
  module_mass: {module_mass}
  base: {direction: [1, 0, 0]}
physics: quasistatic
"""
TIPS = [f"marker_{k}_{axis}_m" for k in (1, 2, 3) for axis in "xyz"]


def notes(part: Part) -> Mapping[str, Any]:
    """Return information that the files of a part lack: loads, time of release, markers, frame and zeros."""
    paths = splits.files("silicone_beam", part, "beam_")
    loads = {path.stem: {"pressure_pa": 0.0} for path in paths}
    for run in loads:
        if "load52" in run:
            loads[run]["payload"] = "52 g"  # type: ignore[assignment]
    return {
        "outputs": TIPS,
        "markers": ["94 mm"] * 3 + ["0 mm"] * 3,
        # above the middle of the base's markers, seen in the camera's vertical
        "marker_offsets": [["0 mm", "0 mm", f"{z} mm"] for z in (-12, -1, 17)] + [["0 mm"] * 3] * 3,
        "frame": {"turn": "unknown"},
        "zero": dict.fromkeys(TIPS, "per run"),
        "runs": loads,
        "let_go": {path.stem: {"at": f"{release_s(path):.4f} s", "bend": "0 deg"} for path in paths},
    }


def release_s(path: Path) -> float:
    """Return the last instant before the first marker has moved by 0.3 mm from its initial position."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    place = np.array([[float(row[f"marker_1_{axis}_m"] or "nan") for axis in "xyz"] for row in rows])
    moved = np.linalg.norm(place - np.nanmedian(place[:10], axis=0), axis=1) > MOVED_M
    return float(rows[max(int(np.flatnonzero(moved)[0]) - 1, 0)]["time_s"])


def fit(bench: MeasuredBench, measurement: Measurement) -> dict[str, float]:
    """Return the stiffness of a joint and the mass of a module from the sags with and without the load."""
    sags = {run.name: sag_m(run) for run in measurement.runs}
    plain = float(np.mean([sag for name, sag in sags.items() if "gravity" in name]))
    loaded = float(np.mean([sag for name, sag in sags.items() if "load52" in name]))
    arms = LENGTH_M / JOINTS * (np.arange(JOINTS) + 0.5)  # from each joint to the tip
    stiffness = LOAD_KG * GRAVITY * float((arms**2).sum()) / (loaded - plain)
    weight = plain * stiffness / (float((arms**3).sum()) / (2 * LENGTH_M))
    return {"stiffness": stiffness, "module_mass": weight / GRAVITY / JOINTS}


def sag_m(run: Any) -> float:
    """Return how far the second marker hangs at the end below where it was held, m."""
    place = np.stack([run.outputs[f"marker_2_{axis}_m"] for axis in "xyz"], axis=1)
    held = run.history.time_s <= run.history.let_go.until_s
    end = np.nanmedian(place[-50:], axis=0)
    return float(np.linalg.norm(end - np.nanmedian(place[held], axis=0)))


BENCH = MeasuredBench("silicone_beam", CHAIN, notes, fit, only="beam_", inputs=("pressure_pa",))

if __name__ == "__main__":
    run_bench_script(BENCH, __doc__)
