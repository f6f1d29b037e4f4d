"""The judge of the diagnoser: seals work, answers are judged as agreed, shares have their closed forms."""

from __future__ import annotations

import json
import math
import stat
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from benchmarks.evidence import seal
from benchmarks.evidence.counting import reliability, summary, wilson
from benchmarks.evidence.judge import judge
from benchmarks.evidence.publish import as_text
from benchmarks.evidence.truths import CLEAN, KINDS
from hypothesis import given
from hypothesis import strategies as st
from tests.testbed.judged_lines import CLASSES, answer, make_label, stated

ROOT = Path(__file__).resolve().parents[2]
KEY = bytes(range(32))
Z2 = 1.959963984540054**2


@given(st.dictionaries(st.text(), st.floats(allow_nan=False) | st.text()))
def test_a_sealed_label_opens_with_its_key_only(label: dict[str, Any]) -> None:
    text = seal.seal(label, KEY)
    assert seal.unseal(text, KEY) == label
    with pytest.raises(seal.BrokenSealError):
        seal.unseal(text, KEY[::-1])


def test_a_sealed_label_says_nothing_and_breaks_when_touched() -> None:
    label = {"kind": "mullins", "strength": 1.0}
    text = seal.seal(label, KEY)
    assert seal.seal(label, KEY) != text  # the stream is used once
    plain = json.dumps(label).encode().hex()
    assert plain[:8] not in text
    for at in range(0, len(text) - 1, 17):
        if text[at] in "\n":
            continue
        changed = text[:at] + ("0" if text[at] != "0" else "1") + text[at + 1 :]
        with pytest.raises(seal.BrokenSealError):
            seal.unseal(changed, KEY)
    with pytest.raises(seal.BrokenSealError, match="no sealed label"):
        seal.unseal("hello", KEY)


