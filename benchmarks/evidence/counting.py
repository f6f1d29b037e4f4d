"""The statistics of many judged answers: shares with their intervals, tables, reliability."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from benchmarks.evidence.judge import ERROR, Judged
from benchmarks.evidence.truths import CLEAN

Z_95 = 1.959963984540054
SNR_EDGES = (0.0, 0.75, 1.25, 2.0, 2.5, 3.5)
RELIABILITY_BINS = 5


def wilson(right: int, n: int, z: float = Z_95) -> tuple[float, float]:
    """Wilson's interval of a share (J. Am. Stat. Assoc. 22, 1927); (0, 1) where nothing was tried."""
    if n == 0:
        return 0.0, 1.0
    share, z2 = right / n, z * z
    centre = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = z / (1 + z2 / n) * math.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return max(0.0, centre - half), min(1.0, centre + half)


def share(items: Iterable[Judged], of: Callable[[Judged], bool]) -> dict[str, Any]:
    """{right, n, share, low, high} of those for which `of` holds; share is None where there is none."""
    flags = [of(item) for item in items]
    right, n = sum(flags), len(flags)
    low, high = wilson(right, n)
    return {"right": right, "n": n, "share": right / n if n else None, "low": low, "high": high}


def is_right(item: Judged) -> bool:
    """The answer counts as right."""
    return item.outcome == "right"


def banded(
    items: Sequence[Judged], value: Callable[[Judged], float | None], edges: Sequence[float]
) -> Iterator[tuple[float, float, list[Judged]]]:
    """(low, high, items) of each band; the last one includes its upper edge."""
    for low, high in itertools.pairwise(edges):
        inside = [
            item
            for item in items
            if (x := value(item)) is not None and (low <= x < high or x == high == edges[-1])
        ]
        yield low, high, inside


def summary(items: Sequence[Judged]) -> dict[str, Any]:
    """All tables as plain data: the content of benchmarks/out/evidence.json."""
    asked = [item for item in items if item.mode == "diagnose"]
    of = {name: [i for i in asked if i.group == name] for name in sorted({item.group for item in asked})}
    effects = [item for item in of.get("effect", []) if item.excited]
    clean, unknown = of.get("clean", []), of.get("unknown", [])
    pairs = [item for item in of.get("pair", []) if item.excited]
    strong_and_weak = [*effects, *(item for item in of.get("weak", []) if item.excited)]
    stated = [item for item in asked if item.excited]
    return {
        "n": len(items),
        "errors": sum(item.outcome == ERROR for item in items),
        "effects": both(effects),
        "effects_not_excited": sum(not item.excited for item in of.get("effect", [])),
        "by_kind": {kind: both(rows) for kind, rows in by(effects, lambda i: i.kind).items()},
        "by_engine": {key: both(rows) for key, rows in by(effects, lambda i: i.engine).items()},
        "by_robot": {key: both(rows) for key, rows in by(effects, lambda i: i.robot).items()},
        "by_snr": [
            {"above": low, "below": high, **both(rows)}
            for low, high, rows in banded(strong_and_weak, lambda i: i.snr, SNR_EDGES)
        ],
        "by_protocol": {
            name: {
                "effects": both([i for i in rows if i.kind != CLEAN and i.excited]),
                "clean": share([i for i in rows if i.kind == CLEAN], is_right),
            }
            for name, rows in by(
                [i for i in asked if i.group not in ("unknown", "weak", "pair")], lambda i: i.protocol
            ).items()
        },
        "poor": _poor([i for i in of.get("poor", []) if i.kind != CLEAN and i.excited]),
        "plan": {
            mode: _plan(rows)
            for mode, rows in by([i for i in items if i.group == "plan"], lambda i: i.mode).items()
        },
        "false_alarms": share(clean, lambda i: i.alarm),
        "false_alarms_by_engine": {
            key: share(rows, lambda i: i.alarm) for key, rows in by(clean, lambda i: i.engine).items()
        },
        "clean_right": share(clean, is_right),
        "unknown": share(unknown, is_right),
        "unknown_by_form": {
            key: share(rows, is_right) for key, rows in by(unknown, lambda i: i.kind).items()
        },
        "pairs": both(pairs),
        "ambiguous": {g: share(rows, _is_ambiguous) for g, rows in of.items()},
        "credible_set": _credible(effects),
        "calibration": reliability(stated),
        "wall_s": _quantiles([i.wall_s for i in asked if i.outcome != ERROR]),
        "time": {
            name: {
                "n": len(rows),
                "cpu_s": float(sum(i.cpu_s for i in rows)),
                **_quantiles([i.cpu_s for i in rows]),
            }
            for name, rows in by(items, lambda i: i.group).items()
        },
        "improve": _improve([item for item in items if item.group == "improve"]),
        "confusion": {g: confusion(rows) for g, rows in of.items()},
    }


