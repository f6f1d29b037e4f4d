"""A joint that turns and extends: closed forms of springs in series and of a bent column, and limiting cases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import ContractError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import ChainGeometry, orientations, trajectory
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import Actuator, ChainModel
from pliant.records.law import EXTENSIBLE_AXES, Domain
from pliant.records.rollout import Inputs
from pliant.testing.samples import LinearLaw, sample_chain
from pliant_plugins.physics.quasistatic.newton import NewtonOptions, minimise

EXACT = NewtonOptions(1e-13, 200, 0.2)
GAIN = np.array([0.0, 8e-7, -3e-7, 3e-5])
STIFFNESS = np.diag([0.03, 0.04, 0.04, 900.0])


def column(modules: int, gain: np.ndarray = GAIN, **chain: object) -> ChainModel:
    """Return modules that bend, twist and extend, each independently."""
    law = LinearLaw(gain, STIFFNESS, Domain.unbounded(4), "extensible", EXTENSIBLE_AXES)
    return sample_chain(law, modules, **chain)


def settled(chain: ChainModel, inputs: Inputs) -> np.ndarray:
    q = np.zeros((chain.n_joints, 4))
    solution = minimise(ChainStatics(chain), Loads.from_inputs(chain, inputs), q, EXACT)
    assert solution.converged
    return solution.q


def test_springs_in_series_under_their_own_weight() -> None:
    """Joint i carries all masses beyond it: e_i = (a p + Σ m g + F)/k, and the tip sinks by their sum."""
    chain = column(5, np.array([0.0, 0.0, 0.0, 3e-5]), payload=0.05)
    q = settled(chain, Inputs({"pressure_pa": 1e4}, np.array([0.0, 0.0, -0.4])))
    masses = np.array([body.mass_kg for body in chain.bodies[1:]])
    carried = 9.81 * (np.cumsum(masses[::-1])[::-1] + 0.05) + 0.4
    wanted = (3e-5 * 1e4 + carried) / 900.0
    np.testing.assert_allclose(q[:, 3], wanted, rtol=1e-12)
    np.testing.assert_allclose(q[:, :3], 0.0, atol=1e-14)
    tip = ChainGeometry.from_chain(chain).markers(q)[-1]
    np.testing.assert_allclose(tip, [0.0, 0.0, -chain.length_m - wanted.sum()], atol=1e-14)


def test_a_bent_column_with_one_joint() -> None:
    """A force F across, in the plane of bending, on a link of l/2 beyond a joint of stiffness k and c along it.

    With the turn φ and the extension e:  k φ = F (l/2 + e) cos φ,  c e = F sin φ  (the link turns, then extends).
    """
    chain, force = column(1, gravity=(0, 0, 0)), 2.0
    q = settled(chain, Inputs({"pressure_pa": 0.0}, np.array([force, 0.0, 0.0])))
    turn, extension = q[0, 1], q[0, 3]
    assert turn > 0.2 and extension > 4e-4
    half = float(np.linalg.norm(chain.tip_offset_m))
    assert 0.04 * turn == pytest.approx(force * (half + extension) * np.cos(turn), rel=1e-11)
    assert 900.0 * extension == pytest.approx(force * np.sin(turn), rel=1e-11)
    tip = ChainGeometry.from_chain(chain).markers(q)[-1]
    reach = half + extension
    np.testing.assert_allclose(tip, [reach * np.sin(turn), 0.0, -half - reach * np.cos(turn)], atol=1e-14)


def test_a_column_that_shortens_buckles_later_than_its_rest_length_says() -> None:
    """Under a compression P the straight joint is unstable where P (l/2 + e) > k with e = −P/c < 0."""
    chain = column(1, gravity=(0, 0, 0))
    statics, half = ChainStatics(chain), float(np.linalg.norm(chain.tip_offset_m))
    # P (l/2 − P/c) = k
    push = 0.5 * 900.0 * (half - np.sqrt(half**2 - 4 * 0.04 / 900.0)) if half**2 > 4 * 0.04 / 900.0 else None
    assert push is None  # the link of this module is too short ever to buckle: it is shortened first
    long = chain.with_(tip_offset_m=10 * np.asarray(chain.tip_offset_m))
    half, statics = 10 * half, ChainStatics(long)
    push = 0.5 * 900.0 * (half - np.sqrt(half**2 - 4 * 0.04 / 900.0))
    assert push > 1.01 * 0.04 / half
    for share, stable in ((0.999, True), (1.001, False)):
        along = share * push
        q = np.array([[0.0, 0.0, 0.0, -along / 900.0]])
        loads = Loads.from_inputs(long, Inputs({"pressure_pa": 0.0}, np.array([0.0, 0.0, along])))
        balance = statics.balance(q, loads)
        np.testing.assert_allclose(balance.residual, 0.0, atol=1e-12)
        assert (np.linalg.eigvalsh(balance.stiffness)[0] > 0.0) == stable


def test_without_extension_it_is_a_ball_joint() -> None:
    chain = column(4, payload=0.02, base={"direction": [1, 0, 0.3]})
    law = LinearLaw(GAIN[:3], STIFFNESS[:3, :3], Domain.unbounded(3), "spherical", ("x", "y", "z"))
    ball = chain.with_(laws=(law,))
    q = 0.5 * np.random.default_rng(2).normal(size=(4, 3))
    inputs = Inputs({"pressure_pa": 1e4}, np.array([0.1, 0.2, -0.1]), 2e-3)
    long = np.column_stack([q, np.zeros(4)])
    stiff, soft = (
        ChainStatics(c).balance(u, Loads.from_inputs(c, inputs)) for c, u in ((ball, q), (chain, long))
    )
    np.testing.assert_allclose(soft.residual[:, :3], stiff.residual, atol=1e-15)
    own = soft.stiffness.reshape(4, 4, 4, 4)[:, :3, :, :3].reshape(12, 12)
    np.testing.assert_allclose(own, stiff.stiffness, atol=1e-15)


def test_histories_place_markers_and_bodies_as_the_pose_does(extensible_chain: ChainModel) -> None:
    geometry = ChainGeometry.from_chain(extensible_chain)
    q = np.random.default_rng(4).normal(size=(3, geometry.n_joints, 4)) * [0.5, 0.5, 0.5, 0.01]
    bases = np.repeat(geometry.base_rotation[None], 3, axis=0)
    np.testing.assert_allclose(trajectory(geometry, q, bases), [geometry.markers(at) for at in q], atol=1e-14)
    turned = [geometry.forward(at).rotations for at in q]
    np.testing.assert_allclose(orientations(geometry, q, bases), turned, atol=1e-14)


def test_a_turned_actuator_lengthens_as_one_that_is_not() -> None:
    """Two opposed chambers bend against each other and both lengthen the joint."""
    pair = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0, 0.4))
    chain = column(2).with_(actuators=pair)
    effort = JointEfforts(chain).evaluate(np.zeros((2, 4)), {"pressure_1_pa": 1e4, "pressure_2_pa": 1e4})
    np.testing.assert_allclose(effort.tau[:, 3], 2 * GAIN[3] * 1e4)
    bend = GAIN[1:3] * 1e4
    c, s = np.cos(0.4), np.sin(0.4)
    np.testing.assert_allclose(effort.tau[:, 1:3], [bend - [[c, -s], [s, c]] @ bend] * 2, atol=1e-12)


def test_extensible_joint_axes_come_in_one_order(extensible_chain: ChainModel) -> None:
    law = column(1).laws[0]
    other = replace(law, axes=("e", "x", "y", "z"))  # type: ignore[type-var]
    with pytest.raises(ContractError, match="x, y, z, e in this order"):
        ChainStatics(column(1).with_(laws=(other,)))
