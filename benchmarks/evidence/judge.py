"""What an answer is worth: right, ambiguous or wrong, and the statistics of many answers.

`ambiguous` and `insufficient_data` are honest and never right. A false alarm is an answer to a clean set that says
that something is missing: another verdict than nothing_missing, or `ambiguous` between effects without the plain model.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from benchmarks.evidence.truths import CLEAN, UNKNOWN, hidden_kinds

HONEST = ("ambiguous", "insufficient_data")
ERROR = "error"
Z_95 = 1.959963984540054
SNR_EDGES = (0.0, 0.75, 1.25, 2.0, 2.5, 3.5)
PROBABILITY_EDGES = (0.0, 0.5, 0.7, 0.9, 0.97, 1.0)


@dataclass(frozen=True)
class Judged:
    """One answer beside its label.

    Attributes:
        answer: the kinds that it names, joined by " + ", or its verdict.
        outcome: right, ambiguous, wrong or error.
        alarm: it says that something is missing.
        in_credible_set: the truth is among the hypotheses that hold 90 %; None without a set.
        top_probability, top_right: of the most probable hypothesis; None without one.
        end_over_floor: held-out error over the floor at the end of `improve`; None otherwise.
    """

    group: str
    kind: str
    engine: str
    robot: str
    protocol: str
    snr: float
    excited: bool
    answer: str
    outcome: str
    alarm: bool
    in_credible_set: bool | None
    credible_size: int | None
    top_probability: float | None
    top_right: bool | None
    start_over_floor: float | None
    end_over_floor: float | None
    wall_s: float


def judge(group: str, label: dict[str, Any], line: dict[str, Any]) -> Judged:
    """One line of results (`error` or `result`, `wall_s`) beside its opened label."""
    result: dict[str, Any] = line.get("result") or {}
    kind = label["kind"]
    verdict = ERROR if line.get("error") else str(result.get("verdict", _verdict_of_steps(result)))
    selected = _selected(result)
    names = [_kinds(h) for h in result.get("credible_set") or []]
    hypotheses = sorted(result.get("hypotheses") or [], key=lambda h: -h["probability"])
    truth = true_hypothesis(kind)
    credible = truth in names if names else None
    top = hypotheses[0] if hypotheses else None
    over = [step["rmse_over_floor"] for step in result.get("steps") or []]
    wall = line["wall_s"]
    return Judged(
        group=group,
        kind=kind,
        engine=label["engine"],
        robot=label["robot"],
        protocol=label["protocol"],
        snr=label["snr_reached"],
        excited=label["excited"],
        answer=" + ".join(selected) if verdict == "missing_effect" else verdict,
        outcome=_outcome(kind, label["right"], verdict, selected),
        alarm=_alarm(verdict, names),
        in_credible_set=credible,
        credible_size=len(names) if names else None,
        top_probability=top and float(top["probability"]),
        top_right=top and _kinds(top) == truth,
        start_over_floor=over[0] if over else None,
        end_over_floor=over[-1] if over else None,
        wall_s=float(wall),
    )


def true_hypothesis(kind: str) -> tuple[str, ...]:
    """The truth in the words of `hypotheses[].kinds`."""
    return ("unknown",) if kind in UNKNOWN else hidden_kinds(kind)


def _kinds(hypothesis: Any) -> tuple[str, ...]:
    """A hypothesis is an object with `kinds`, or the list of kinds itself."""
    return tuple(sorted(hypothesis["kinds"] if isinstance(hypothesis, dict) else hypothesis))


def _selected(result: dict[str, Any]) -> list[str]:
    if "selected" in result:
        return sorted(result["selected"])
    added = [step.get("added") or [] for step in result.get("steps") or []]
    flat = [kind for kinds in added for kind in ([kinds] if isinstance(kinds, str) else kinds)]
    return sorted(flat)


def _verdict_of_steps(result: dict[str, Any]) -> str:
    """`improve` says what it added, step by step."""
    if "steps" not in result:
        return ERROR
    return "missing_effect" if _selected(result) else "nothing_missing"


def _outcome(kind: str, right: Sequence[str], verdict: str, selected: list[str]) -> str:
    if verdict == ERROR:
        return ERROR
    if verdict in HONEST:
        return "ambiguous"
    named = verdict != "missing_effect" or tuple(selected) == hidden_kinds(kind)
    return "right" if verdict in right and named else "wrong"


def _alarm(verdict: str, credible: list[tuple[str, ...]]) -> bool:
    if verdict == "ambiguous":
        return bool(credible) and () not in credible
    return verdict not in ("nothing_missing", "insufficient_data", ERROR)


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
    asked = [item for item in items if item.group != "improve"]
    effects = [item for item in asked if item.group == "effect" and item.excited]
    clean = [item for item in asked if item.group == "clean"]
    unknown = [item for item in asked if item.group == "unknown"]
    pairs = [item for item in asked if item.group == "pair" and item.excited]
    groups = sorted({item.group for item in asked})
    strong_and_weak = [item for item in asked if item.group in ("effect", "weak") and item.excited]
    return {
        "n": len(items),
        "errors": sum(item.outcome == ERROR for item in items),
        "effects": share(effects, is_right),
        "effects_not_excited": sum(item.group == "effect" and not item.excited for item in asked),
        "by_kind": {kind: share(rows, is_right) for kind, rows in _by(effects, lambda i: i.kind).items()},
        "by_engine": {key: share(rows, is_right) for key, rows in _by(effects, lambda i: i.engine).items()},
        "by_robot": {key: share(rows, is_right) for key, rows in _by(effects, lambda i: i.robot).items()},
        "by_snr": [
            {"above": low, "below": high, **share(rows, is_right)}
            for low, high, rows in banded(strong_and_weak, lambda i: i.snr, SNR_EDGES)
        ],
        "by_protocol": {
            name: {
                "effects": share([i for i in rows if i.kind != CLEAN and i.excited], is_right),
                "clean": share([i for i in rows if i.kind == CLEAN], is_right),
            }
            for name, rows in _by(
                [i for i in asked if i.group not in ("unknown", "weak")], lambda i: i.protocol
            ).items()
        },
        "false_alarms": share(clean, lambda i: i.alarm),
        "false_alarms_by_engine": {
            key: share(rows, lambda i: i.alarm) for key, rows in _by(clean, lambda i: i.engine).items()
        },
        "clean_right": share(clean, is_right),
        "unknown": share(unknown, is_right),
        "pairs": share(pairs, is_right),
        "unknown_by_form": {
            key: share(rows, is_right) for key, rows in _by(unknown, lambda i: i.kind).items()
        },
        "ambiguous": {g: share([i for i in asked if i.group == g], _is_ambiguous) for g in groups},
        "credible_set": _credible(effects),
        "calibration": _calibration([*effects, *clean, *unknown]),
        "wall_s": _quantiles([i.wall_s for i in asked if i.outcome != ERROR]),
        "improve": _improve([item for item in items if item.group == "improve"]),
        "confusion": {g: confusion([i for i in asked if i.group == g]) for g in groups},
    }


def confusion(items: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Counts by truth and answer."""
    table: dict[str, dict[str, int]] = {}
    for item in items:
        row = table.setdefault(item.kind, {})
        row[item.answer] = row.get(item.answer, 0) + 1
    return {kind: table[kind] for kind in sorted(table)}


def _is_ambiguous(item: Judged) -> bool:
    return item.outcome == "ambiguous"


def _by(items: Sequence[Judged], key: Callable[[Judged], str]) -> dict[str, list[Judged]]:
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


def _calibration(items: Sequence[Judged]) -> list[dict[str, Any]]:
    """Mean stated probability of the first hypothesis beside the share of them that are true."""
    rows = []
    for low, high, inside in banded(items, lambda i: i.top_probability, PROBABILITY_EDGES):
        stated = [item.top_probability for item in inside if item.top_probability is not None]
        rows.append(
            {
                "above": low,
                "below": high,
                "stated": float(np.mean(stated)) if stated else None,
                **share(inside, lambda i: bool(i.top_right)),
            }
        )
    return rows


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
