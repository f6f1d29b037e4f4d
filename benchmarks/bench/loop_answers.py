"""Judged answers of the closed loop: records, their file, counts and ratios of minutes."""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.bench.arms import ARMS
from benchmarks.evidence.judge import Judged

GROUPS = ("effect", "clean", "unknown", "pair")
ANSWERS = Path(__file__).with_name("answers.jsonl.gz")


@dataclass(frozen=True)
class Answer:
    """The answer of one planner to one truth.

    Attributes:
        truth: name of the truth, without what is hidden.
        strictly: whether it is right; `right` also counts the finest class that no allowed run splits.
        minutes: of bench time until the end; `rich_minutes` those of the whole rich protocol.
        error: of a loop that failed.
    """

    arm: str
    truth: str
    group: str
    kind: str
    robot: str
    engine: str
    outcome: str
    answer: str
    strictly: bool
    right: bool
    wrong_kind: bool
    ended: str
    runs: int
    minutes: float
    rich_minutes: float
    cpu_s: float
    error: str = ""

    @staticmethod
    def from_judged(arm: str, item: Judged, line: Mapping[str, Any], right: bool) -> Answer:
        """Return the record of a judged line of results."""
        minutes = line.get("minutes", [])
        return Answer(
            arm,
            line["id"].split()[0],
            item.group,
            item.kind,
            item.robot,
            item.engine,
            item.outcome,
            item.answer,
            item.is_right,
            right,
            item.wrong_kind,
            line.get("ended", ""),
            len(minutes),
            round(sum(minutes), 3),
            round(line.get("rich_minutes", 0.0), 3),
            round(line.get("cpu_s", 0.0), 1),
            line.get("error", ""),
        )


def store(answers: Iterable[Answer], head: Mapping[str, Any], path: Path = ANSWERS) -> None:
    """Write the answers of a sealed run, after a line that describes the run."""
    lines = [json.dumps(one) for one in (dict(head), *map(asdict, answers))]
    path.write_bytes(gzip.compress("\n".join(lines).encode(), mtime=0))


def stored(path: Path = ANSWERS) -> tuple[dict[str, Any], list[Answer]]:
    """Return the description of the latest sealed run, and its answers; nothing where none is stored."""
    if not path.exists():
        return {}, []
    head, *lines = gzip.decompress(path.read_bytes()).splitlines()
    return json.loads(head), [Answer(**json.loads(line)) for line in lines]


def summary(answers: Sequence[Answer]) -> dict[str, Any]:
    """Return counts and minutes of every arm, and the medians of the ratios of minutes."""
    figures: dict[str, Any] = {}
    minutes: dict[str, dict[str, float]] = {arm: {} for arm in (*ARMS, "rich_whole")}
    for arm in ARMS:
        mine = [one for one in answers if one.arm == arm]
        groups = {group: [one for one in mine if one.group == group] for group in GROUPS}
        for one in mine:
            if not one.error:
                minutes["rich_whole"][one.truth] = one.rich_minutes
                # an arm that ends wrong or undecided would have needed at least its whole budget
                minutes[arm][one.truth] = one.minutes if one.right else np.inf
        taken = [value for value in minutes[arm].values() if np.isfinite(value)]
        figures[arm] = {
            "n": len(mine),
            "right": sum(one.right for one in mine),
            "strictly": sum(one.strictly for one in mine),
            "wrong_kind": sum(one.wrong_kind for one in mine),
            "errors": sum(bool(one.error) for one in mine),
            "groups": {group: [sum(one.right for one in some), len(some)] for group, some in groups.items()},
            "minutes_median_of_right": float(np.median(taken)) if taken else None,
        }
    for arm in ("random", "rich_whole"):
        ratios = [
            minutes["chosen"][name] / value
            for name, value in minutes[arm].items()
            if np.isfinite(minutes["chosen"].get(name, np.inf))
        ]
        both_right = [ratio for ratio in ratios if ratio > 0.0]  # 0 where the other arm did not end right
        figures[f"chosen_to_{arm}"] = {
            "median": float(np.median(ratios)) if ratios else None,
            "n": len(ratios),
            "median_both_right": float(np.median(both_right)) if both_right else None,
            "n_both_right": len(both_right),
        }
    return figures


def as_text(data: Mapping[str, Any], answers: Sequence[Answer]) -> str:
    """Return a line for every answer, then the table."""
    lines = []
    for one in answers:
        outcome = "right" if one.strictly else "class" if one.right else f"not ({one.outcome})"
        lines.append(
            f"{one.kind:30s} {one.robot:6s} {one.engine:10s} {one.arm:7s} {outcome:15s} {one.answer:26s} "
            f"{one.minutes:6.1f} min {one.runs:2d} runs {one.cpu_s:5.0f} s CPU"
        )
    for arm in ARMS:
        counts, right = data[arm], data[arm]["groups"]
        by_group = ", ".join(f"{group} {n}/{count}" for group, (n, count) in right.items())
        lines.append(
            f"{arm}: right {counts['right']}/{counts['n']} ({by_group}), strictly {counts['strictly']}, wrong kind "
            f"{counts['wrong_kind']}, errors {counts['errors']}, median minutes of right ones "
            f"{counts['minutes_median_of_right']}"
        )
    for arm in ("random", "rich_whole"):
        ratio = data[f"chosen_to_{arm}"]
        lines.append(f"minutes of chosen runs / {arm}: median {ratio['median']} of {ratio['n']}")
    return "\n".join(lines)