def test_the_judges_key_is_made_once_and_for_its_owner(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "judge.key"
    key = seal.judge_key(path)
    assert seal.judge_key(path) == key and len(key) == seal.KEY_BYTES
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    one, again, other = map(seal.passphrase_key, ("  Two words", "two  words", "two"))
    assert one == again != other


def test_no_code_under_test_knows_about_seals_or_the_bench() -> None:
    words = ("unseal(", ".sealed", "judge.key", "benchmarks.evidence", "benchmarks/evidence")
    for room in ("core", "plugins", "contrib"):
        for file in (ROOT / room).rglob("*.py"):
            text = file.read_text()
            assert not [word for word in words if word in text], file


def test_the_examples_label_is_sealed_and_opens_for_nobody_else() -> None:
    folder = ROOT / "examples" / "hidden_effect"
    script = [sys.executable, str(folder / "open_label.py"), "not", "the", "words"]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "stays closed" in done.stderr and not done.stdout
    given_away = "".join((folder / name).read_text() for name in ("bench.csv", "finger.yaml"))
    assert not [kind for kind in KINDS if kind in given_away]


def test_wilsons_interval_has_its_closed_forms() -> None:
    assert wilson(0, 0) == (0.0, 1.0)
    assert wilson(0, 20) == pytest.approx((0.0, Z2 / (20 + Z2)))
    assert wilson(20, 20) == pytest.approx((20 / (20 + Z2), 1.0))
    n = 100
    half = math.sqrt(Z2) / (2 * math.sqrt(n + Z2))
    assert wilson(50, n) == pytest.approx((0.5 - half, 0.5 + half))
    low, high = wilson(45, 50)
    for bound in (low, high):  # the bounds solve (p̂ − p)² = z² p (1 − p)/n
        assert (0.9 - bound) ** 2 == pytest.approx(Z2 * bound * (1 - bound) / 50)


@pytest.mark.parametrize(
    ("kind", "line", "outcome", "alarm"),
    [
        ("mullins", answer("missing_effect", "mullins"), "right", True),
        ("mullins", answer("missing_effect", "stiffness"), "wrong", True),
        ("mullins", answer("missing_effect", "mullins", "stiffness"), "wrong", True),
        ("mullins", answer("ambiguous", credible=[["mullins"], ["stiffness"]]), "ambiguous", True),
        ("mullins", answer("nothing_missing"), "wrong", False),
        ("mullins", {"error": "boom", "wall_s": 0.1}, "error", False),
        (CLEAN, answer("nothing_missing"), "right", False),
        (CLEAN, answer("ambiguous", credible=[[], ["stiffness"]]), "ambiguous", False),
        (CLEAN, answer("not_repeatable"), "wrong", True),
        (CLEAN, answer("insufficient_data"), "ambiguous", False),
        ("torque_ripple", answer("unknown_effect"), "right", True),
        ("torque_ripple", answer("missing_effect", "viscoelastic"), "wrong", True),
        ("torque_ripple", answer("not_repeatable"), "wrong", True),
        ("run_slip", answer("not_repeatable"), "right", True),
        ("stiffness+mullins", answer("missing_effect", "mullins", "stiffness"), "right", True),
        ("stiffness+mullins", answer("missing_effect", "mullins"), "wrong", True),
    ],
)
def test_outcomes(kind: str, line: dict[str, Any], outcome: str, alarm: bool) -> None:
    judged = judge("effect", make_label(kind), line)
    assert (judged.outcome, judged.alarm) == (outcome, alarm)


def test_improve_is_judged_by_its_last_step() -> None:
    steps = [{"added": [], "rmse_over_floor": 2.4}, {"added": ["mullins"], "rmse_over_floor": 1.05}]
    judged = judge("improve", make_label("mullins"), {"result": {"steps": steps}, "wall_s": 1.0})
    assert judged.outcome == "right" and judged.start_over_floor == 2.4 and judged.end_over_floor == 1.05


def test_summary_counts_what_it_is_given() -> None:
    lines = [("mullins", answer("missing_effect", "mullins", credible=[["mullins"]]))] * 3
    lines += [("mullins", answer("missing_effect", "stiffness", credible=[["stiffness"], ["mullins"]]))]
    items = [judge("effect", make_label(kind), line) for kind, line in lines]
    items += [judge("clean", make_label(CLEAN), answer("nothing_missing"))] * 9
    items += [judge("clean", make_label(CLEAN), answer("missing_effect", "stiffness"))]
    data = summary(items)
    assert (data["effects"]["right"], data["effects"]["n"]) == (3, 4)
    assert (data["false_alarms"]["right"], data["false_alarms"]["n"]) == (1, 10)
    assert data["credible_set"]["coverage"]["right"] == 4 and data["credible_set"][
        "mean_size"
    ] == pytest.approx(1.25)
    assert data["confusion"]["effect"] == {"mullins": {"mullins": 3, "stiffness": 1}}
    page = as_text(json.loads(json.dumps(data)))
    assert "mullins 3, stiffness 1" in page and "75.0 %" in page
    assert "not tried" in as_text(summary([]))


@pytest.mark.parametrize(
    ("kind", "line", "by_class"),
    [
        ("stiffness", answer("missing_effect", "stiffness"), True),
        ("stiffness", answer("missing_effect", "wall_thickness"), True),
        ("stiffness", answer("missing_effect", "mullins"), False),
        ("stiffness", answer("missing_effect", "stiffness", "wall_thickness"), False),
        ("stiffness", answer("ambiguous", credible=[["actuation_gain"], ["wall_thickness"]]), True),
        ("stiffness", answer("ambiguous", credible=[["stiffness"], ["mullins"]]), False),
        ("stiffness", answer("ambiguous", credible=[["stiffness"], []]), False),
        ("stiffness", answer("ambiguous"), False),
        ("mullins", answer("ambiguous", credible=[["stiffness"], ["wall_thickness"]]), False),
        ("mullins+stiffness", answer("missing_effect", "mullins", "wall_thickness"), True),
        ("mullins+stiffness", answer("missing_effect", "stiffness", "wall_thickness"), False),
        (CLEAN, answer("missing_effect", "stiffness"), False),
        ("torque_ripple", answer("missing_effect", "stiffness"), False),
    ],
)
def test_right_by_class_is_what_the_answer_declared(kind: str, line: dict[str, Any], by_class: bool) -> None:
    line["result"]["classes"] = [{"kinds": kinds} for kinds in CLASSES]
    assert judge("effect", make_label(kind), line).by_class is by_class


def test_reliability_has_bins_with_equal_width_and_its_closed_forms() -> None:
    items = [stated(0.65, k % 20 < 13) for k in range(60)] + [stated(0.9, k % 10 < 9) for k in range(50)]
    honest = reliability(items)
    assert [(row["above"], row["n"]) for row in honest["bins"]] == [(0.6, 60), (0.9, 50)]
    assert honest["error"] == pytest.approx(0.0, abs=1e-12)
    assert honest["brier"] == pytest.approx((60 * 0.65 * 0.35 + 50 * 0.9 * 0.1) / 110)
    boasting = reliability([stated(1.0, k < 7) for k in range(10)])
    assert boasting["error"] == pytest.approx(0.3) and boasting["brier"] == pytest.approx(0.3)
    assert reliability([])["error"] is None


def a_class(verdict: str, *members: str, beside: Sequence[str] = ()) -> dict[str, Any]:
    line = answer(verdict)
    line["result"] |= {"selected_class": list(members), "beside_class": list(beside)}
    return line


@pytest.mark.parametrize("verdict", ["missing_effect", "ambiguous"])
def test_a_class_is_right_by_class_where_it_holds_the_truth_and_never_strictly(verdict: str) -> None:
    held = judge("effect", make_label("stiffness"), a_class(verdict, "wall_thickness", "stiffness"))
    assert (held.outcome, held.by_class, held.wrong_kind, held.answer) == ("class", True, False, "its class")
    not_held = judge("effect", make_label("mullins"), a_class(verdict, "wall_thickness", "stiffness"))
    assert (not_held.outcome, not_held.by_class, not_held.wrong_kind) == ("wrong", False, True)
    assert not_held.answer == "another class"
    assert judge("clean", make_label(CLEAN), a_class(verdict, "wall_thickness", "stiffness")).wrong_kind
    pair = make_label("mullins+stiffness")
    assert judge("pair", pair, a_class(verdict, "wall_thickness", "stiffness", beside=["mullins"])).by_class
    assert not judge("pair", pair, a_class(verdict, "wall_thickness", "stiffness")).by_class
    assert not judge("effect", make_label("mullins"), a_class(verdict, "mullins")).by_class  # one is no class


@pytest.mark.parametrize(
    ("kind", "line", "wrong"),
    [
        ("mullins", answer("missing_effect", "mullins"), False),
        ("mullins", answer("missing_effect", "stiffness"), True),
        ("mullins", answer("missing_effect", "mullins", "stiffness"), True),
        ("wall_thickness", answer("missing_effect", "stiffness"), False),  # declared to be one class
        ("mullins+stiffness", answer("missing_effect", "mullins"), False),
        ("mullins+stiffness", answer("missing_effect", "leak", "stiffness"), True),
        ("torque_ripple", answer("missing_effect", "viscoelastic"), True),
        (CLEAN, answer("missing_effect", "leak"), True),
        ("mullins", answer("ambiguous", credible=[["leak"]]), False),
        ("mullins", answer("unknown_effect"), False),
    ],
)
def test_a_wrong_kind_is_outside_the_truths_class(kind: str, line: dict[str, Any], wrong: bool) -> None:
    line["result"]["classes"] = [{"kinds": kinds} for kinds in CLASSES]
    assert judge("effect", make_label(kind), line).wrong_kind is wrong
