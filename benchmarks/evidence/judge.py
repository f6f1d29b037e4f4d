"""What an answer is worth: right, right by class, ambiguous or wrong; and the statistics of many.

`ambiguous` and `insufficient_data` are honest and never right. An answer may be a class (`selected_class`): it is
right by class where it holds the truth, and never strictly. A wrong kind is named where an answer, or every member
of its class, has an effect that is not hidden and not of a class with one that is. A false alarm is an answer to a
clean set that says that something is missing: another verdict than nothing_missing, or `ambiguous` between effects
without the plain model.

Where the joint law is off (labels with a `law_error`) its own shape, `law` among kinds, is part of every truth: it may
stand beside the effects that are named or not. `law_off` is no alarm there, and right of a clean set. Of a hidden
effect it is right by class where the answer declared a class that holds both. A mistake of the record is right where it
is among the `mistakes` that are told, or where an effect is named that says the same.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from benchmarks.evidence.oracle import choice
from benchmarks.evidence.truths import (
    CLEAN,
    LAW,
    LAW_OFF,
    MISTAKES,
    STATIC_UNKNOWN,
    UNKNOWN,
    hidden_kinds,
)

HONEST = ("ambiguous", "insufficient_data")
ERROR = "error"
Z_95 = 1.959963984540054
SNR_EDGES = (0.0, 0.75, 1.25, 2.0, 2.5, 3.5)
RELIABILITY_BINS = 10
LAW_EDGES = (0.003, 0.006, 0.012, 0.03)
# An answer that is stated so probable is certain to its reader; of a normal distribution 90 % are within so many sd.
CERTAIN, Z_90 = 0.99, 1.6448536269514722
Kinds = tuple[str, ...]
# Groups with tables of their own.
OTHERS = ("missed", "interval", "payload", "clock", "gravity")
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
    told = tuple(sorted(one["kind"] for one in result.get("mistakes") or ()))
    selected = _selected(result, off)
    # `improve` says what it added, step by step.
    added = ("missing_effect" if selected else "nothing_missing") if "steps" in result else ERROR
    verdict = ERROR if line.get("error") else str(result.get("verdict", added))
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


def wilson(right: int, n: int, z: float = Z_95) -> tuple[float, float]:
    """Wilson's interval of a share (J. Am. Stat. Assoc. 22, 1927); (0, 1) where nothing was tried."""
    if n == 0:
        return 0.0, 1.0
    share, z2 = right / n, z * z
    centre = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = z / (1 + z2 / n) * math.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return max(0.0, centre - half), min(1.0, centre + half)


def share(items: Iterable[Judged], of: Callable[[Judged], Any] = attrgetter("is_right")) -> dict[str, Any]:
    """{right, n, share, low, high} of those for which `of` holds; share is None where there is none."""
    flags = [bool(of(item)) for item in items]
    right, n = sum(flags), len(flags)
    low, high = wilson(right, n)
    return {"right": right, "n": n, "share": right / n if n else None, "low": low, "high": high}


def banded(
    items: Sequence[Judged], value: Callable[[Judged], float | None], edges: Sequence[float]
) -> Iterator[tuple[float, float, list[Judged]]]:
    """(low, high, items) of each band; the last one includes its upper edge."""
    known = [(x, item) for item in items if (x := value(item)) is not None]
    for low, high in itertools.pairwise(edges):
        yield low, high, [item for x, item in known if low <= x < high or x == high == edges[-1]]


def summary(items: Sequence[Judged]) -> dict[str, Any]:
    """All tables as plain data: the content of benchmarks/out/evidence.json."""
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


def splittable(items: Sequence[Judged]) -> dict[str, Any]:
    """Of sets with effects: the share whose class could be split, and of that share the strictly right ones."""
    known = [item for item in items if item.separable is not None]
    could = [item for item in known if item.separable]
    return {"could": share(known, attrgetter("separable")), "strictly": share(could)}


def certain(items: Iterable[Judged]) -> dict[str, Any]:
    """Of answers that are stated at 99 % or more: the share that is right by class."""
    stated = [i for i in items if i.top_probability is not None and i.top_probability >= CERTAIN]
    return share(stated, attrgetter("by_class"))


def covered(items: Iterable[Judged]) -> dict[str, Any]:
    """How many stated 90 % intervals hold the value that was hidden, all and parameter by parameter."""
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
    """A figure of the answers by the values of one of their attributes."""
    return {name: of(rows) for name, rows in _grouped(items, attribute).items()}


def _grouped(items: Iterable[Judged], attribute: str) -> dict[str, list[Judged]]:
    groups: dict[str, list[Judged]] = {}
    for item in items:
        groups.setdefault(getattr(item, attribute), []).append(item)
    return {name: groups[name] for name in sorted(groups)}


def both(items: Sequence[Judged]) -> dict[str, Any]:
    """The strict share, and beside it `by_class` and `wrong_kind`."""
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
    """First hypotheses that are true, beside the choices of the scorer with the true forms, on the same sets."""
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
    """How often each answer was given."""
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
    """Stated probability of the first hypothesis against the share of them that are true, in bins of equal width.

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
