"""Statistics of many judged answers: shares with Wilson's intervals, reliability, coverage; `summary` has all."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from benchmarks.evidence.bench_errors import MISTAKES
from benchmarks.evidence.judge import ERROR, Judged
from benchmarks.evidence.truths import CLEAN

Z_95 = 1.959963984540054
SNR_EDGES = (0.0, 0.75, 1.25, 2.0, 2.5, 3.5)
LAW_EDGES = (0.003, 0.006, 0.012, 0.03)
RELIABILITY_BINS = 10
# An answer that is stated so probable is certain to its reader.
CERTAIN = 0.99
# Groups with separate tables.
OTHERS = ("missed", "interval", "payload", "clock", "gravity")


def wilson(right: int, n: int, z: float = Z_95) -> tuple[float, float]:
    """Return Wilson's interval of a share (J. Am. Stat. Assoc. 22, 1927); (0, 1) without trials."""
    if n == 0:
        return 0.0, 1.0
    share, z2 = right / n, z * z
    centre = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = z / (1 + z2 / n) * math.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return max(0.0, centre - half), min(1.0, centre + half)


def share(items: Iterable[Judged], of: Callable[[Judged], Any] = attrgetter("is_right")) -> dict[str, Any]:
    """Return {right, n, share, low, high} of items with a true `of`; share=None without items."""
    flags = [bool(of(item)) for item in items]
    right, n = sum(flags), len(flags)
    low, high = wilson(right, n)
    return {"right": right, "n": n, "share": right / n if n else None, "low": low, "high": high}


def banded(
    items: Sequence[Judged], value: Callable[[Judged], float | None], edges: Sequence[float]
) -> Iterator[tuple[float, float, list[Judged]]]:
    """Yield (low, high, items) of each band; the last one includes its upper edge."""
    known = [(x, item) for item in items if (x := value(item)) is not None]
    for low, high in itertools.pairwise(edges):
        yield low, high, [item for x, item in known if low <= x < high or x == high == edges[-1]]


def summary(items: Sequence[Judged]) -> dict[str, Any]:
    """Return all tables as plain data: the content of benchmarks/out/evidence.json."""
    asked = [item for item in items if item.mode == "diagnose"]
    of = {name: [i for i in asked if i.group == name] for name in sorted({item.group for item in asked})}
    effects, pairs, weak = ([i for i in of.get(name, []) if i.excited] for name in ("effect", "pair", "weak"))
    clean, unknown = of.get("clean", []), of.get("unknown", [])
    alarms = partial(share, of=attrgetter("alarm"))
    single = [i for i in asked if i.group not in ("unknown", "weak", "pair", *OTHERS)]
    stated = [i for i in asked if i.excited]
    return {
        "n": len(items),
        "errors": sum(item.outcome == ERROR for item in items),
        "effects": both(effects),
        "wrong_kind": share([i for i in items if i.mode != "improve"], attrgetter("wrong_kind")),
        "class_answers": share(effects, lambda i: i.outcome == "class"),
        "effects_not_excited": sum(not item.excited for item in of.get("effect", [])),
        **{f"by_{name}": each(both, effects, name) for name in ("kind", "engine", "robot")},
        "by_snr": [
            {"above": low, "below": high, **both(rows)}
            for low, high, rows in banded([*effects, *weak], lambda i: i.snr, SNR_EDGES)
        ],
        "by_protocol": each(_protocol, single, "protocol"),
        "poor": _poor([i for i in of.get("poor", []) if i.kind != CLEAN and i.excited]),
        "plan": each(_plan, [i for i in items if i.group == "plan"], "mode"),
        "false_alarms": alarms(clean),
        **{f"false_alarms_by_{name}": each(alarms, clean, name) for name in ("engine", "robot")},
        "clean_right": share(clean),
        "unknown": share(unknown),
        "unknown_by_form": each(share, unknown, "kind"),
        "unknown_by_robot": each(share, unknown, "robot"),
        "by_form": {kind: each(both, rows, "form") for kind, rows in _grouped(effects, "kind").items()},
        **{name: _quick(of.get(name, [])) for name in ("midway", "coarse", "rod")},
        "pairs": both(pairs),
        "split": {g: splittable([i for i in rows if i.excited]) for g, rows in of.items()},
        "fitted": {
            g: share([i for i in of.get(g, []) if i.truth_fitted is not None], attrgetter("truth_fitted"))
            for g in ("effect", "pair")
        },
        "certain": certain(asked),
        "intervals": covered(items),
        **{name: both([i for i in of.get(name, []) if i.excited]) for name in OTHERS},
        "told_wrongly": share([i for i in asked if i.kind not in MISTAKES], attrgetter("told")),
        "by_law": [
            {"above": low, "below": high, **both(rows)}
            for low, high, rows in banded(
                [i for i in effects if i.law_error], attrgetter("law_error"), LAW_EDGES
            )
        ],
        "ambiguous": {g: share(rows, lambda i: i.outcome == "ambiguous") for g, rows in of.items()},
        "credible_set": _credible(stated),
        "calibration": reliability(stated),
        "wall_s": _quantiles([i.wall_s for i in asked if i.outcome != ERROR]),
        "time": each(_time, items, "group"),
        "improve": _improve([item for item in items if item.group == "improve"]),
        "confusion": {g: each(_answers, rows, "kind") for g, rows in of.items()},
    }


