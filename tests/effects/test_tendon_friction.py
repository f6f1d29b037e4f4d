"""`tendon_friction`: the capstan along a chain of three, cases without a loop, and chains that are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.effects.bench import chain_with, followed

from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.testing.histories import HeldMotion, drive, triangles
from pliant.testing.samples import linear_law, sample_chain

K, ARM, F = 0.04, 6.6e-3, 3.0
MU, WRAP = 0.3, 0.15


def tendon_chain(modules: int = 3, **chain: object) -> ChainModel:
    law = replace(linear_law(ARM, K), actuation_name="tendon_force_n")
    return sample_chain(law, modules=modules, **{"gravity": (0, 0, 0), **chain})


def rubbing(chain: ChainModel, friction: float = MU, **more: float) -> ChainModel:
    return chain_with(chain, "tendon_friction", friction=friction, **{"wrap_at_rest_rad": WRAP, **more})


def pulled_and_released(chain: ChainModel) -> tuple[Array, Array]:
    """Return the tension (t,) and angles (t, n) of one slow pull and release."""
    time_s, force = triangles((F, 0.0), 0.1, 0.1)
    return force, followed(chain, History.from_arrays({"tendon_force_n": force}, time_s))[0]


def test_every_joint_meets_the_tension_that_the_capstan_leaves() -> None:
    """K u = r F e^(∓μ w), w = (i − ½) u + i w₀, on either branch once z has turned over."""
    force, angle = pulled_and_released(rubbing(tendon_chain()))
    top = int(np.argmax(force))
    for i in range(3):
        u = angle[:, i]
        tension = K * u / ARM
        wrap = (i + 0.5) * u + (i + 1) * WRAP
        pulling = slice(int(np.argmax(u > 0.011)), top + 1)
        turned = top + int(np.argmax(u[top:] < u[top] - 0.021))
        releasing = slice(turned, turned + int(np.argmax(u[turned:] < 0.02)))
        np.testing.assert_allclose(tension[pulling], (force * np.exp(-MU * wrap))[pulling], atol=1e-6)
        np.testing.assert_allclose(tension[releasing], (force * np.exp(MU * wrap))[releasing], atol=1e-6)
        middle = 0.5 * u[top]
        up = np.interp(middle, u[pulling], force[pulling])
        down = np.interp(middle, u[releasing][::-1], force[releasing][::-1])
        wanted = np.exp(2 * MU * ((i + 0.5) * middle + (i + 1) * WRAP))
        assert up / down == pytest.approx(wanted, rel=1e-4)


def test_joints_farther_from_the_base_bend_less_while_pulled_and_more_while_released() -> None:
    force, angle = pulled_and_released(rubbing(tendon_chain()))
    top = int(np.argmax(force))
    assert np.all(np.diff(angle[top]) < -0.01)
    assert np.all(np.diff(angle[top + (len(force) - top) // 2]) > 0.005)


def test_without_tension_there_is_no_loop_and_the_rate_does_not_matter() -> None:
    chain = rubbing(tendon_chain())
    time_s, moment = triangles((5e-3, -5e-3, 0.0), 1e-3, 0.1)
    (angles,) = followed(chain, History.from_arrays({"tendon_force_n": 0.0}, time_s, moment_n_m=moment))
    np.testing.assert_allclose(angles, np.tile(-moment[:, None] / K, 3), atol=1e-7)
    time_s, force = triangles((F, 1.0, 2.0, 0.0), 0.5, 0.1)
    runs = [History.from_arrays({"tendon_force_n": force}, clock) for clock in (time_s, 0.02 * time_s, None)]
    slow, fast, still = followed(chain, *runs)
    np.testing.assert_allclose(fast, slow, atol=1e-7)
    np.testing.assert_allclose(still, slow, atol=1e-7)


def test_a_tendon_that_pulls_the_other_way_is_the_mirror_image() -> None:
    mirrored = tendon_chain().with_(actuators=(Actuator("tendon_force_n", -1.0),))
    _, there = pulled_and_released(rubbing(tendon_chain()))
    _, here = pulled_and_released(rubbing(mirrored))
    np.testing.assert_allclose(here, -there, atol=1e-7)


def test_the_direction_turns_over_within_the_break_away_angle() -> None:
    chain = rubbing(tendon_chain(1), wrap_at_rest_rad=1.0, break_away_rad=0.02)
    angle = np.array([0.2, 0.21, 0.2, 0.19, 0.18, 0.16, 0.161])
    own = drive(chain, HeldMotion.from_angles(np.arange(7.0), angle, F)).effort + K * angle
    z = np.array([1.0, 1.0, 0.5, 0.0, -0.5, -1.0, -0.95])
    np.testing.assert_allclose(own, ARM * F * np.exp(-MU * z * (0.5 * angle + 1.0)), rtol=1e-12)
