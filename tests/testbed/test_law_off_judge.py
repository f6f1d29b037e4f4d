"""The judge for a wrong law or a wrong record: the law's own shape, recognised mistakes, classes, intervals."""

from __future__ import annotations

import json
from typing import Any

import pytest
from benchmarks.evidence import ledger
from benchmarks.evidence.counting import certain, covered, overall_tables, splittable, summary
from benchmarks.evidence.judge import Judged, judge
from benchmarks.evidence.publish import LAW_OFF_TABLES, as_text
from benchmarks.evidence.sets import SetSpec
from benchmarks.evidence.tasks import Task
from benchmarks.evidence.truths import CLEAN
from tests.testbed.judged_lines import answer, make_label, stated

WITH_LAW = [{"kinds": ["law", "stiffness", "wall_thickness"]}]

INTERVAL, EFFECT = (Task(group, SetSpec("backlash", 0)) for group in ("interval", "effect"))


def judged(kind: str, line: dict[str, Any], law_error: float = 0.01, classes: Any = ()) -> Judged:
    line["result"]["classes"] = list(classes)
    return judge("effect", make_label(kind, law_error), line)


@pytest.mark.parametrize(
    ("kind", "line", "off", "exact"),
    [  # outcome, by class, alarm
        (CLEAN, answer("law_off"), ("right", True, False), ("wrong", False, True)),
        (CLEAN, answer("missing_effect", "law"), ("right", True, False), ("wrong", False, True)),
        (CLEAN, answer("nothing_missing"), ("right", True, False), ("right", True, False)),
        (CLEAN, answer("insufficient_data"), ("ambiguous", False, False), ("ambiguous", False, False)),
        (CLEAN, answer("missing_effect", "mullins"), ("wrong", False, True), ("wrong", False, True)),
        (
            CLEAN,
            answer("ambiguous", credible=[["law"], ["mullins"]]),
            ("ambiguous", False, False),
            ("ambiguous", False, True),
        ),
        ("mullins", answer("missing_effect", "mullins"), ("right", True, True), ("right", True, True)),
        (
            "mullins",
            answer("missing_effect", "law", "mullins"),
            ("right", True, True),
            ("wrong", False, True),
        ),
        ("mullins", answer("law_off"), ("wrong", False, False), ("wrong", False, True)),
        ("gain_bump", answer("law_off"), ("right", True, False), ("wrong", False, True)),
        ("gain_bump", answer("unknown_effect"), ("right", True, True), ("right", True, True)),
        ("torque_ripple", answer("law_off"), ("wrong", False, False), ("wrong", False, True)),
    ],
)
def test_the_laws_own_shape_is_part_in_the_truth_where_the_law_is_off(
    kind: str, line: dict[str, Any], off: Any, exact: Any
) -> None:
    for law_error, wanted in ((0.01, off), (0.0, exact)):
        one = judged(kind, json.loads(json.dumps(line)), law_error)
        assert (one.outcome, one.by_class, one.alarm) == wanted
        assert one.wrong_kind is (kind == CLEAN and "mullins" in one.answer)


def a_class(*members: str, verdict: str = "missing_effect") -> dict[str, Any]:
    line = answer(verdict)
    line["result"]["selected_class"] = list(members)
    return line


@pytest.mark.parametrize(
    ("kind", "line", "classes", "right"),
    [
        ("stiffness", answer("law_off"), WITH_LAW, True),
        ("stiffness", answer("law_off"), (), False),
        ("mullins", answer("law_off"), WITH_LAW, False),
        ("stiffness", answer("ambiguous", credible=[["stiffness"], ["law"], []]), WITH_LAW, True),
        ("stiffness", answer("ambiguous", credible=[["stiffness"], []]), (), False),
        ("stiffness", a_class("law", "stiffness"), WITH_LAW, True),
        ("mullins", a_class("law", "stiffness"), WITH_LAW, False),
        ("mullins+stiffness", answer("missing_effect", "mullins"), WITH_LAW, True),
        ("mullins+stiffness", answer("missing_effect", "mullins"), (), False),
        ("mullins+stiffness", answer("law_off", "mullins"), WITH_LAW, True),
        (CLEAN, a_class("law", "stiffness"), WITH_LAW, True),
    ],
)
def test_static_effects_are_right_by_class_where_the_class_holds_the_law(
    kind: str, line: dict[str, Any], classes: Any, right: bool
) -> None:
    one = judged(kind, line, classes=classes)
    assert one.by_class is right
    if kind == CLEAN:
        assert not one.alarm and not one.wrong_kind


def test_sets_whose_class_could_be_split_are_counted_apart() -> None:
    alone = judged("mullins", answer("missing_effect", "mullins"), classes=WITH_LAW)
    classed = judged("stiffness", answer("missing_effect", "wall_thickness"), classes=WITH_LAW)
    clean = judged(CLEAN, answer("law_off"), classes=WITH_LAW)
    assert (alone.separable, classed.separable, clean.separable) == (True, False, None)
    found = splittable([alone, classed, clean])
    assert (found["could"]["right"], found["could"]["n"]) == (1, 2)
    assert (found["strictly"]["right"], found["strictly"]["n"]) == (1, 1)