def overall_tables(*beds: Sequence[Judged]) -> dict[str, Any]:
    """Return tables over all answers, whatever the law: calibration of stated probabilities, and certain answers."""
    asked = [item for items in beds for item in items if item.mode == "diagnose"]
    return {"calibration": reliability([i for i in asked if i.excited]), "certain": certain(asked)}


def splittable(items: Sequence[Judged]) -> dict[str, Any]:
    """Return, for sets with effects, the share whose class is separable, and the strictly right ones among these."""
    known = [item for item in items if item.separable is not None]
    could = [item for item in known if item.separable]
    return {"could": share(known, attrgetter("separable")), "strictly": share(could)}


def certain(items: Iterable[Judged]) -> dict[str, Any]:
    """Return the share that is right by class of answers stated at 99 % or more."""
    stated = [i for i in items if i.top_probability is not None and i.top_probability >= CERTAIN]
    return share(stated, attrgetter("by_class"))


def covered(items: Iterable[Judged]) -> dict[str, Any]:
    """Return the coverage of the hidden values by the stated 90 % intervals, overall and by parameter."""
    named: dict[str, list[tuple[bool, float]]] = {}
    for item in items:
        for name, held, off in item.intervals:
            named.setdefault(name, []).append((held, off))
    every = [one for rows in named.values() for one in rows]
    return {"all": _coverage(every), **{name: _coverage(named[name]) for name in sorted(named)}}


def _coverage(rows: Sequence[tuple[bool, float]]) -> dict[str, Any]:
    right, n = sum(held for held, _ in rows), len(rows)
    low, high = wilson(right, n)
    off = [abs(z) for _, z in rows if math.isfinite(z)]
    found = {"right": right, "n": n, "share": right / n if n else None, "low": low, "high": high}
    return found | {"median_sd_off": float(np.median(off)) if off else None}


def each(of: Callable[[list[Judged]], Any], items: Iterable[Judged], attribute: str) -> dict[str, Any]:
    """Return a figure of the answers by the values of one of their attributes."""
    return {name: of(rows) for name, rows in _grouped(items, attribute).items()}


def _grouped(items: Iterable[Judged], attribute: str) -> dict[str, list[Judged]]:
    groups: dict[str, list[Judged]] = {}
    for item in items:
        groups.setdefault(getattr(item, attribute), []).append(item)
    return {name: groups[name] for name in sorted(groups)}


def both(items: Sequence[Judged]) -> dict[str, Any]:
    """Return the strict share, with `by_class` and `wrong_kind`."""
    return {**share(items), **{name: share(items, attrgetter(name)) for name in ("by_class", "wrong_kind")}}


def _protocol(rows: Sequence[Judged]) -> dict[str, Any]:
    effects = both([i for i in rows if i.kind != CLEAN and i.excited])
    return {"effects": effects, "clean": share([i for i in rows if i.kind == CLEAN])}


