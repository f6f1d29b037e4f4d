"""Effects of a step that gain nothing after the others are left out of a model of one's own."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from tests.pliant_systems.hinge import write_bench

from pliant import api
from pliant.diagnosis import improvement
from pliant.diagnosis.improvement import SURE, _Walk


def walk_of(study: Path, monkeypatch: pytest.MonkeyPatch, gains: dict[str, float]) -> tuple[_Walk, list[str]]:
    """Return a walk whose extensions gain these standard errors by their last kind, and what it takes."""
    opened = api.open_study(study, store=study.parent / "store")
    walk = _Walk(opened.context, opened.study, api.read_measurement(opened), None, None, 1, None)
    taken: list[str] = []

    def extended(ground: Any, effects: Any, kinds: list[str], **_: Any) -> str:
        return kinds[-1] if len(kinds) - len(walk.added) == 1 else "whole"

    def take(kind: str, *_: Any) -> None:
        taken.append(kind)
        walk.added.append(kind)

    monkeypatch.setattr(improvement, "extend", extended)
    monkeypatch.setattr(walk, "_gains", lambda found, sure: gains[found] > sure)
    monkeypatch.setattr(walk, "_take", take)
    return walk, taken


@pytest.mark.parametrize(
    ("cause", "gains", "expected"),
    [
        ("open", {"whole": 9.0, "b": 0.0}, ["a"]),
        ("open", {"whole": 9.0, "b": 2.0}, ["a"]),
        ("open", {"whole": 9.0, "b": 3.0}, ["a", "b"]),
        ("named", {"whole": 9.0, "b": 2.0}, ["a", "b"]),
        ("named", {"whole": 9.0, "b": 0.5}, ["a"]),
        ("open", {"whole": 2.0, "b": 9.0}, []),
        ("named", {"whole": 2.0, "b": 9.0}, ["a", "b"]),
    ],
)
def test_every_effect_earns_itself(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cause: str,
    gains: dict[str, float],
    expected: list[str],
) -> None:
    assert 2.0 < SURE < 3.0
    walk, taken = walk_of(write_bench(tmp_path, n=40), monkeypatch, gains)
    proposal: Any = SimpleNamespace(order=("a", "b"), stands_for=(), cause=cause, forms=())
    stop, _ = walk._refused(proposal, 6)
    assert taken == expected
    assert stop == ("" if expected else "no_gain")
