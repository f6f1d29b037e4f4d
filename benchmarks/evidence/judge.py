"""What an answer is worth: right, right by class, ambiguous or wrong.

`ambiguous` and `insufficient_data` are honest and never right. An answer may be a class (`selected_class`): it is
right by class where it holds the truth, and never strictly. A wrong kind is named where an answer, or every member
of its class, has an effect that is not hidden and not of a class with one that is. A false alarm is an answer to a
clean set that says that something is missing: another verdict than nothing_missing, or `ambiguous` between effects
without the plain model.

Where the joint law is off (labels with a `law_error`) its own shape, `law` among kinds, is part of every truth: it may
stand beside the effects that are named or not. `law_off` is no alarm there, and right of a clean set. Of a hidden
effect it is right by class where the answer declared a class that holds both. A mistake of the record is right where it
stands in `bookkeeping`, or where an effect is named that says the same.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.evidence.bench_errors import MISTAKES
from benchmarks.evidence.oracle import choice
from benchmarks.evidence.truths import (
    CLEAN,
    LAW,
    LAW_OFF,
    STATIC_UNKNOWN,
    UNKNOWN,
    hidden_kinds,
)

HONEST = ("ambiguous", "insufficient_data")
ERROR = "error"
# Of a normal distribution 90 % are within so many standard deviations.
Z_90 = 1.6448536269514722
Kinds = tuple[str, ...]
ITS_CLASS, ANOTHER_CLASS = "its class", "another class"


@dataclass(frozen=True)
class Judged:
    """One answer beside its label.

    Attributes:
        mode: how it was asked: `diagnose`, `improve`, or what runs were added.
        forms: the equations that were hidden, by name.
        answer: the kinds that it names, joined by " + ", `ITS_CLASS`, `ANOTHER_CLASS`, or its verdict.
        outcome: right, class, ambiguous, wrong or error.
        by_class: right, or right but for kinds that the answer declared indistinguishable (`right_by_class`).
        wrong_kind: it names an effect that is not hidden, nor of a class with one that is.
        alarm: it says that something is missing.
        in_credible_set: the truth is among the hypotheses that hold 90 %; None without a set.
        top_probability, top_right: of the most probable hypothesis; None without one.
        oracle_right: the scorer with the true forms finds the kind; None where it was not asked.
        end_over_floor: held-out error over the floor at the end of `improve`; None otherwise.
        law_error: share of the torque range by which the law is off; 0 in the bed of exact laws.
        separable: no class that the answer declared holds what is hidden; None where no effect is.
        truth_fitted: what is hidden is among the hypotheses that were fitted; None where that is not known.
        intervals: of each parameter of the hidden effect, where its equation is the candidate's: name, whether the
            stated 90 % interval holds its value, and by how many stated sd the estimate is off.
        told: mistakes of the record that the answer tells.
    """

    group: str
    mode: str
    kind: str
    forms: tuple[str, ...]
    engine: str
    robot: str
    protocol: str
    snr: float
    excited: bool
    answer: str
    outcome: str
    by_class: bool
    wrong_kind: bool
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
    law_error: float = 0.0
    separable: bool | None = None
    truth_fitted: bool | None = None
    intervals: tuple[tuple[str, bool, float], ...] = ()
    told: tuple[str, ...] = ()

    @property
    def form(self) -> str:
        """What was hidden, in one name."""
        return " + ".join(self.forms)

    @property
    def is_right(self) -> bool:
        """The answer counts as right."""
        return self.outcome == "right"


def judge(group: str, label: dict[str, Any], line: dict[str, Any], mode: str = "diagnose") -> Judged:
    """One line of results (`error` or `result`, `wall_s`) beside its opened label."""
    kind, off = label["kind"], bool(label.get("law_error"))
    result = _renamed(line.get("result") or {}, kind)
    told = tuple(sorted(one["kind"] for one in result.get("bookkeeping") or ()))
    selected = _selected(result, off)
    # `improve` says what it added, step by step.
    added = ("missing_effect" if selected else "nothing_missing") if "steps" in result else ERROR
    verdict = ERROR if line.get("error") else str(result.get("verdict", added))
    if off and verdict == "missing_effect" and list(result.get("selected") or ()) == [LAW]:
        verdict = LAW_OFF
    names = [_kinds(h, off) for h in result.get("credible_set") or []]
    classes = [frozenset(one["kinds"]) for one in result.get("classes") or []]
    hypotheses = sorted(result.get("hypotheses") or [], key=lambda h: -h["probability"])
    truth = ("unknown",) if kind in UNKNOWN else hidden_kinds(kind)
    # Of what is static the law's own shape is the other true name, where the law is off.
    truths = {truth, ()} if off and kind in STATIC_UNKNOWN else {truth}
    credible = any(one in truths for one in names) if names else None
    top = hypotheses[0] if hypotheses and not told else None
    over = [step["rmse_over_floor"] for step in result.get("steps") or []]
    group_of = _class(result, off)
    held = any(one in truths for one in group_of)
    outcome = _outcome(kind, label["right"], verdict, selected)
    if group_of and outcome != ERROR:
        outcome = "class" if held else "wrong"
    same = right_by_class(truth, verdict, selected, names, classes, off)
    by_class = held if group_of else outcome == "right" or same
    named = group_of or ([tuple(selected)] if verdict == "missing_effect" else [])
    wrong_kind = bool(named) and not held and all(_foreign(kinds, truth, classes) for kinds in named)
    if kind in MISTAKES and set(told) & set(MISTAKES[kind][1]) and not wrong_kind and outcome != ERROR:
        outcome, by_class = "right", True
    squares = label.get("mean_squares")
    return Judged(
        group=group,
        mode=mode,
        kind=kind,
        forms=tuple(label.get("forms", ())),
        engine=label["engine"],
        robot=label["robot"],
        protocol=label["protocol"],
        snr=label["snr_reached"],
        excited=label["excited"],
        answer=_answer(verdict, selected, group_of, held),
        outcome=outcome,
        by_class=by_class,
        wrong_kind=wrong_kind,
        alarm=_alarm(verdict, names, off and (held or verdict == LAW_OFF)),
        in_credible_set=credible,
        credible_size=len(names) if names else None,
        top_probability=top and float(top["probability"]),
        top_right=top and _kinds(top, off) in truths,
        oracle_right=choice(squares, result["n_effective"]) == kind
        if squares and "n_effective" in result
        else None,
        added=tuple(line.get("added") or ()),
        start_over_floor=over[0] if over else None,
        end_over_floor=over[-1] if over else None,
        wall_s=float(line["wall_s"]),
        cpu_s=float(line.get("cpu_s", line["wall_s"])),
        law_error=float(label.get("law_error") or 0.0),
        separable=_separable(truth, classes),
        truth_fitted=result.get("truth_fitted", truth_fitted(label, result)),
        intervals=intervals(label, hypotheses),
        told=told,
    )


def is_truth(label: Mapping[str, Any], hypothesis: Any) -> bool:
    """The hypothesis is what is hidden, with or without the law's own shape where that is off."""
    kinds = _renamed({"selected": _kinds(hypothesis, False)}, label["kind"])["selected"]
    return _kinds(kinds, bool(label.get("law_error"))) == hidden_kinds(label["kind"])