def _quick(items: Sequence[Judged]) -> dict[str, Any]:
    clean = [i for i in items if i.kind == CLEAN]
    effects = [i for i in items if i.kind != CLEAN and i.excited]
    return {
        **both(effects),
        "alarms": share(clean, attrgetter("alarm")),
        "by_kind": each(both, effects, "kind"),
    }


def _poor(items: Sequence[Judged]) -> dict[str, Any]:
    """Compare true first hypotheses with the choices of the scorer with the true forms, on the same sets."""
    compared = [item for item in items if item.oracle_right is not None and item.top_right is not None]
    mine, theirs = (share(compared, attrgetter(name)) for name in ("top_right", "oracle_right"))
    ratio = mine["right"] / theirs["right"] if theirs["right"] else None
    return {"top": mine, "oracle": theirs, "ratio": ratio, "by_kind": each(_counts, compared, "kind")}


def _counts(rows: Sequence[Judged]) -> dict[str, int]:
    top, oracle = (sum(bool(getattr(i, f"{name}_right")) for i in rows) for name in ("top", "oracle"))
    return {"top": top, "oracle": oracle, "n": len(rows)}


def _plan(items: Sequence[Judged]) -> dict[str, Any]:
    runs = Counter(name for item in items for name in item.added)
    return {**both(items), "top": share(items, attrgetter("top_right")), "runs": dict(runs.most_common())}


def _answers(rows: Sequence[Judged]) -> dict[str, int]:
    """Return the count of each answer."""
    return dict(Counter(item.answer for item in rows))


def _time(rows: Sequence[Judged]) -> dict[str, Any]:
    spent = [i.cpu_s for i in rows]
    return {"n": len(rows), "cpu_s": float(sum(spent)), **_quantiles(spent)}


def _credible(items: Sequence[Judged]) -> dict[str, Any]:
    stated = [item for item in items if item.in_credible_set is not None]
    sizes = [item.credible_size for item in stated if item.credible_size is not None]
    return {
        "coverage": share(stated, attrgetter("in_credible_set")),
        "mean_size": float(np.mean(sizes)) if sizes else None,
    }


def reliability(items: Sequence[Judged], bins: int = RELIABILITY_BINS) -> dict[str, Any]:
    """Return the stated probability of first hypotheses and the share of true ones, in bins of equal width.

    `error` is the mean gap |stated − true|, weighted by the answers of each bin: the expected calibration error
    (Naeini et al., AAAI 2015). `brier` is the mean of (stated − true)² (Brier 1950).
    """
    cases = [(i.top_probability, float(bool(i.top_right))) for i in items if i.top_probability is not None]
    table = np.array(cases).reshape(-1, 2)
    place = np.clip((table[:, 0] * bins).astype(int), 0, bins - 1)
    rows = []
    for k in range(bins):
        part = table[place == k]
        if len(part):
            right = int(part[:, 1].sum())
            low, high = wilson(right, len(part))
            ends = {"above": k / bins, "below": (k + 1) / bins, "stated": float(part[:, 0].mean())}
            found = {"right": right, "n": len(part), "share": right / len(part), "low": low, "high": high}
            rows.append(ends | found)
    n = len(cases)
    return {
        "n": n,
        "error": sum(row["n"] * abs(row["stated"] - row["share"]) for row in rows) / n if n else None,
        "brier": float(np.mean([(stated - true) ** 2 for stated, true in cases])) if n else None,
        "bins": rows,
    }


def _improve(items: Sequence[Judged]) -> dict[str, Any]:
    ends = {name: [getattr(i, name) for i in items] for name in ("start_over_floor", "end_over_floor")}
    return {
        "n": len(items),
        **{name: _quantiles([x for x in found if x is not None]) for name, found in ends.items()},
        "right": share(items),
        "wall_s": _quantiles([i.wall_s for i in items]),
    }


def _quantiles(values: Sequence[float]) -> dict[str, float | None]:
    names = {"median": 0.5, "q25": 0.25, "q75": 0.75, "q90": 0.9, "worst": 1.0}
    return {name: float(np.quantile(values, q)) if values else None for name, q in names.items()}
