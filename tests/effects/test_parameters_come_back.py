"""Effects on sensors, frames and connections in a chain of three joints: fits recover their parameters."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import (
    MORE_VALUES,
    REGISTRY,
    P,
    effect,
    make_fitter,
    make_history,
    make_predictor,
    measured,
    pushes,
    ramp,
)

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.effect_fit import EffectFit
from pliant.records.history import History
from pliant.testing.samples import sample_chain

CHAIN = sample_chain(modules=3, payload=0.01)
SIGMA = 5e-4  # rad and m
ANGLES = ("angle_rad", "joint_1_angle_rad", "joint_2_angle_rad", "joint_3_angle_rad")
TIP = ("tip_x_m", "tip_y_m", "tip_z_m")
KINDS = (
    "sensor_scale",
    "sensor_lag",
    "backlash",
    "base_misalignment",
    "inter_module_compliance",
    "cross_axis",
)


def runs() -> list[History]:
    """Return slow and fast loops, loads of both signs, and runs with the base level and on its side."""
    cycle = (P, 0.4 * P, 0.8 * P, 0.0)
    return [
        ramp("slow", 500.0, 1.0, cycle),
        ramp("fast", 15e3, 0.1, cycle),
        pushes("vented", 0.0, 3e-3),
        pushes("pressed", 0.6 * P, 3e-3),
        ramp("level", 3e3, 0.5, base_angles_rad=[0.0, np.pi / 2, 0.0]),
        ramp("sideways", 3e3, 0.5, base_angles_rad=[np.pi / 2, 0.0, 0.0]),
        make_history("table", None, np.linspace(0.0, P, 11)),
    ]


def fitted(kind: str, outputs: tuple[str, ...], seed: int = 3) -> EffectFit:
    measurement = measured(CHAIN, runs(), effect(kind), sigma=SIGMA, phi=0.0, seed=seed, outputs=outputs)
    return make_fitter(make_predictor(CHAIN, measurement), SIGMA).fit(EffectSet.from_kinds(REGISTRY, (kind,)))


@pytest.mark.parametrize("kind", KINDS)
def test_with_angles_and_the_tip(kind: str) -> None:
    fit = fitted(kind, (*ANGLES, *TIP))
    spread = np.sqrt(np.diag(np.linalg.inv(fit.slopes.T @ fit.slopes)) * fit.mean_square())
    truth = np.array(
        [parameter.x(MORE_VALUES[kind][parameter.declared.name]) for parameter in fit.candidate.parameters]
    )
    assert np.all(np.abs(fit.x - truth) < 4.0 * spread), (fit.values, MORE_VALUES[kind])
    assert np.all(spread < 0.1)
    assert fit.mean_square() == pytest.approx(1.0, abs=0.12)
    assert fit.converged


@pytest.mark.parametrize(
    "kind", ["sensor_scale", "sensor_lag", "backlash", "inter_module_compliance", "cross_axis"]
)
def test_by_the_angle_sum_alone(kind: str) -> None:
    """Angles show a turned axis because the base was also turned on its side."""
    fit = fitted(kind, ("angle_rad",))
    for name, value in MORE_VALUES[kind].items():
        assert fit.values[f"{kind}.{name}"] == pytest.approx(value, rel=0.1)


def test_a_tilt_outside_the_plane_needs_positions() -> None:
    """Angles alone determine the pitch; the roll enters at second order only, through the product of both."""
    fit = fitted("base_misalignment", ("angle_rad",))
    assert fit.values["base_misalignment.pitch_rad"] == pytest.approx(0.04, rel=0.05)
    seen = np.linalg.norm(fit.slopes, axis=0)
    pitch, roll = (
        [k.declared.name for k in fit.candidate.parameters].index(n) for n in ("pitch_rad", "roll_rad")
    )
    assert seen[roll] < 0.15 * seen[pitch]
