"""Damaged inputs of all kinds are answered within their time and memory; inputs that once broke a reader are too."""

import pytest
from tests.fuzz import judge
from tests.fuzz.judge import verdict
from tests.fuzz.run import case, finds, kept
from tests.fuzz.targets import Target, targets
from tests.slow import slow_among

CASES, PARTS = 2000, 4
TARGETS = {target.name.replace(" ", "_"): target for target in targets()}


@pytest.mark.parametrize("part", slow_among(range(PARTS), *range(1, PARTS)))
def test_damaged_inputs_are_answered(part):
    broken = [(number, wrong) for number, _, _, wrong in finds(range(part, CASES, PARTS), seed=0)]
    assert broken == [], "python -m tests.fuzz.run --only NUMBER shows one"


@pytest.mark.parametrize("path", kept(), ids=lambda path: path.stem)
def test_what_broke_once(path):
    assert verdict(TARGETS[path.stem.rpartition("-")[0]], path.read_bytes()) == ""


@pytest.mark.parametrize("name", TARGETS)
def test_sound_inputs_are_read(name, tmp_path):
    for number, seed in enumerate(TARGETS[name].seeds):
        place = tmp_path / str(number)
        place.mkdir()
        try:
            TARGETS[name].feed(seed, place)
        except Exception as error:  # examples name files in the same folder
            assert name == "study" and "file" in str(error), (number, error)


def test_a_case_comes_back_by_its_number():
    one, other = case(17, 3, targets()), case(17, 3, targets())
    assert one[1] == other[1] != case(18, 3, targets())[1]


def _loops(data, folder):
    while True:
        pass


def _swells(data, folder):
    return [bytes(10_000_000) for _ in range(100)]


def _traceback(data, folder):
    return {}["key"]


@pytest.mark.parametrize(
    ("feed", "words"), [(_loops, "more than 0.2 s"), (_swells, "MB"), (_traceback, "KeyError")]
)
def test_the_judge_sees_what_is_wrong(feed, words, monkeypatch):
    assert judge.LONGEST_S == 2.0
    monkeypatch.setattr(judge, "LONGEST_S", 0.2)
    assert words in verdict(Target("bad", (), feed), b"")