def truth_fitted(label: Mapping[str, Any], result: Mapping[str, Any]) -> bool | None:
    """What is hidden is among the hypotheses; None without any, or where it is no effect."""
    hypotheses = result.get("hypotheses")
    if not hypotheses or label["kind"] in (CLEAN, *UNKNOWN):
        return None
    return any(is_truth(label, one) for one in hypotheses)


def intervals(
    label: Mapping[str, Any], hypotheses: Sequence[Mapping[str, Any]]
) -> tuple[tuple[str, bool, float], ...]:
    """Of each parameter that the label states and the hypothesis of the truth estimates: name, held, and sd off."""
    wanted = label.get("parameters") or {}
    stated = next((h.get("parameters") or {} for h in hypotheses if is_truth(label, h)), {})
    found = []
    for name, value in wanted.items():
        if name not in stated:
            continue
        one = stated[name]
        sd = float(one.get("sd") or math.nan)
        low, high = (one.get(end) for end in ("low", "high"))
        low = one["value"] - Z_90 * sd if low is None else low
        high = one["value"] + Z_90 * sd if high is None else high
        found.append((name, bool(low <= value <= high), float((one["value"] - value) / sd)))
    return tuple(found)


def right_by_class(
    truth: Kinds,
    verdict: str,
    selected: Sequence[str],
    credible: Sequence[Kinds],
    classes: Sequence[frozenset[str]],
    law_is_off: bool = False,
) -> bool:
    """Right but for kinds of one class, as the answer declared them from inputs, model and noise alone.

    The verdict names the truth up to exchanges within classes, or it is `ambiguous` and every hypothesis that holds its
    90 % does. `law_off` names the law's own shape beside what is selected; where the law is off every answer does.
    """
    if not truth or truth == ("unknown",):
        return False

    def same(kinds: Sequence[str]) -> bool:
        return len(kinds) == len(truth) and any(
            all(a == b or any({a, b} <= one for one in classes) for a, b in zip(order, truth, strict=True))
            for order in itertools.permutations(kinds)
        )

    def same_with_law(kinds: Sequence[str]) -> bool:
        return same(kinds) or (law_is_off and same((*kinds, LAW)))

    if verdict == LAW_OFF:
        return same(tuple(dict.fromkeys((*selected, LAW))))
    if verdict == "missing_effect":
        return same_with_law(selected)
    return verdict == "ambiguous" and bool(credible) and all(same_with_law(kinds) for kinds in credible)


