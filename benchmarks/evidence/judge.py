"""Classification of answers: right, right by class, ambiguous or wrong.

`ambiguous` and `insufficient_data` are honest and never right. An answer may be a class (`selected_class`): it is right
by class if it contains the truth, and never strictly. A wrong kind is named where an answer, or every member of its
class, has an effect that is not hidden and not of a class with one that is. A false alarm is an answer to a clean set
that reports something missing: another verdict than nothing_missing, or `ambiguous` between effects without the plain
model.

Where the joint law is off (labels with a `law_error`) its own shape, `law` among kinds, is part of every truth: an
answer may name it with the effects or not. `law_off` is no alarm there, and right for a clean set. For a hidden effect
it is right by class if the answer declared a class that contains both. A mistake of the record is right if it is in
`bookkeeping`, or if an equivalent effect is named.
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
# 90 % of a normal distribution are within this number of standard deviations.
Z_90 = 1.6448536269514722
Kinds = tuple[str, ...]
ITS_CLASS, ANOTHER_CLASS = "its class", "another class"


@dataclass(frozen=True)
class Judged:
    """One answer with its label.

    Attributes:
        mode: the command: `diagnose`, `improve`, or the runs that were added.
        forms: the equations that were hidden, by name.
        answer: the kinds that it names, joined by " + ", `ITS_CLASS`, `ANOTHER_CLASS`, or its verdict.
        outcome: right, class, ambiguous, wrong or error.
        by_class: right, or right but for kinds that the answer declared indistinguishable (`right_by_class`).
        wrong_kind: it names an effect that is not hidden, nor of a class with one that is.
        alarm: it reports something missing.
        in_credible_set: the truth is among the hypotheses with 90 % of the probability; None without a set.
        top_probability, top_right: of the most probable hypothesis; None without one.
        oracle_right: the scorer with the true forms finds the kind; None if it was not run.
        end_over_floor: held-out error over the floor at the end of `improve`; None otherwise.
        law_error: error of the law as a share of the torque range; 0 in the bed of exact laws.
        separable: no class that the answer declared contains the hidden effect; None if no effect is hidden.
        truth_fitted: the hidden effect is among the fitted hypotheses; None if that is not known.
        intervals: of each parameter of the hidden effect, if its equation is the candidate's: name, whether the stated
            90 % interval contains its value, and the error of the estimate in stated sd.
        told: mistakes of the record that the answer reports.
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
        """Return the hidden forms in one name."""
        return " + ".join(self.forms)

    @property
    def is_right(self) -> bool:
        """Return whether the answer counts as right."""
        return self.outcome == "right"


def judge(group: str, label: dict[str, Any], line: dict[str, Any], mode: str = "diagnose") -> Judged:
    """Judge one line of results (`error` or `result`, `wall_s`) by its opened label."""
    kind, off = label["kind"], bool(label.get("law_error"))
    result = _renamed(line.get("result") or {}, kind)
    told = tuple(sorted(one["kind"] for one in result.get("bookkeeping") or ()))
    selected = _selected(result, off)
    # `improve` reports its additions, step by step.
    added = ("missing_effect" if selected else "nothing_missing") if "steps" in result else ERROR
    verdict = ERROR if line.get("error") else str(result.get("verdict", added))
    if off and verdict == "missing_effect" and list(result.get("selected") or ()) == [LAW]:
        verdict = LAW_OFF
    names = [_kinds(h, off) for h in result.get("credible_set") or []]
    classes = [frozenset(one["kinds"]) for one in result.get("classes") or []]
    hypotheses = sorted(result.get("hypotheses") or [], key=lambda h: -h["probability"])
    truth = ("unknown",) if is_unknown(label) else hidden_kinds(kind)
    # For static effects the law's shape is the other right name, if the law is inexact.
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


def is_unknown(label: Mapping[str, Any]) -> bool:
    """Return whether what is hidden has no plugin; labels of other beds say it themselves."""
    return bool(label.get("unknown", label["kind"] in UNKNOWN))


def is_truth(label: Mapping[str, Any], hypothesis: Any) -> bool:
    """Return whether the hypothesis is the truth, with or without the law's shape if the law is inexact."""
    kinds = _renamed({"selected": _kinds(hypothesis, False)}, label["kind"])["selected"]
    return _kinds(kinds, bool(label.get("law_error"))) == hidden_kinds(label["kind"])


def truth_fitted(label: Mapping[str, Any], result: Mapping[str, Any]) -> bool | None:
    """Return whether the hidden effect is among the hypotheses; None without hypotheses or without an effect."""
    hypotheses = result.get("hypotheses")
    if not hypotheses or label["kind"] == CLEAN or is_unknown(label):
        return None
    return any(is_truth(label, one) for one in hypotheses)


def intervals(
    label: Mapping[str, Any], hypotheses: Sequence[Mapping[str, Any]]
) -> tuple[tuple[str, bool, float], ...]:
    """Return name, coverage and error (sd) of each parameter in both the label and the true hypothesis."""
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
    """Return whether an answer is right up to kinds of one class that it declared from inputs, model and noise alone.

    The verdict names the truth up to exchanges within classes, or it is `ambiguous` and every hypothesis of its 90 %
    set does. `law_off` names the law's shape in addition to the selected kinds; if the law is off every answer does.
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
    """Return the result with effects equivalent to the hidden mistake renamed to the mistake's name."""
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
    """Return whether no declared class of two or more contains one of the hidden effects."""
    if not truth or truth == ("unknown",):
        return None
    return not any(len(one) > 1 and set(truth) & one for one in classes)


def _alarm(verdict: str, credible: Sequence[Kinds], law_alone: bool) -> bool:
    if law_alone or verdict in ("nothing_missing", "insufficient_data", ERROR):
        return False
    return not (verdict == "ambiguous" and (not credible or () in credible))


def _class(result: dict[str, Any], law_is_off: bool) -> list[Kinds]:
    """Return the members of the answer's class, each with the effects selected in addition; empty if it is no class."""
    members, beside = result.get("selected_class") or [], result.get("beside_class") or []
    return [_kinds((*beside, one), law_is_off) for one in members] if len(members) > 1 else []


def _foreign(kinds: Sequence[str], truth: Sequence[str], classes: Sequence[frozenset[str]]) -> bool:
    """Return whether one of the kinds is not hidden, nor in a class with a hidden one."""
    return any(
        kind not in (*truth, LAW) and not any({kind, one} <= c for one in truth for c in classes)
        for kind in kinds
    )


def _answer(verdict: str, selected: Sequence[str], group_of: Sequence[Any], held: bool) -> str:
    if group_of and verdict != ERROR:
        return ITS_CLASS if held else ANOTHER_CLASS
    return " + ".join(selected) if verdict == "missing_effect" else verdict


def _kinds(hypothesis: Any, law_is_off: bool) -> Kinds:
    """Return the sorted kinds of a hypothesis (object with `kinds` or list), without the shape of an inexact law."""
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
