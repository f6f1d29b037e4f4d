"""Pictures of the two-bellow case for docs/what_real_data_taught_us.md.

python -m benchmarks.real.two_bellow_pictures    writes docs/pictures/two_bellow_*.png
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from benchmarks.output import ROOT
from benchmarks.real.one_run import OneRun, Step
from benchmarks.real.two_bellow import DIRECTIONS, baselines, best
from benchmarks.real.two_bellow_data import FILE, Bench, StaticLaw, open_bench
from matplotlib.axes import Axes

from pliant.diagnosis.candidates import candidate_kinds
from pliant.records.design import Array

PICTURES = ROOT / "docs" / "pictures"
MEASURED, STATIC, IMPROVED = "black", "#d98c3f", "#2f6fb0"
WIDTH = 9.0


def main() -> None:
    if not FILE.is_file():
        print(f"skipped: {FILE} is not here")
        return
    with tempfile.TemporaryDirectory() as folder:
        bench = open_bench(Path(folder))
        found = {}
        for training, unseen in DIRECTIONS:
            law = best(baselines(bench, training))
            kinds = candidate_kinds(bench.opened.bench.registry)
            last = list(OneRun(bench.opened.bench, bench.runs[training], kinds).steps(bench.opened.study))[-1]
            found[unseen] = (training, law, last)
        in_time(bench, found)
        loops(bench, found)


Found = dict[str, tuple[str, StaticLaw, Step]]


def in_time(bench: Bench, found: Found) -> None:
    """The run that was not fitted: angle and error."""
    figure, panels = plt.subplots(4, 1, figsize=(WIDTH, 9.5), sharex=True, height_ratios=(2, 1, 2, 1))
    for k, (unseen, (training, law, last)) in enumerate(found.items()):
        time = bench.history(unseen).time_s
        measured, models = bench.measured(unseen), predictions(bench, unseen, law, last)
        upper, lower = panels[2 * k], panels[2 * k + 1]
        upper.set_title(f"run {unseen}; models fitted to run {training} only", loc="left", fontsize=10)
        upper.plot(time, measured, color=MEASURED, lw=1.3, label="measured")
        for name, colour, model in models:
            upper.plot(time, model, color=colour, lw=1.3, label=name)
            lower.plot(time, measured - model, color=colour, lw=1.1)
        lower.axhline(0, color="0.6", lw=0.8)
        upper.set_ylabel("bending angle (rad)")
        lower.set_ylabel("error (rad)")
        upper.legend(frameon=False, fontsize=8, loc="upper right")
    panels[-1].set_xlabel("time (s)")
    save(figure, panels, "two_bellow_in_time.png")


def loops(bench: Bench, found: Found) -> None:
    """Angle over pressure difference."""
    figure, panels = plt.subplots(1, 2, figsize=(WIDTH, 4.3))
    for panel, (unseen, (training, law, last)) in zip(panels, found.items(), strict=True):
        first, second = bench.pressures(unseen)
        across = 1e-3 * (first - second)
        panel.plot(across, bench.measured(unseen), color=MEASURED, lw=1.3, label="measured")
        for name, colour, model in predictions(bench, unseen, law, last):
            panel.plot(across, model, color=colour, lw=1.1, label=name)
        panel.set_title(f"run {unseen}, fitted on {training}", loc="left", fontsize=10)
        panel.set_xlabel("pressure 1 − pressure 2 (kPa)")
        panel.set_ylabel("bending angle (rad)")
        panel.legend(frameon=False, fontsize=8, loc="upper left")
    save(figure, panels, "two_bellow_loops.png")


def predictions(bench: Bench, run: str, law: StaticLaw, last: Step) -> list[tuple[str, str, Array]]:
    """Name, colour and (t,) angle of both models."""
    improved = bench.measured(run) - bench.error(last.study, run)
    return [
        (f"static law, degree {law.degree}", STATIC, law.predict(*bench.pressures(run))),
        ("with effects", IMPROVED, improved),
    ]


def save(figure: plt.Figure, panels: Sequence[Axes], name: str) -> None:
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(PICTURES / name, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
