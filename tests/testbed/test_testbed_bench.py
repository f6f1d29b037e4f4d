"""The bench of the diagnoser: seals hold, answers are judged as agreed, a killed bench goes on."""

from __future__ import annotations

import json
import math
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from benchmarks.evidence import results, seal
from benchmarks.evidence.judge import judge, summary, wilson
from benchmarks.evidence.sets import SetSpec
from benchmarks.evidence.tables import tables
from benchmarks.evidence.tasks import Plan, Task, small_plan
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN, right_verdicts
from hypothesis import given
from hypothesis import strategies as st

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
    assert (
        seal.passphrase_key("  Two words") == seal.passphrase_key("two  words") != seal.passphrase_key("two")
    )


def test_no_code_under_test_knows_of_seals_or_of_the_bench() -> None:
    words = ("unseal", ".sealed", "judge.key", "benchmarks.evidence", "benchmarks/evidence")
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


def label_of(kind: str) -> dict[str, Any]:
    label = {"kind": kind, "engine": "functional", "robot": "joint", "protocol": "rich", "excited": True}
    return label | {"right": list(right_verdicts(kind)), "snr_reached": 2.0}


def answer(verdict: str, *selected: str, credible: Any = ()) -> dict[str, Any]:
    result = {
        "verdict": verdict,
        "selected": list(selected),
        "credible_set": [{"kinds": k} for k in credible],
    }
    return {"result": result, "wall_s": 1.0}


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
    judged = judge("effect", label_of(kind), line)
    assert (judged.outcome, judged.alarm) == (outcome, alarm)


def test_improve_is_judged_by_its_last_step() -> None:
    steps = [{"added": [], "rmse_over_floor": 2.4}, {"added": ["mullins"], "rmse_over_floor": 1.05}]
    judged = judge("improve", label_of("mullins"), {"result": {"steps": steps}, "wall_s": 1.0})
    assert judged.outcome == "right" and judged.start_over_floor == 2.4 and judged.end_over_floor == 1.05


def test_summary_counts_what_it_is_given() -> None:
    lines = [("mullins", answer("missing_effect", "mullins", credible=[["mullins"]]))] * 3
    lines += [("mullins", answer("missing_effect", "stiffness", credible=[["stiffness"], ["mullins"]]))]
    items = [judge("effect", label_of(kind), line) for kind, line in lines]
    items += [judge("clean", label_of(CLEAN), answer("nothing_missing"))] * 9
    items += [judge("clean", label_of(CLEAN), answer("missing_effect", "stiffness"))]
    data = summary(items)
    assert (data["effects"]["right"], data["effects"]["n"]) == (3, 4)
    assert (data["false_alarms"]["right"], data["false_alarms"]["n"]) == (1, 10)
    assert data["credible_set"]["coverage"]["right"] == 4 and data["credible_set"]["median_size"] == 1
    assert data["confusion"]["effect"] == {"mullins": {"mullins": 3, "stiffness": 1}}
    page = tables(json.loads(json.dumps(data)))
    assert "mullins 3, stiffness 1" in page and "75.0 %" in page
    assert "none tried" in tables(summary([]))


def test_the_plan_is_what_the_issue_asks_for() -> None:
    tasks = Plan().tasks()
    effects = [task.spec for task in tasks if task.group == "effect"]
    assert all(sum(spec.kind == kind for spec in effects) >= 15 for kind in KINDS)
    clean = [task.spec for task in tasks if task.group == "clean"]
    assert len(clean) >= 100 and sum(spec.engine == "mujoco" for spec in clean) * 2 == len(clean)
    unknown = [task.spec for task in tasks if task.group == "unknown"]
    assert len({spec.kind for spec in unknown}) >= 5 and len(unknown) >= 40
    pairs = [task.spec for task in tasks if task.group == "pair"]
    assert len({spec.kind for spec in pairs}) == len(pairs) >= 60
    for kind in KINDS:  # both engines, and a chain in each
        made_as = {(spec.engine, spec.robot) for spec in effects if spec.kind == kind}
        assert len(made_as) == 4
    names = {task.secret_id(KEY) for task in tasks}
    assert len(names) == len(tasks) and not [n for n in names if any(k in n for k in (*KINDS, *UNKNOWN))]
    task = Task("effect", SetSpec("mullins", 0))
    assert task.secret_id(KEY) == task.secret_id(KEY) != task.secret_id(KEY[::-1])
    assert len(small_plan().tasks()) == 5


def test_a_torn_line_is_closed_off_and_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "r.jsonl"
    results.append(path, {"id": "a", "n": 1})
    with path.open("a") as file:
        file.write('{"id": "b", "n"')  # killed while writing
    results.append(path, {"id": "c", "n": 3})
    assert results.read(path) == {"a": {"id": "a", "n": 1}, "c": {"id": "c", "n": 3}}
    assert results.read(tmp_path / "none.jsonl") == {}


def bench(out: Path, *more: str, seconds: str = "0") -> subprocess.Popen[str]:
    command = [sys.executable, str(ROOT / "benchmarks" / "evidence" / "run_bench.py"), "--out", str(out)]
    command += ["--diagnoser", "testbed_stand_in", "--workers", "1", "--kinds", "stiffness", "--seeds", "3"]
    command += ["--weak", "0", "--beside", "0", "--improve", "0", "--pairs", "0", "--chain-every", "0", *more]
    paths = {"PYTHONPATH": str(Path(__file__).parent), "STAND_IN_SECONDS": seconds}
    return subprocess.Popen(
        command, env=os.environ | paths, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def test_a_killed_bench_goes_on_where_it_was(tmp_path: Path) -> None:
    lines = tmp_path / "evidence" / "full.jsonl"
    first = bench(tmp_path, seconds="2")
    while not (lines.exists() and results.read(lines)):
        assert first.poll() is None, first.communicate()[0]
        time.sleep(0.1)
    first.send_signal(signal.SIGKILL)
    first.wait()
    before = results.read(lines)
    assert 1 <= len(before) < 3
    second = bench(tmp_path)
    said = second.communicate()[0]
    assert second.returncode == 0, said
    assert f"3 sets, {len(before)} done before" in said
    after = results.read(lines)
    assert len(after) == 3 and all(after[name] == line for name, line in before.items())
    data = json.loads((tmp_path / "evidence.json").read_text())
    assert (data["effects"]["right"], data["effects"]["n"]) == (3, 3)
    third = bench(tmp_path, "--summarise")
    assert "stiffness 3" in third.communicate()[0] and third.returncode == 0
