"""`backlash`: the play operator on angles in the order of samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.effects.bench import model_with

from pliant.records.design import Array
from pliant.testing.samples import sample_chain

WIDTH = 0.04
paths = arrays(float, st.integers(2, 40), elements=st.floats(-1.0, 1.0))


def read(angle: Array, width: float = WIDTH) -> Array:
    model = model_with(sample_chain(modules=2), "backlash", play_rad=width)
    said: Array = model.reported({"angle_rad": angle})["angle_rad"]
    return said


def test_a_triangle_gives_a_loop_with_the_full_width_and_plateaus_at_the_ends() -> None:
    """Closed form after the first turn: q − w/2 rising, q + w/2 falling, constant over the clearance at a reversal."""
    up = np.linspace(0.0, 0.6, 61)
    q = np.concatenate([up, up[-2::-1], up[1:], up[-2::-1]])
    y = read(q)
    rising, falling = slice(120, 181), slice(180, 241)
    np.testing.assert_allclose(y[rising], np.maximum(q[rising] - WIDTH / 2, WIDTH / 2), atol=1e-15)
    np.testing.assert_allclose(y[falling], np.minimum(q[falling] + WIDTH / 2, 0.6 - WIDTH / 2), atol=1e-15)
    loop = float(np.trapezoid(y[120:], q[120:]))
    assert abs(loop) == pytest.approx(WIDTH * (0.6 - WIDTH), rel=1e-3)


@given(paths)
def test_the_reading_is_never_farther_than_half_the_clearance(angle: Array) -> None:
    y = read(angle)
    assert y[0] == angle[0]
    assert float(np.abs(y - angle).max()) <= WIDTH / 2 + 1e-15
    moved = np.abs(np.diff(y)) > 1e-15
    touching = np.abs(np.abs(y - angle)[1:] - WIDTH / 2) < 1e-12
    assert np.all(touching[moved])


@given(paths, st.floats(-1.0, 1.0))
def test_it_shifts_with_the_angle_and_turns_over_with_it(angle: Array, shift: float) -> None:
    np.testing.assert_allclose(read(angle + shift), read(angle) + shift, atol=1e-14)
    np.testing.assert_allclose(read(-angle), -read(angle), atol=1e-15)


@given(paths)
def test_it_does_not_count_samples_or_ask_for_the_rate(angle: Array) -> None:
    """Additional samples on the straight lines change nothing: the play operator is rate-independent."""
    t = np.arange(len(angle), dtype=float)
    fine = np.arange(0.0, len(angle) - 1 + 1e-9, 0.25)
    np.testing.assert_allclose(read(np.interp(fine, t, angle))[::4], read(angle), atol=1e-14)


def test_movements_within_the_clearance_are_not_seen_and_each_sensor_has_its_own() -> None:
    small = 0.3 + 0.019 * np.sin(np.linspace(0, 20, 200))
    assert float(np.ptp(read(small))) == pytest.approx(0.0, abs=1e-15)
    model = model_with(sample_chain(modules=2), "backlash", play_rad=WIDTH)
    ramp = np.linspace(0.0, 0.5, 11)
    said = model.reported(
        {"angle_rad": 2 * ramp, "joint_1_angle_rad": ramp, "joint_2_angle_rad": ramp, "tip_x_m": ramp}
    )
    assert said["angle_rad"][-1] == pytest.approx(1.0 - WIDTH / 2)
    assert said["joint_1_angle_rad"][-1] + said["joint_2_angle_rad"][-1] == pytest.approx(1.0 - WIDTH)
    assert said["tip_x_m"] is ramp


def test_single_states_and_no_samples_have_no_past() -> None:
    model = model_with(sample_chain(modules=2), "backlash", play_rad=WIDTH)
    readings = {"angle_rad": 0.3, "joint_angles_rad": [[0.1], [0.2]]}
    assert model.reported(readings) == readings
    assert len(read(np.zeros(0))) == 0
    assert read(np.array([0.7])).tolist() == [0.7]