def both(items: Sequence[Judged]) -> dict[str, Any]:
    """The strict share, and beside it `by_class`."""
    return {**share(items, is_right), "by_class": share(items, lambda i: i.by_class)}


def _poor(items: Sequence[Judged]) -> dict[str, Any]:
    """First hypotheses that are true, beside the choices of the scorer with the true forms, on the same sets."""
    compared = [item for item in items if item.oracle_right is not None and item.top_right is not None]
    mine, theirs = (
        share(compared, lambda i: bool(i.top_right)),
        share(compared, lambda i: bool(i.oracle_right)),
    )
    return {
        "top": mine,
        "oracle": theirs,
        "ratio": mine["right"] / theirs["right"] if theirs["right"] else None,
        "by_kind": {
            kind: {
                "top": sum(bool(i.top_right) for i in rows),
                "oracle": sum(bool(i.oracle_right) for i in rows),
                "n": len(rows),
            }
            for kind, rows in by(compared, lambda i: i.kind).items()
        },
    }


def _plan(items: Sequence[Judged]) -> dict[str, Any]:
    runs: dict[str, int] = {}
    for item in items:
        for name in item.added:
            runs[name] = runs.get(name, 0) + 1
    ranked = dict(sorted(runs.items(), key=lambda entry: -entry[1]))
    return {**both(items), "top": share(items, lambda i: bool(i.top_right)), "runs": ranked}


def confusion(items: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Counts by truth and answer."""
    table: dict[str, dict[str, int]] = {}
    for item in items:
        row = table.setdefault(item.kind, {})
        row[item.answer] = row.get(item.answer, 0) + 1
    return {kind: table[kind] for kind in sorted(table)}


def _is_ambiguous(item: Judged) -> bool:
    return item.outcome == "ambiguous"


def by(items: Sequence[Judged], key: Callable[[Judged], str]) -> dict[str, list[Judged]]:
    groups: dict[str, list[Judged]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return {name: groups[name] for name in sorted(groups)}


def _credible(items: Sequence[Judged]) -> dict[str, Any]:
    stated = [item for item in items if item.in_credible_set is not None]
    sizes = [item.credible_size for item in stated if item.credible_size is not None]
    return {
        "coverage": share(stated, lambda i: bool(i.in_credible_set)),
        "median_size": float(np.median(sizes)) if sizes else None,
    }


def reliability(items: Sequence[Judged], bins: int = RELIABILITY_BINS) -> dict[str, Any]:
    """Stated probability of the first hypothesis against the share of them that are true, in bins of equal mass.

    `error` is the expected calibration error Σ n_b/n |stated − true| (Naeini et al., AAAI 2015); `brier` the mean of
    (stated − true)² (Brier 1950).
    """
    cases = sorted(
        ((i.top_probability, float(bool(i.top_right))) for i in items if i.top_probability is not None),
    )
    rows = []
    for part in np.array_split(np.array(cases).reshape(-1, 2), bins):
        if len(part):
            right = int(part[:, 1].sum())
            low, high = wilson(right, len(part))
            rows.append(
                {
                    "above": float(part[0, 0]),
                    "below": float(part[-1, 0]),
                    "stated": float(part[:, 0].mean()),
                    "right": right,
                    "n": len(part),
                    "share": right / len(part),
                    "low": low,
                    "high": high,
                }
            )
    n = len(cases)
    return {
        "n": n,
        "error": sum(row["n"] * abs(row["stated"] - row["share"]) for row in rows) / n if n else None,
        "brier": float(np.mean([(stated - true) ** 2 for stated, true in cases])) if n else None,
        "bins": rows,
    }


def _improve(items: Sequence[Judged]) -> dict[str, Any]:
    return {
        "n": len(items),
        "start_over_floor": _quantiles([i.start_over_floor for i in items if i.start_over_floor is not None]),
        "end_over_floor": _quantiles([i.end_over_floor for i in items if i.end_over_floor is not None]),
        "right": share(items, is_right),
        "wall_s": _quantiles([i.wall_s for i in items]),
    }


def _quantiles(values: Sequence[float]) -> dict[str, float | None]:
    names = {"median": 0.5, "q25": 0.25, "q75": 0.75, "q90": 0.9, "worst": 1.0}
    return {name: float(np.quantile(values, q)) if values else None for name, q in names.items()}
