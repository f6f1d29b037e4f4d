"""Each effect of inputs and outputs by its law."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.interfaces.model import SystemEffect, SystemParts
from pliant.mechanics.rotations import exp_map
from pliant.records.design import Array
from pliant.records.history import History
from pliant.registry.discovery import discover

REGISTRY = discover().for_model("python")
CLOCK = np.arange(0.0, 4.0, 0.01)
WAVE = 1.5 * np.sin(2.0 * CLOCK)
STEP = np.where(CLOCK >= 1.0 - 1e-9, 2.0, 0.0)
SCALES = {"drive": 2.0, "other": 3.0, "angle_rad": 2.0}


def effect(kind: str, **values: float) -> SystemEffect:
    component = REGISTRY.get("effect", kind)
    built: SystemEffect = component.build(component.config_model().model_validate({"kind": kind, **values}))
    return built


def parts(*outputs: str) -> SystemParts:
    return SystemParts(scales=SCALES, names=(("drive", "other"), outputs or ("angle_rad",)))


def acting(kind: str, values: Array, **numbers: float) -> Array:
    """Return the input that reaches the system."""
    history = History.from_arrays({"drive": values, "other": values}, CLOCK)
    found: Array = effect(kind, **numbers).act(parts()).commanded(history).actuation["drive"]
    return found


def read(kind: str, values: Array, **numbers: float) -> Array:
    """Return the reading of a sensor."""
    readings = {"time_s": CLOCK, "angle_rad": values}
    return np.asarray(effect(kind, **numbers).act(parts()).reported(readings)["angle_rad"])


def test_gain_offset_and_saturation() -> None:
    assert acting("actuation_gain", WAVE, factor=1.3) == pytest.approx(1.3 * WAVE, abs=1e-15)
    assert acting("input_offset", WAVE, share=0.1) == pytest.approx(WAVE + 0.2, abs=1e-15)
    assert acting("saturation", WAVE, loss=0.5) == pytest.approx(np.clip(WAVE, -1.0, 1.0), abs=1e-15)


def test_bias_and_scale_of_a_sensor() -> None:
    assert read("sensor_bias", WAVE, share=0.1) == pytest.approx(WAVE + 0.2, abs=1e-15)
    assert read("sensor_scale", WAVE, factor=0.9) == pytest.approx(0.9 * WAVE, abs=1e-15)


def test_dead_zone() -> None:
    found = acting("dead_zone", WAVE, share=0.25)
    assert np.all(found[np.abs(WAVE) <= 0.5] == 0.0)
    beyond = np.abs(WAVE) > 0.5
    assert found[beyond] == pytest.approx((WAVE - 0.5 * np.sign(WAVE))[beyond], abs=1e-15)


def test_lag_of_an_input_has_the_response_of_first_order() -> None:
    """x = 2 (1 − exp(−(t − 1)/T)); the step is a ramp over one sample, whose centre is half a sample earlier."""
    found = acting("supply_lag", STEP, time_s=0.3)
    late = CLOCK - (1.0 - 0.005)
    exact = np.where(late > 0.005, 2.0 * (1.0 - np.exp(-late / 0.3)), 0.0)
    assert found == pytest.approx(exact, abs=2e-4)


def test_lag_falls_by_its_own_time() -> None:
    found = acting("supply_lag", 2.0 - STEP, time_s=0.3, release_ratio=2.0)
    late = CLOCK - (1.0 - 0.005)
    exact = np.where(late > 0.005, 2.0 * np.exp(-late / 0.6), 2.0)
    assert found == pytest.approx(exact, abs=2e-4)


def test_lag_of_a_sensor_is_late_by_its_time_on_a_ramp() -> None:
    found = read("sensor_lag", CLOCK, time_s=0.2)
    exact = CLOCK - 0.2 * (1.0 - np.exp(-CLOCK / 0.2))
    assert found == pytest.approx(exact, abs=1e-9)


def test_dead_time_and_delay() -> None:
    late = np.where(CLOCK >= 0.105, 1.5 * np.sin(2.0 * (CLOCK - 0.105)), 0.0)
    assert acting("dead_time", WAVE, delay_s=0.105) == pytest.approx(late, abs=1e-4)
    assert read("sensor_delay", WAVE, delay_s=0.105) == pytest.approx(late, abs=1e-4)
    early = read("sensor_delay", WAVE, delay_s=-0.1)
    assert early[:-10] == pytest.approx(WAVE[10:], abs=1e-12)
    assert np.all(early[-10:] == WAVE[-1])


def test_play_moves_after_twice_its_half_width() -> None:
    triangle = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.0, 101)[1:]])
    clock = 0.01 * np.arange(len(triangle))
    history = History.from_arrays({"drive": triangle, "other": triangle}, clock)
    found = effect("backlash", share=0.1).act(parts()).commanded(history).actuation["drive"]
    up, down = triangle[:101], triangle[101:]
    assert found[:101] == pytest.approx(np.maximum(up - 0.2, 0.0), abs=1e-12)
    assert found[101:] == pytest.approx(np.minimum(down + 0.2, 0.8), abs=1e-12)


def test_leak_fades_exponentially_and_passes_changes() -> None:
    found = acting("leak", STEP, rate_per_s=0.5)
    at = np.flatnonzero(CLOCK >= 1.0 - 1e-9)
    assert found[: at[0]] == pytest.approx(0.0, abs=1e-15)
    exact = 2.0 * np.exp(-0.5 * (CLOCK[at] - 0.995))
    assert found[at] == pytest.approx(exact, abs=1e-4)


def test_a_frame_turns_every_vector_and_keeps_its_length() -> None:
    names = ("tip_x_m", "tip_y_m", "tip_z_m", "angle_rad")
    values = np.random.default_rng(1).normal(size=(3, len(CLOCK)))
    readings: dict[str, Any] = dict(zip(names, values, strict=False)) | {"time_s": CLOCK, "angle_rad": WAVE}
    turned = (
        effect("misaligned_frame", about_z_rad=0.3, about_x_rad=0.1).act(parts(*names)).reported(readings)
    )
    found = np.stack([turned[name] for name in names[:3]])
    assert np.linalg.norm(found, axis=0) == pytest.approx(np.linalg.norm(values, axis=0), rel=1e-12)
    assert found == pytest.approx(exp_map(np.array([0.1, 0.0, 0.3])).T @ values, abs=1e-12)
    assert turned["angle_rad"] is WAVE


@pytest.mark.parametrize(
    "kind",
    [
        c.kind
        for c in REGISTRY.by_interface("effect")
        if c.kind not in ("parameter", "state", "misaligned_frame")
    ],
)
def test_a_pattern_chooses_channels(kind: str) -> None:
    history = History.from_arrays({"drive": STEP + WAVE, "other": STEP + WAVE}, CLOCK)
    component = REGISTRY.get("effect", kind)
    place = component.implementation_class().place
    chosen = "other" if place == "input" else "tip_x_m"
    values = {"kind": f"{kind}@{chosen[:2]}*", **component.smallest_block()}
    values["kind"] = f"{kind}@{chosen[:2]}*"
    one = component.build(component.config_model().model_validate(values)).act(parts("angle_rad", "tip_x_m"))
    if place == "input":
        seen = one.commanded(history).actuation
        same, moved = seen["drive"] - history.actuation["drive"], seen["other"] - history.actuation["other"]
    else:
        seen = one.reported({"time_s": CLOCK, "angle_rad": WAVE, "tip_x_m": WAVE})
        same, moved = seen["angle_rad"] - WAVE, seen["tip_x_m"] - WAVE
    assert not same.any()
    assert moved.any()


def test_a_name_that_the_model_lacks_is_refused() -> None:
    with pytest.raises(
        UserError, match=r"acts on no input: the model has drive, other; did you mean 'drive'"
    ):
        effect("dead_zone@driv", share=0.1).act(parts())
    with pytest.raises(UserError, match="no output is one of x, y and z"):
        effect("misaligned_frame").act(parts())


def test_gain_offset_and_scale_fade_with_the_level() -> None:
    left = 1.0 - 0.3 * np.abs(WAVE) / 2.0
    assert acting("actuation_gain", WAVE, factor=1.2, fading=0.3) == pytest.approx(WAVE * (1.0 + 0.2 * left))
    assert acting("input_offset", WAVE, share=0.1, fading=0.3) == pytest.approx(WAVE + 0.2 * left)
    assert read("sensor_scale", WAVE, factor=0.9, fading=0.3) == pytest.approx(WAVE * (1.0 - 0.1 * left))


def test_corners_may_be_round() -> None:
    sharp, rounded = (acting("dead_zone", WAVE, share=0.25, rounding=r) for r in (0.0, 0.4))
    assert np.all(rounded[WAVE == 0.0] == 0.0) and 0.01 < np.abs(rounded - sharp).max() < 0.14
    assert acting("dead_zone", WAVE, share=0.25, rounding=0.01) == pytest.approx(sharp, abs=4e-3)
    clipped, soft = (acting("saturation", WAVE, loss=0.5, rounding=r) for r in (0.0, 0.2))
    assert np.abs(soft).max() < 1.0 and soft[np.abs(WAVE) < 0.1] == pytest.approx(
        WAVE[np.abs(WAVE) < 0.1], abs=1e-2
    )
    assert acting("saturation", WAVE, loss=0.5, rounding=0.01) == pytest.approx(clipped, abs=8e-3)


def test_a_second_lag_is_one_behind_the_first() -> None:
    first = acting("supply_lag", STEP, time_s=0.3)
    both = acting("supply_lag", STEP, time_s=0.3, second_ratio=0.5)
    assert both == pytest.approx(acting("supply_lag", first, time_s=0.15), abs=1e-12)
    lag = read("sensor_lag", CLOCK, time_s=0.2, second_ratio=0.5)
    assert CLOCK[-1] - lag[-1] == pytest.approx(0.3, abs=1e-6)


def test_an_orifice_is_filled_along_a_parabola() -> None:
    """With n = 1/2 the root of the difference falls linearly: a step of û is reached after 2 T."""
    left = 1.0 - acting("supply_lag", STEP, time_s=0.5, power=0.5)[CLOCK >= 1.0] / 2.0
    exact = np.clip(1.0 - (CLOCK[CLOCK >= 1.0] - 0.99) / 1.0, 0.0, None) ** 2
    assert np.abs(left - exact).max() < 0.02


def test_plays_apart_are_the_mean_of_three() -> None:
    alone = [acting("backlash", WAVE, share=share) for share in (0.05, 0.1, 0.15)]
    assert acting("backlash", WAVE, share=0.1, spread=0.5) == pytest.approx(np.mean(alone, axis=0), abs=1e-12)


def test_leak_by_the_square_of_the_level_fades_hyperbolically() -> None:
    """x˙ = −r x² / û from û: x = û / (1 + r t)."""
    found = acting("leak", STEP, rate_per_s=0.5, power=2.0)
    at = CLOCK >= 1.01
    assert found[at] == pytest.approx(2.0 / (1.0 + 0.5 * (CLOCK[at] - 0.99)), rel=0.01)
