"""Answers judged twice: with the place of the effect, and without, since a right kind at a wrong place is half right.

A place is the name behind the @ of a kind; a kind without one is at all places alike. Without places, an effect at two
places with two strengths is one kind, and so is a class whose members differ in the place alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from benchmarks.evidence.counting import both, each, share
from benchmarks.evidence.judge import ERROR, Judged
from benchmarks.evidence.ledger import judged

from pliant.interfaces.effect import AT

CHANGED = ("selected", "hypotheses", "credible_set", "classes", "selected_class", "beside_class")


@dataclass(frozen=True)
class Twice:
    """One answer: judged with the place (`placed`), and by its kind alone (`kind`)."""

    placed: Judged
    kind: Judged


def judged_twice(answers: Sequence[Mapping[str, Any]]) -> list[Twice]:
    """Judge the answers with and without the places."""
    bare = judged([without_places(one) for one in answers])
    return [Twice(a, b) for a, b in zip(judged(answers), bare, strict=True)]


def without_places(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return an answer whose label and result name kinds without places; a class of one kind becomes that kind."""
    result = dict(answer["result"])
    result |= {key: _plain(result[key]) for key in CHANGED if result.get(key)}
    members = result.get("selected_class") or ()
    if len(members) == 1:
        named = list(dict.fromkeys([*(result.get("beside_class") or ()), *members]))
        result |= {"selected": named, "selected_class": [], "beside_class": [], "verdict": "missing_effect"}
    label = {**answer["label"], "kind": answer["label"]["kind"].partition(AT)[0]}
    return {**answer, "label": label, "result": result}


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        return value.partition(AT)[0]
    if isinstance(value, Mapping):
        return {key: _plain(one) if key == "kinds" else one for key, one in value.items()}
    if not isinstance(value, list | tuple):
        return value
    plain = [_plain(one) for one in value]
    return list(dict.fromkeys(plain)) if all(isinstance(one, str) for one in plain) else plain


def summary(items: Sequence[Twice]) -> dict[str, Any]:
    """Return all tables as plain data."""
    bare = [item.kind for item in items]
    of = {name: [i for i in bare if i.group == name] for name in ("effect", "clean", "unknown")}
    placed = [item.placed for item in items if item.placed.group == "effect"]
    return {
        "n": len(items),
        "errors": sum(i.outcome == ERROR for i in bare),
        "effects": both(of["effect"]),
        "placed": both(placed),
        "placed_by_kind": {
            kind: both([i.placed for i in items if i.kind.kind == kind and i.kind.group == "effect"])
            for kind in sorted({i.kind for i in of["effect"]})
        },
        "wrong_kind": share(bare, attrgetter("wrong_kind")),
        "class_answers": share(of["effect"], lambda i: i.outcome == "class"),
        "ambiguous": share(of["effect"], lambda i: i.outcome == "ambiguous"),
        "false_alarms": share(of["clean"], attrgetter("alarm")),
        "clean_right": share(of["clean"]),
        "unknown": share(of["unknown"]),
        "by_robot": each(both, of["effect"], "robot"),
        "placed_by_robot": each(both, placed, "robot"),
        "alarms_by_robot": each(lambda rows: share(rows, attrgetter("alarm")), of["clean"], "robot"),
        "unknown_by_robot": each(share, of["unknown"], "robot"),
        "by_kind": each(both, of["effect"], "kind"),
        "unknown_by_form": each(share, of["unknown"], "kind"),
        "answers": {kind: _answers(rows) for kind, rows in _grouped(items).items()},
        "minutes": {name: _minutes(rows) for name, rows in _by_robot(bare).items()},
    }


def headline(found: Sequence[Mapping[str, Any]]) -> dict[str, list[int]]:
    """Return [count, total] of the figures in a ledger's line."""
    data = summary(judged_twice(found))
    shares = {
        "placed": data["placed"],
        "strictly": data["effects"],
        "by_class": data["effects"]["by_class"],
        **{name: data[name] for name in ("wrong_kind", "false_alarms", "unknown")},
    }
    return {name: [one["right"], one["n"]] for name, one in shares.items()}


def _grouped(items: Sequence[Twice]) -> dict[str, list[Twice]]:
    return {kind: [i for i in items if i.kind.kind == kind] for kind in sorted({i.kind.kind for i in items})}


def _by_robot(items: Sequence[Judged]) -> dict[str, list[Judged]]:
    return {name: [i for i in items if i.robot == name] for name in sorted({i.robot for i in items})}


def _answers(rows: Sequence[Twice]) -> dict[str, int]:
    """Return the count of each answer that is not right without its place."""
    wrong = [row.kind.answer for row in rows if not row.kind.is_right]
    return {answer: wrong.count(answer) for answer in sorted(set(wrong))}


def _minutes(rows: Sequence[Judged]) -> dict[str, float]:
    spent = sorted(row.cpu_s / 60.0 for row in rows)
    return {"n": len(spent), "median": spent[len(spent) // 2], "all": sum(spent)}