@pytest.mark.parametrize(
    ("result", "outcome"),
    [
        ({"verdict": "missing_effect", "selected": ["payload_error"]}, "right"),
        ({"verdict": "missing_effect", "selected": ["stiffness"]}, "wrong"),
        ({"verdict": "unknown_effect", "selected": [], "bookkeeping": [{"kind": "payload"}]}, "right"),
        ({"verdict": "unknown_effect", "selected": [], "bookkeeping": [{"kind": "clock"}]}, "wrong"),
        (
            {"verdict": "missing_effect", "selected": ["stiffness"], "bookkeeping": [{"kind": "payload"}]},
            "wrong",
        ),
    ],
)
def test_a_wrong_record_is_right_where_the_mistake_is_told_and_no_other_effect_named(
    result: dict[str, Any], outcome: str
) -> None:
    one = judge("payload", make_label("wrong_payload", 0.01), {"result": result, "wall_s": 1.0})
    assert one.outcome == outcome
    other = judge("effect", make_label("mullins"), {"result": result, "wall_s": 1.0})
    assert not other.is_right
    assert summary([one, other])["told_wrongly"]["right"] == bool(result.get("bookkeeping"))


def estimated(low: float, high: float, kinds: tuple[str, ...] = ("backlash",)) -> dict[str, Any]:
    line = answer("missing_effect", *kinds)
    middle = {"value": (low + high) / 2, "sd": (high - low) / 3.29, "low": low, "high": high}
    one = {"kinds": list(kinds), "probability": 0.004, "parameters": {"backlash.play_rad": middle}}
    line["result"]["hypotheses"] = [{"kinds": [], "probability": 0.996, "parameters": {}}, one]
    return line


def test_intervals_hold_what_the_label_states_and_survive_the_stored_answers() -> None:
    label = make_label("backlash", 0.01) | {"parameters": {"backlash.play_rad": 0.05}}
    lines = [estimated(0.04, 0.06), estimated(0.052, 0.06), estimated(0.04, 0.06, ("backlash", "law"))]
    items = [judge("interval", label, line) for line in lines]
    assert [item.intervals[0][1] for item in items] == [True, False, True]
    assert items[1].intervals[0][2] == pytest.approx(0.006 / (0.008 / 3.29))
    found = covered(items)
    assert (found["all"]["right"], found["all"]["n"]) == (2, 3) and found["backlash.play_rad"]["n"] == 3
    stored = ledger.judged([ledger.compact(INTERVAL, label, line) for line in lines])
    assert [one.intervals[0][1] for one in stored] == [True, False, True]
    assert all(one.truth_fitted for one in items + stored)
    other = ledger.compact(EFFECT, make_label("backlash"), lines[0])
    assert "parameters" not in json.dumps(other) and other["result"]["truth_fitted"]
    assert judge("effect", make_label("mullins"), lines[0]).truth_fitted is False
    assert judge("clean", make_label(CLEAN), lines[0]).truth_fitted is None


def test_certain_answers_and_reliability_are_counted_over_both_beds() -> None:
    exact = [stated(0.995, True)] * 3 + [stated(0.9, False)]
    off = [stated(0.999, k < 4) for k in range(5)]
    assert (certain(exact)["right"], certain(exact)["n"]) == (3, 3)
    both = overall_tables(exact, off)
    assert (both["certain"]["right"], both["certain"]["n"]) == (7, 8) and both["calibration"]["n"] == 9


def test_the_second_bed_tables_are_written_from_numbers() -> None:
    items = [judged("stiffness", answer("missing_effect", "stiffness"), 0.02)] * 3
    items += [judge("clean", make_label(CLEAN, 0.01), answer("law_off"))] * 2
    data = json.loads(json.dumps(summary(items)))
    text = as_text(data)
    assert "| 1.2 to 3 | 100.0 % (3/3" in text and "law off by" in text
    page = "\n".join(LAW_OFF_TABLES["law_off"]({"law_off": data, "beds": data}))
    assert "| right effect by class | ≥ 93 % | **100.0 %** |" in page
    assert "No sealed run" in "\n".join(LAW_OFF_TABLES["law_off"]({}))
    assert "plane waves" in "\n".join(LAW_OFF_TABLES["law_off_forms"]({}))
    entry = {
        "began": "2026-12-01T00:00:00Z",
        "commit": "x",
        "code": "y",
        "planned": 3,
        "plan": {"bed": "law_off"},
    }
    assert "2026-12-01" in "\n".join(LAW_OFF_TABLES["law_off_runs"]({"ledger": [entry]}))
