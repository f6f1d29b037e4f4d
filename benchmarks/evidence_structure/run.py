"""Truth that nobody injected: the loop on a direct FEM of four modules, judged on two, three, six and eight.

    python -m benchmarks.evidence_structure.run [--extended STUDY] [--solve STATES] [--picture FILE]

`pliant improve` gets the recording of four modules (examples/clamped_chain/four.csv) and the chain of single-module
laws. The study that it writes then predicts, with `chain.modules` overridden, bodies and forces that it has not
seen. `--extended` takes a study that `improve` wrote before instead of running it; `--solve` makes the FEM states anew
(hours) and the measurement files from them.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import Bar, parser_of, write

from pliant import api
from pliant.evidence.prediction import Predictor, measurement_of_study
from pliant.interfaces.effect import EffectConfig
from pliant.records.design import Array

EXAMPLE = Path(__file__).parents[2] / "examples" / "clamped_chain"
STUDY = EXAMPLE / "arm.yaml"
TRAINING = 4
SEEN = {2: "two", 3: "three", 4: "four", 6: "six", 8: "eight"}
FALL = 3.0


@dataclass(frozen=True)
class Errors:
    """Of one file: tip (t,) in m, turn of the tip (t,) in rad, and the length of the chain."""

    tip_m: Array
    turn_rad: Array
    length_m: float


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--extended", type=Path, default=None)
    parser.add_argument("--solve", type=Path, default=None)
    parser.add_argument("--picture", type=Path, default=None)
    given = parser.parse_args()
    if given.solve:
        here = "benchmarks.evidence_structure"
        subprocess.run([sys.executable, "-m", f"{here}.solve", "--out", str(given.solve)], check=True)
        subprocess.run(
            [sys.executable, "-m", f"{here}.series", str(given.solve), "--out", str(EXAMPLE)], check=True
        )
    with tempfile.TemporaryDirectory() as folder:
        extended, found = given.extended, {}
        if extended is None:
            extended = Path(folder) / "improved.yaml"
            found = improved(extended, Path(folder) / "store")
        rows = [row_of(name, modules, extended, Path(folder) / "store") for modules, name in files()]
    for row in rows:
        print(sentence(row))
    write("evidence_structure", {"improve": found, "cases": rows}, [bar_of(rows)])
    if given.picture:
        draw(rows, given.picture)


def files() -> list[tuple[int, str]]:
    """Number of modules and stem of every recording, those that were fitted first."""
    found = [(n, f"{word}{suffix}") for n, word in SEEN.items() for suffix in ("", "_unseen")]
    there = [(n, name) for n, name in found if (EXAMPLE / f"{name}.csv").is_file()]
    return sorted(there, key=lambda item: (item[0] != TRAINING, item))


def improved(out: Path, store: Path) -> dict[str, Any]:
    """Run `pliant improve` on the recording of four modules: its JSON result."""
    result = out.with_suffix(".json")
    words = [
        str(STUDY),
        "--out",
        str(out),
        "--store",
        str(store),
        "--report",
        str(out.parent),
        "--json",
        str(result),
    ]
    subprocess.run([sys.executable, "-m", "pliant", "improve", *words], check=True)
    return json.loads(result.read_text())


def errors(study: Path, modules: int, name: str, store: Path, effects: Sequence[EffectConfig] = ()) -> Errors:
    """Of a study's chain of so many modules, with further effects, against one file."""
    overrides = [f"chain.modules={modules}", f"measurements.file={EXAMPLE / name}.csv"]
    opened = api.open_study(study, overrides, store=store)
    measured = measurement_of_study(opened.bench, opened.study, None)
    predictor = Predictor.of_study(opened.bench, opened.study, measured)
    tips, turns = [], []
    for run, said in zip(measured.runs, predictor.predict(effects), strict=True):
        missed = {key: run.outputs[key] - said[key] for key in said}
        tips.append(np.hypot(missed["tip_x_m"], missed["tip_z_m"]))
        turns.append(np.sum([missed[key] for key in missed if key.endswith("angle_rad")], axis=0))
    return Errors(np.concatenate(tips), np.concatenate(turns), predictor.chain.length_m)


def row_of(name: str, modules: int, extended: Path, store: Path) -> dict[str, Any]:
    """Root mean square and largest errors before and after; m and rad."""
    before, after = (errors(study, modules, name, store) for study in (STUDY, extended))
    row: dict[str, Any] = {"file": name, "modules": modules, "length_m": before.length_m}
    for word, one in (("plain", before), ("improved", after)):
        row |= {
            f"tip_{word}_m": float(np.sqrt(np.mean(one.tip_m**2))),
            f"tip_{word}_worst_m": float(one.tip_m.max()),
            f"turn_{word}_rad": float(np.sqrt(np.mean(one.turn_rad**2))),
        }
    return {**row, "fall": row["tip_plain_m"] / row["tip_improved_m"]}


def bar_of(rows: list[dict[str, Any]]) -> Bar:
    """The fall over all unseen numbers of modules together, in shares of the length."""
    unseen = [row for row in rows if row["modules"] != TRAINING]
    size = {
        word: np.sqrt(np.mean([(row[f"tip_{word}_m"] / row["length_m"]) ** 2 for row in unseen]))
        for word in ("plain", "improved")
    }
    fall = float(size["plain"] / size["improved"])
    return Bar("tip error on unseen numbers of modules falls by", fall, FALL, "x", at_most=False)


def sentence(row: dict[str, Any]) -> str:
    tip = [f"{1e3 * row[f'tip_{word}_m']:.2f}" for word in ("plain", "improved")]
    share = [f"{100 * row[f'tip_{word}_m'] / row['length_m']:.2f}" for word in ("plain", "improved")]
    turn = [f"{np.degrees(row[f'turn_{word}_rad']):.2f}" for word in ("plain", "improved")]
    return (
        f"{row['file']:13} tip {tip[0]} → {tip[1]} mm ({share[0]} → {share[1]} % of length), worst "
        f"{1e3 * row['tip_plain_worst_m']:.2f} → {1e3 * row['tip_improved_worst_m']:.2f} mm, turn of the tip "
        f"{turn[0]} → {turn[1]}°, fall {row['fall']:.1f} x"
    )


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Tip errors over the number of modules, before and after, forces that were fitted and twice as large ones."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained", sharey=True)
    for panel, suffix, title in zip(
        panels, ("", "_unseen"), ("forces as in training", "forces twice as large"), strict=True
    ):
        mine = sorted(
            (r for r in rows if r["file"] == SEEN[r["modules"]] + suffix), key=lambda r: r["modules"]
        )
        n = [row["modules"] for row in mine]
        for word, colour in (("plain", "tab:orange"), ("improved", "tab:blue")):
            label = {"plain": "chain of single-module laws", "improved": "after improve"}[word]
            panel.plot(n, [1e3 * row[f"tip_{word}_m"] for row in mine], "o-", color=colour, label=label)
        panel.axvline(TRAINING, color="0.7", linewidth=0.8, linestyle=":")
        panel.set(xlabel="modules", title=title, xticks=n)
    highest = max(row["tip_plain_m"] for row in rows)
    panels[0].set_ylim(0, 1.08e3 * highest)
    panels[0].annotate(
        "fitted here", (TRAINING, 0.02), xytext=(4, 3), textcoords="offset points", color="0.5"
    )
    panels[0].set_ylabel("tip error, rms (mm)")
    panels[0].legend(frameon=False, fontsize=9, loc="upper left")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
