"""Weights: scaled, and beside the axis."""

from __future__ import annotations

import numpy as np
import pytest
from tests.effects.bench import chain_with, followed

from pliant.records.history import History
from pliant.testing.samples import sample_chain

ASIDE = 0.02


def angles(pitch_rad: float, **values: float) -> np.ndarray:
    chain = chain_with(sample_chain(modules=1), "gravity_scale", **values)
    history = History.of({"pressure_pa": 0.0}, base_angles_rad=[[0.0, pitch_rad, 0.0]])
    return followed(chain, history)[0][:, 0]


def moment(u: float) -> float:
    """What the joint's law carries at an angle."""
    law = sample_chain(modules=1).laws[0]
    return float(law.evaluate(np.zeros(1), np.array([[u]])).tau[0, 0])


def test_a_weight_beside_the_axis_turns_a_hanging_joint_by_its_moment() -> None:
    chain = sample_chain(modules=1)
    body = chain.bodies[1]
    u = float(angles(0.0, aside=ASIDE)[0])
    weight, side, arm = body.mass_kg * 9.81, ASIDE * chain.length_m, float(body.com_m[0])
    # hanging straight down the piece swings until its law carries side and arm
    carried = weight * abs(side * np.cos(u) - arm * abs(np.sin(u)))
    assert abs(moment(u)) == pytest.approx(carried, abs=2e-9)  # the solver's tolerance is 1e-9 N·m
    assert float(angles(0.0)[0]) == pytest.approx(0.0, abs=1e-9)
    assert float(angles(0.0, aside=-ASIDE)[0]) == pytest.approx(-u, abs=1e-9)


def test_held_level_a_weight_beside_the_axis_hardly_matters_and_the_factor_does() -> None:
    level = np.pi / 2
    plain, scaled = float(angles(level)[0]), float(angles(level, factor=2.0)[0])
    beside = float(angles(level, aside=ASIDE)[0])
    assert abs(scaled) > 1.8 * abs(plain) > 0
    assert abs(beside - plain) < 0.2 * abs(float(angles(0.0, aside=ASIDE)[0]))
