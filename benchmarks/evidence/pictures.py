"""Pictures of hidden truths, for the eye: does each effect look as it should?

    python benchmarks/evidence/pictures.py FOLDER [KIND ...]

One PNG per kind: loops of angle over pressure (virgin, slow, fast), the change in a hold and in the load steps, and the
change over the runs in σ, without noise and with it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from benchmarks.evidence.protocols import protocol
from benchmarks.evidence.sets import MeasuredSet, SetSpec, make_set
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN

LOOPS = ("virgin", "slow", "fast")
SNR = 2.5


def draw(spec: SetSpec, path: Path) -> None:
    """Write the picture of one set."""
    made, runs = make_set(spec), protocol(spec.protocol)
    first = {run.condition: i for i, run in reversed(list(enumerate(runs)))}
    figure, axes = plt.subplots(2, 3, figsize=(15, 8), layout="constrained")
    for axis, condition in zip(axes[0], LOOPS, strict=True):
        i = first[condition]
        kilopascals = runs[i].pressure_pa / 1e3
        axis.plot(kilopascals, made.clean[i]["angle_rad"], "k:", lw=1, label="without")
        axis.plot(kilopascals, made.hidden[i]["angle_rad"], "C0", lw=1, label="with")
        axis.set(title=condition, xlabel="pressure, kPa", ylabel="angle, rad")
    axes[0, 0].legend()
    for axis, condition in zip(axes[1], ("holds", "load steps"), strict=False):
        i = first[condition]
        axis.plot(runs[i].time_s, _change(made, i), "C0", lw=1)
        axis.plot(runs[i].time_s, _change(made, i, noise=True), "C1.", ms=2, alpha=0.5)
        axis.set(title=condition, xlabel="time, s", ylabel="change, σ")
    _runs(axes[1, 2], made, runs)
    label = made.label
    figure.suptitle(
        f"{spec.kind} in {spec.engine}: strength {label['strengths']}, {label['snr_reached']:.2f} σ RMS"
    )
    figure.savefig(path, dpi=70)
    plt.close(figure)


def _change(made: MeasuredSet, run: int, noise: bool = False) -> Any:
    """Effect's change in σ of the angle."""
    table = [line.split(",") for line in made.csv.splitlines()]
    if noise:
        column = table[0].index("angle_rad")
        rows = np.array([float(row[column]) for row in table[1:] if row[0] == f"r{run + 1:02d}"])
    else:
        rows = made.hidden[run]["angle_rad"]
    return (rows - made.clean[run]["angle_rad"]) / made.sigma["angle_rad"]


def _runs(axis: Any, made: MeasuredSet, runs: Any) -> None:
    start = 0
    for i, run in enumerate(runs):
        axis.plot(start + np.arange(len(run)), _change(made, i), lw=1)
        axis.text(start, 0.02, run.condition, rotation=90, fontsize=6, transform=axis.get_xaxis_transform())
        start += len(run)
    axis.set(title="all runs", xlabel="sample", ylabel="change, σ")


def main(folder: str, *kinds: str) -> None:
    """Pictures of these kinds, or of all, in both engines."""
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for kind in kinds or (CLEAN, *KINDS, *UNKNOWN):
        for engine in ("functional", "mujoco"):
            draw(SetSpec(kind, 1, engine, snr=SNR), target / f"{kind}_{engine}.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
