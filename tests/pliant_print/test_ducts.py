"""Ducts between facing sections, channels to cavities of another input, and where a run's modules lie."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import NotReachedError
from pliant.records.design import Array
from pliant_print.ducts import Openings, ducts, section_openings, supply
from pliant_print.loops import Loop
from pliant_print.module_solid import ModuleSolid
from pliant_print.pieces import StackedPiece, module_pose

LOW_M, HIGH_M = 0.0, 6e-3
SQUARE = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])  # clockwise: a hole


def opening(y_mm: float, z_mm: float, half_mm: float = 1.0) -> Loop:
    return Loop(np.arange(4), 1e-3 * (half_mm * SQUARE + [y_mm, z_mm]))


def rim(half_mm: float = 10.0) -> Loop:
    return Loop(np.arange(4), 1e-3 * half_mm * SQUARE[::-1])


def section(bores: tuple[Loop, ...] = (), **holes: Loop) -> Openings:
    return Openings([rim(), *holes.values(), *bores], holes, bores)


def extent_mm(body: object) -> Array:
    low_high: Array = np.array(body.bounding_box()).reshape(2, 3)  # type: ignore[attr-defined]
    return low_high


def test_a_duct_joins_openings_of_the_same_cavity() -> None:
    left = section(a=opening(5, 0), b=opening(-5, 0))
    right = section(b=opening(-5, 2), a=opening(5, 2))
    first, second = ducts(left, right, LOW_M, HIGH_M, closed=())
    np.testing.assert_allclose(extent_mm(first), [[0, 4.4, -0.6], [6, 5.6, 2.6]], atol=2e-2)
    np.testing.assert_allclose(extent_mm(second), [[0, -5.6, -0.6], [6, -4.4, 2.6]], atol=2e-2)


def test_a_closed_cavity_has_no_duct_and_the_bore_keeps_its_width() -> None:
    left, right = (section((opening(0, 0),), a=opening(5, 0), b=opening(-5, 0)) for _ in range(2))
    made = ducts(left, right, LOW_M, HIGH_M, closed=("b",))
    assert len(made) == 2
    np.testing.assert_allclose(extent_mm(made[1]), [[0, -1, -1], [6, 1, 1]], atol=2e-2)


def test_ducts_that_would_meet_are_refused() -> None:
    left = section(a=opening(5, 0), b=opening(-5, 0))
    right = section(a=opening(-5, 0), b=opening(5, 0))
    with pytest.raises(NotReachedError, match="would meet"):
        ducts(left, right, LOW_M, HIGH_M, closed=())


@pytest.mark.parametrize(("bores", "end_mm"), [((opening(0, 0),), 0.0), ((), 20.0)])
def test_a_channel_leads_to_the_bore_or_to_the_outside(bores: tuple[Loop, ...], end_mm: float) -> None:
    channel = supply(section(bores, a=opening(5, 0)), "a", LOW_M, HIGH_M, width_m=1e-3)
    low, high = extent_mm(channel)
    assert high[0] == pytest.approx(6.0)
    assert low[0] == pytest.approx(2.5, abs=2e-2)  # half of the piece stays closed toward the other segment
    reached = low[1] if end_mm < 5 else high[1] / np.sqrt(2)  # the rim is a square's corner
    assert reached == pytest.approx(end_mm, abs=2e-2)


def module(offset_m: float) -> ModuleSolid:
    """Return a module whose two cavities lie on both sides of its centre line, in z."""
    sides = {"up": 1e-3 * np.array([[0.0, 0.0, 8.0]]), "down": 1e-3 * np.array([[0.0, 0.0, 2.0]])}
    return ModuleSolid({}, {}, sides, 10e-3, offset_m)


def test_modules_of_a_run_follow_each_other_about_the_centre_line() -> None:
    piece = StackedPiece(module(5e-3), 3, np.pi / 2, 20e-3, 10e-3)
    assert piece.end_m == pytest.approx(50e-3)
    rotation, position = module_pose(piece, 2)
    np.testing.assert_allclose(rotation @ [0, 0, 5e-3] + position, [45e-3, 0, 0], atol=1e-12)
    np.testing.assert_allclose(rotation @ [0, 0, 8e-3] + position, [45e-3, -3e-3, 0], atol=1e-12)


def test_openings_take_the_names_of_the_cavities_at_them() -> None:
    """The quarter turn brings the cavity above the centre line to −y."""
    piece = StackedPiece(module(5e-3), 1, np.pi / 2, 0.0, 10e-3)
    corner = 1.0 / 2
    aside = opening(-3 + corner, corner, corner), opening(3 + corner, corner, corner)
    found = section_openings(piece, [rim(), opening(0, 0, 0.5), *aside])
    assert found.holes == {"up": aside[0], "down": aside[1]}
    assert len(found.bores) == 1
