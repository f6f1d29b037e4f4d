"""The page of the closed loop's sealed runs is what its script writes, and the counts are those of the answers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.bench import publish
from benchmarks.bench.loop_answers import Answer, as_text, store, stored, summary

from benchmarks import pages

RIGHT = Answer(
    "chosen",
    "a",
    "effect",
    "mullins",
    "joint",
    "mujoco",
    "right",
    "mullins",
    True,
    True,
    False,
    "verdict",
    5,
    4.0,
    40.0,
    9.0,
)


def test_the_page_is_what_the_script_writes() -> None:
    text = publish.PAGE.read_text()
    assert pages.rendered(text, publish.MARK, publish.TABLES, publish.result()) == text


def test_counts_and_ratios(tmp_path: Path) -> None:
    by_class = replace(RIGHT, truth="b", strictly=False, minutes=10.0)
    wrong = replace(RIGHT, truth="c", strictly=False, right=False, wrong_kind=True, outcome="wrong")
    random = [replace(RIGHT, arm="random", minutes=8.0), replace(by_class, arm="random", right=False)]
    answers = [RIGHT, by_class, wrong, *random]
    data = summary(answers)
    chosen = data["chosen"]
    assert (chosen["n"], chosen["right"], chosen["strictly"], chosen["wrong_kind"]) == (3, 2, 1, 1)
    assert chosen["groups"]["effect"] == [2, 3]
    # the random runs that ended wrong would have needed more than all their minutes
    to_random, to_rich = data["chosen_to_random"], data["chosen_to_rich_whole"]
    assert to_random == {"median": 0.25, "n": 2, "median_both_right": 0.5, "n_both_right": 1}
    assert to_rich["median"] == pytest.approx((4.0 / 40.0 + 10.0 / 40.0) / 2)
    assert to_rich["n"] == to_rich["n_both_right"] == 2
    assert "not (wrong)" in as_text(data, answers)
    store(answers, {"code": "x"}, tmp_path / "answers.jsonl.gz")
    assert stored(tmp_path / "answers.jsonl.gz") == ({"code": "x"}, answers)
