"""What an answer is worth: right, right by class, ambiguous or wrong.

`ambiguous` and `insufficient_data` are honest and never right. A false alarm is an answer to a clean set that says
that something is missing: another verdict than nothing_missing, or `ambiguous` between effects without the plain model.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.evidence.oracle import choice
from benchmarks.evidence.truths import UNKNOWN, hidden_kinds

HONEST = ("ambiguous", "insufficient_data")
ERROR = "error"


@dataclass(frozen=True)
class Judged:
    """One answer beside its label.

    Attributes:
        mode: how it was asked: `diagnose`, `improve`, or what runs were added.
        answer: the kinds that it names, joined by " + ", or its verdict.
        outcome: right, ambiguous, wrong or error.
        by_class: right, or right but for kinds that the answer declared indistinguishable (`right_by_class`).
        alarm: it says that something is missing.
        in_credible_set: the truth is among the hypotheses that hold 90 %; None without a set.
        top_probability, top_right: of the most probable hypothesis; None without one.
        oracle_right: the scorer with the true forms finds the kind; None where it was not asked.
        end_over_floor: held-out error over the floor at the end of `improve`; None otherwise.
    """

    group: str
    mode: str
    kind: str
    engine: str
    robot: str
    protocol: str
    snr: float
    excited: bool
    answer: str
    outcome: str
    by_class: bool
    alarm: bool
    in_credible_set: bool | None
    credible_size: int | None
    top_probability: float | None
    top_right: bool | None
    oracle_right: bool | None
    added: tuple[str, ...]
    start_over_floor: float | None
    end_over_floor: float | None
    wall_s: float
    cpu_s: float


def judge(group: str, label: dict[str, Any], line: dict[str, Any], mode: str = "diagnose") -> Judged:
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
    outcome = _outcome(kind, label["right"], verdict, selected)
    squares = label.get("mean_squares")
    return Judged(
        group=group,
        mode=mode,
        kind=kind,
        engine=label["engine"],
        robot=label["robot"],
        protocol=label["protocol"],
        snr=label["snr_reached"],
        excited=label["excited"],
        answer=" + ".join(selected) if verdict == "missing_effect" else verdict,
        outcome=outcome,
        by_class=outcome == "right" or right_by_class(truth, verdict, selected, names, _classes(result)),
        alarm=_alarm(verdict, names),
        in_credible_set=credible,
        credible_size=len(names) if names else None,
        top_probability=top and float(top["probability"]),
        top_right=top and _kinds(top) == truth,
        oracle_right=choice(squares, result["n_effective"]) == kind
        if squares and "n_effective" in result
        else None,
        added=tuple(line.get("added") or ()),
        start_over_floor=over[0] if over else None,
        end_over_floor=over[-1] if over else None,
        wall_s=float(line["wall_s"]),
        cpu_s=float(line.get("cpu_s", line["wall_s"])),
    )


def true_hypothesis(kind: str) -> tuple[str, ...]:
    """The truth in the words of `hypotheses[].kinds`."""
    return ("unknown",) if kind in UNKNOWN else hidden_kinds(kind)


def right_by_class(
    truth: tuple[str, ...],
    verdict: str,
    selected: Sequence[str],
    credible: Sequence[tuple[str, ...]],
    classes: Sequence[frozenset[str]],
) -> bool:
    """Right but for kinds of one class, as the answer declared them from inputs, model and noise alone.

    The verdict names the truth up to exchanges within classes, or it is `ambiguous` and every hypothesis that holds its
    90 % does.
    """
    if not truth or truth == ("unknown",):
        return False

    def same(kinds: Sequence[str]) -> bool:
        return len(kinds) == len(truth) and any(
            all(a == b or any({a, b} <= one for one in classes) for a, b in zip(order, truth, strict=True))
            for order in itertools.permutations(kinds)
        )

    if verdict == "missing_effect":
        return same(selected)
    return verdict == "ambiguous" and bool(credible) and all(same(kinds) for kinds in credible)


def _classes(result: dict[str, Any]) -> list[frozenset[str]]:
    return [frozenset(one["kinds"]) for one in result.get("classes") or []]


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
