"""`sensor_scale`: every angle times one factor, about zero, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from tests.effects.bench import effect, model_with

from pliant.interfaces.effect import Model
from pliant.testing.samples import sample_chain

SCALED = model_with(sample_chain(modules=3), "sensor_scale", excess=0.06)


def test_every_angle_is_scaled_once_and_nothing_else_is() -> None:
    readings = {
        "time_s": np.array([0.0, 1.0]),
        "angle_rad": np.array([0.0, -0.4]),
        "joint_2_angle_rad": -0.1,
        "bend_angle_rad": 0.4,
        "joint_angles_rad": [[0.1], [0.2]],
        "max_joint_angle_rad": 0.2,
        "elongation_strain": 0.1,
        "tip_x_m": np.array([0.05, 0.06]),
    }
    after = SCALED.reported(readings)
    np.testing.assert_allclose(after["angle_rad"], [0.0, -0.424], rtol=1e-15)
    assert after["joint_2_angle_rad"] == pytest.approx(-0.106)
    assert after["bend_angle_rad"] == pytest.approx(0.424)
    np.testing.assert_allclose(after["joint_angles_rad"], [[0.106], [0.212]])
    for name in ("time_s", "max_joint_angle_rad", "elongation_strain", "tip_x_m"):
        assert after[name] is readings[name]


def test_the_sum_of_scaled_joints_is_the_scaled_sum() -> None:
    joints = {"joint_1_angle_rad": 0.2, "joint_2_angle_rad": 0.15, "joint_3_angle_rad": -0.05}
    after = SCALED.reported({**joints, "angle_rad": sum(joints.values())})
    assert after["angle_rad"] == pytest.approx(sum(after[name] for name in joints), rel=1e-14)


def test_scale_and_bias_act_in_the_order_of_the_study() -> None:
    bias, scale = effect("sensor_bias", bias_rad=0.1), effect("sensor_scale", excess=0.5)
    plain = Model(sample_chain(modules=1))
    assert scale.apply(bias.apply(plain)).reported({"angle_rad": 0.2})["angle_rad"] == pytest.approx(0.45)
    assert bias.apply(scale.apply(plain)).reported({"angle_rad": 0.2})["angle_rad"] == pytest.approx(0.4)
