"""Pictures of the bench's results: confusion matrix, stated against true, share that is right by strength."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from benchmarks.evidence.judge import ANOTHER_CLASS, ITS_CLASS
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN

SHORT = {
    "missing_effect": "missing",
    "nothing_missing": "nothing",
    "unknown_effect": "unknown",
    "not_repeatable": "not repeatable",
    "insufficient_data": "insufficient",
}
SEVERAL = "several effects"
INK, GREY, BLUE, ORANGE = "#222222", "#9a9a9a", "#1f77b4", "#d95f02"
VERDICTS = ("nothing_missing", "ambiguous", "unknown_effect", "not_repeatable", "insufficient_data")


def draw_all(data: dict[str, Any], folder: Path) -> None:
    """Draw the three pictures as PNG files; none without answers."""
    if not data["n"]:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for draw in (confusion, reliability, strength):
        figure = draw(data)
        figure.savefig(folder / f"bench_{draw.__name__}.png", dpi=90)
        plt.close(figure)


def matrix(data: dict[str, Any]) -> tuple[list[str], list[str], np.ndarray]:
    """Return rows (hidden), columns (answered), shares of each row in %."""
    groups = (data["confusion"].get(group, {}) for group in ("effect", "clean", "unknown"))
    rows = {kind: row for group in groups for kind, row in group.items()}
    hidden = [kind for kind in (*KINDS, CLEAN, *UNKNOWN) if kind in rows]
    columns = [*KINDS, SEVERAL, ITS_CLASS, ANOTHER_CLASS, *VERDICTS]
    shares = np.zeros((len(hidden), len(columns)))
    for i, kind in enumerate(hidden):
        total = sum(rows[kind].values())
        for answer, n in rows[kind].items():
            column = SEVERAL if " + " in answer else answer
            if column in columns:
                shares[i, columns.index(column)] += 100 * n / total
    return hidden, columns, shares


def confusion(data: dict[str, Any]) -> Any:
    """Draw a heat map, in % of each row."""
    hidden, columns, shares = matrix(data)
    figure, axis = plt.subplots(
        figsize=(2.5 + 0.33 * len(columns), 2.2 + 0.27 * max(1, len(hidden))), layout="constrained"
    )
    axis.imshow(np.where(shares > 0, shares, np.nan), cmap="Blues", vmin=0, vmax=115, aspect="auto")
    for (i, j), value in np.ndenumerate(shares):
        if value > 0:
            axis.text(
                j, i, f"{value:.0f}", ha="center", va="center", fontsize=7, color="w" if value > 60 else INK
            )
    axis.set_xticks(range(len(columns)), [_named(c) for c in columns], rotation=90, fontsize=8)
    axis.set_yticks(range(len(hidden)), [_named(h) for h in hidden], fontsize=8)
    axis.set_xticks(np.arange(-0.5, len(columns)), minor=True)
    axis.set_yticks(np.arange(-0.5, len(hidden)), minor=True)
    axis.grid(which="minor", color="#eeeeee", lw=0.6)
    axis.tick_params(which="both", length=0)
    axis.axvline(len(KINDS) - 0.5, color=GREY, lw=1)
    axis.set(xlabel="answered", ylabel="hidden")
    figure.suptitle("Rich protocol, 1.5 to 3 σ: answers in % of what was hidden", fontsize=10)
    return figure


def reliability(data: dict[str, Any]) -> Any:
    """Draw the stated probability of the first hypothesis against the share of true ones."""
    found = data["calibration"]
    figure, axis = plt.subplots(figsize=(5, 4.6), layout="constrained")
    axis.plot([0, 1], [0, 1], color=GREY, lw=1)
    for row in found["bins"]:
        spread = np.maximum([[row["share"] - row["low"]], [row["high"] - row["share"]]], 0.0)  # rounding
        axis.errorbar(row["stated"], row["share"], yerr=spread, color=BLUE, marker="o", ms=5, capsize=3)
    words = "" if found["error"] is None else f"error {found['error']:.3f}, Brier score {found['brier']:.3f}"
    axis.set(xlabel="stated probability of the first hypothesis", ylabel="share that is true")
    axis.set(xlim=(0, 1.03), ylim=(0, 1.03))
    axis.set_title(f"{found['n']} answers in bins of equal width\n{words}", fontsize=10)
    return figure


def strength(data: dict[str, Any]) -> Any:
    """Share that is right by the RMS change of the readings."""
    bands = [band for band in data["by_snr"] if band["n"]]
    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    places = np.arange(len(bands))
    shown = ((-0.1, ORANGE, "strictly", bands), (0.1, BLUE, "by class", [b["by_class"] for b in bands]))
    for offset, colour, label, values in shown:
        shares, low, high = (np.array([v[key] for v in values]) for key in ("share", "low", "high"))
        spread = np.maximum([shares - low, high - shares], 0.0)
        axis.errorbar(places + offset, shares, spread, fmt="o", color=colour, capsize=3, label=label)
    axis.set_xticks(places, [f"{b['above']:g} to {b['below']:g}\n{b['n']} sets" for b in bands])
    axis.set(xlabel="change of the readings, RMS in σ", ylabel="right effect named", ylim=(0, 1.03))
    axis.legend(loc="lower right", frameon=False)
    return figure


def _named(answer: str) -> str:
    return SHORT.get(answer, "nothing hidden" if answer == CLEAN else answer).replace("_", " ")