def _renamed(result: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """The result with every effect that says the mistake that is hidden under the mistake's own name."""
    names = {name: one for one in hidden_kinds(kind) for name in MISTAKES.get(one, ((), ()))[0]}
    if not names:
        return dict(result)

    def renamed(value: Any) -> Any:
        if isinstance(value, str):
            return names.get(value, value)
        if isinstance(value, Mapping):
            return {key: renamed(one) if key == "kinds" else one for key, one in value.items()}
        return [renamed(one) for one in value] if isinstance(value, list | tuple) else value

    keys = ("selected", "hypotheses", "credible_set", "classes", "selected_class", "beside_class")
    return {key: renamed(value) if key in keys else value for key, value in result.items()}


def _separable(truth: Kinds, classes: Sequence[frozenset[str]]) -> bool | None:
    """No declared class of two or more holds one of the hidden effects."""
    if not truth or truth == ("unknown",):
        return None
    return not any(len(one) > 1 and set(truth) & one for one in classes)


def _alarm(verdict: str, credible: Sequence[Kinds], law_alone: bool) -> bool:
    if law_alone or verdict in ("nothing_missing", "insufficient_data", ERROR):
        return False
    return not (verdict == "ambiguous" and (not credible or () in credible))


def _class(result: dict[str, Any], law_is_off: bool) -> list[Kinds]:
    """What the answer is a class of: each member with what is missing beside it; empty where it is none."""
    members, beside = result.get("selected_class") or [], result.get("beside_class") or []
    return [_kinds((*beside, one), law_is_off) for one in members] if len(members) > 1 else []


def _foreign(kinds: Sequence[str], truth: Sequence[str], classes: Sequence[frozenset[str]]) -> bool:
    """One of the kinds is not hidden, nor of a class with one that is."""
    return any(
        kind not in (*truth, LAW) and not any({kind, one} <= c for one in truth for c in classes)
        for kind in kinds
    )


def _answer(verdict: str, selected: Sequence[str], group_of: Sequence[Any], held: bool) -> str:
    if group_of and verdict != ERROR:
        return ITS_CLASS if held else ANOTHER_CLASS
    return " + ".join(selected) if verdict == "missing_effect" else verdict


def _kinds(hypothesis: Any, law_is_off: bool) -> Kinds:
    """The sorted kinds of a hypothesis, an object with `kinds` or a list; without the law's shape where that is off."""
    kinds = hypothesis["kinds"] if isinstance(hypothesis, dict) else hypothesis
    return tuple(sorted(kind for kind in kinds if not (law_is_off and kind == LAW)))


def _selected(result: dict[str, Any], law_is_off: bool) -> list[str]:
    if "selected" in result:
        return list(_kinds(result["selected"] or (), law_is_off))
    added = [step.get("added") or [] for step in result.get("steps") or []]
    flat = [kind for kinds in added for kind in ([kinds] if isinstance(kinds, str) else kinds)]
    return list(_kinds(flat, law_is_off))


def _outcome(kind: str, right: Sequence[str], verdict: str, selected: list[str]) -> str:
    if verdict == ERROR:
        return ERROR
    if verdict in HONEST:
        return "ambiguous"
    named = verdict != "missing_effect" or tuple(selected) == hidden_kinds(kind)
    return "right" if verdict in right and named else "wrong"
