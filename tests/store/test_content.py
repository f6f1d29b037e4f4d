"""Digests of contents: equal for equal numbers, different for anything that differs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from pliant.store.content import content_digest


@dataclass(frozen=True, eq=False)
class StoredReading:
    name: str
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class OtherRecord:
    name: str
    values: np.ndarray


def test_what_is_equal_has_one_digest() -> None:
    one, same = (StoredReading("a", np.array([1.0, np.nan, 3.0])) for _ in range(2))
    assert content_digest(one) == content_digest(same)
    assert content_digest({"a": 1, "b": (2, None)}) == content_digest({"b": [2, None], "a": 1})
    assert content_digest(np.arange(6).reshape(2, 3).T) == content_digest(np.arange(6).reshape(2, 3).T.copy())


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 1.0),
        (1, True),
        ("1", 1),
        (["ab", "c"], ["a", "bc"]),
        ([1, [2]], [[1], 2]),
        (np.zeros(4), np.zeros((2, 2))),
        (np.zeros(2), np.zeros(2, np.float32)),
        ({"a": 1}, {"b": 1}),
        (StoredReading("a", np.zeros(1)), OtherRecord("a", np.zeros(1))),
        (StoredReading("a", np.zeros(1)), StoredReading("a", np.array([1e-300]))),
    ],
)
def test_what_differs_has_two(one: object, other: object) -> None:
    assert content_digest(one) != content_digest(other)


@pytest.mark.parametrize("value", [object(), np.array([object()]), {"a": {1, 2}}])
def test_what_has_no_plain_content_is_refused(value: object) -> None:
    with pytest.raises(TypeError, match="digest"):
        content_digest(value)
