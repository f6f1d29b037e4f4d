"""Requirements of a design: inequalities in words, and the amount by which one is violated."""

from __future__ import annotations

from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from pliant.errors import InvalidDesignError
from pliant.families import UNITS, Need, check_design
from pliant.interfaces.family import FamilyConfig
from pliant.units import Length


class TubeConfig(FamilyConfig):
    """A tube that may have no cap."""

    kind: Literal["tube"] = "tube"
    radius_m: Length = 5e-3
    wall_m: Length = 1e-3
    cap_m: Length = Field(default=0.0, ge=0)
    rib_m: Length | None = None


@pytest.mark.parametrize(
    ("words", "left", "right", "kept", "says"),
    [
        ("a > b", 2e-3, 1e-3, True, ""),
        ("a > b", 1e-3, 1e-3, False, "a > b, but 1 mm ≤ 1 mm"),
        ("a ≥ b", 1e-3, 1e-3, True, ""),
        ("a ≥ b (room)", 1e-3, 1.5e-3, False, "a ≥ b (room), but 1 mm < 1.5 mm, short by 0.5 mm"),
        ("a < b", 2e-3, 1e-3, False, "a < b, but 2 mm ≥ 1 mm, over by 1 mm"),
        ("a ≤ b", 2e-3, 1e-3, False, "a ≤ b, but 2 mm > 1 mm, over by 1 mm"),
        ("a > 0", -1e-3, 0.0, False, "a > 0, but it is −1 mm"),
        ("a < b", 1.6, 14e-3, False, f"a < b, but 1600 mm ≥ 14 mm, over by 1586 mm{UNITS}"),
    ],
)
def test_an_inequality_says_how_it_is_broken(
    words: str, left: float, right: float, kept: bool, says: str
) -> None:
    need = Need(words, left, right)
    assert need.is_kept is kept
    assert not says or str(need) == says


@given(st.floats(1e-6, 1.0), st.floats(-4e-7, 4e-7))
def test_rounding_neither_breaks_nor_keeps(size: float, rounding: float) -> None:
    near = size * (1 + rounding)
    assert Need("a ≥ b", size, near).is_kept
    assert Need("a ≤ b", size, near).is_kept
    assert not Need("a > b", size, near).is_kept
    assert not Need("a < b", size, near).is_kept


def test_a_need_without_a_sign_is_the_authors_mistake() -> None:
    with pytest.raises(ValueError, match="none of the signs"):
        _ = Need("a and b", 1.0, 1.0).is_kept


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"wall": 0}, "tube needs wall > 0, but it is 0 mm"),
        ({"rib": "-2 mm"}, "tube needs rib > 0, but it is −2 mm"),
        ({"radius": 5}, "tube needs radius ≤ 1 m, but 5000 mm > 1000 mm.*units forgotten"),
        ({"wall": "5 mm"}, "tube needs radius > wall, but 5 mm ≤ 5 mm"),
    ],
)
def test_lengths_come_first_then_the_familys_own(changes: dict[str, object], says: str) -> None:
    config = TubeConfig.model_validate(changes)
    with pytest.raises(InvalidDesignError, match=says):
        check_design(config, [Need("radius > wall", config.radius_m, config.wall_m)])


def test_a_length_may_be_0_where_its_field_says_so() -> None:
    check_design(TubeConfig())


def test_the_sentence_ends_once() -> None:
    with pytest.raises(InvalidDesignError, match=r"were units forgotten\?\)\.$"):
        check_design(TubeConfig.model_validate({"radius": 5}))
