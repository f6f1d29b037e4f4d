"""Residual, stiffness and potential: one is the derivative of the other, for every kind of joint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import ContractError, UserError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.rotations import exp_map
from pliant.mechanics.statics import ChainStatics, Loads, unstable_mode
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.law import Domain, JointKind
from pliant.records.rollout import Cord, Inputs, PointForce

IDLE, ZERO = {"pressure_pa": 0.0}, np.zeros(3)


def state(chain: ChainModel, seed: int = 1) -> tuple[ChainStatics, Array, Loads]:
    random = np.random.default_rng(seed)
    turn = 0.01 if chain.laws[0].joint == "prismatic" else 0.8
    q = turn * random.normal(size=(chain.n_joints, len(chain.axes)))
    if chain.laws[0].joint == "extensible":
        q[:, 3] *= 0.05
    moment = 0.0 if chain.laws[0].joint == "prismatic" else 3e-3
    forces = tuple(
        PointForce(body, 0.01 * random.normal(size=3), 0.1 * random.normal(size=3))
        for body in (0, 2, chain.n_joints)
    )
    cords = tuple(Cord(body, 0.01 * random.normal(size=3), random.normal(size=3), 0.3) for body in (1, 4))
    inputs = Inputs(
        {a.input: 1e4 for a in chain.actuators}, 0.1 * random.normal(size=3), moment, forces, cords
    )
    return ChainStatics(chain), q, Loads.from_inputs(chain, inputs)


def slope(function: Callable[[Array], Array | float], q: Array, step: float = 1e-6) -> Array:
    """Return (…, n·a) central differences by each coordinate."""
    nudges = [step * unit.reshape(q.shape) for unit in np.eye(q.size)]
    return np.stack(
        [np.ravel(np.subtract(function(q + d), function(q - d))) / (2 * step) for d in nudges], -1
    )


def test_residual_and_stiffness_are_slopes_from_the_potential_and_the_residual(chain: ChainModel) -> None:
    statics, q, loads = state(chain)
    balance, residual = statics.balance(q, loads), statics.residual(q, loads)
    by_q = slope(lambda at: statics.potential(at, loads), q)
    np.testing.assert_allclose(residual.ravel(), -by_q[0], atol=2e-9)
    by_q = slope(lambda at: statics.residual(at, loads), q)
    np.testing.assert_allclose(balance.stiffness, -by_q, atol=1e-8)
    np.testing.assert_allclose(balance.stiffness, balance.stiffness.T, atol=1e-16)
    np.testing.assert_array_equal(balance.residual, residual)


def test_closed_path_does_no_work(spherical_chain: ChainModel) -> None:
    """∮ r·dq = 0 around a random polygon: neither the laws nor the loads add energy."""
    statics, _, loads = state(spherical_chain)
    random = np.random.default_rng(3)
    corners = 0.7 * random.normal(size=(4, spherical_chain.n_joints, 3))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    work, scale = 0.0, 0.0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        for node, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
            power = np.sum(statics.residual(start + node * (end - start), loads) * (end - start))
            work, scale = work + weight * power, scale + weight * abs(power)
    assert abs(work) < 1e-10 * scale


def test_rotating_base_gravity_and_force_together_rotates_everything(chain: ChainModel) -> None:
    statics, q, loads = state(chain)
    turn = exp_map(np.array([0.4, -1.1, 0.7]))
    turned = chain.with_(
        base_rotation=turn @ chain.base_rotation,
        base_position_m=turn @ chain.base_position_m,
        gravity_m_s2=turn @ chain.gravity_m_s2,
    )
    other = ChainStatics(turned)
    there = Loads(
        loads.actuation,
        turn @ loads.gravity_m_s2,
        turn @ loads.tip_force_n,
        loads.moment_n_m,
        forces=tuple(replace(f, force_n=turn @ f.force_n) for f in loads.forces),
        cords=tuple(replace(c, pulley_m=turn @ c.pulley_m) for c in loads.cords),
    )
    np.testing.assert_allclose(other.residual(q, there), statics.residual(q, loads), atol=1e-15)
    np.testing.assert_allclose(other.geometry.markers(q), statics.geometry.markers(q) @ turn.T, atol=1e-15)


def test_axis_order_is_only_a_name(spherical_chain: ChainModel) -> None:
    """A law that lists its axes as z, x, y gives the same residual, permuted."""
    statics, q, loads = state(spherical_chain)
    order = [2, 0, 1]

    class Permuted(type(spherical_chain.laws[0])):  # type: ignore[misc]
        def evaluate(self, actuation: Array, deformation: Array) -> object:
            effort = super().evaluate(actuation, deformation[:, np.argsort(order)])
            return type(effort)(
                effort.tau[:, order], effort.dtau_dp[:, order], effort.dtau_du[:, order][:, :, order]
            )

    law = Permuted("spherical")
    law.axes = ("z", "x", "y")
    other = ChainStatics(spherical_chain.with_(laws=(law, law)))
    np.testing.assert_allclose(
        other.residual(q[:, order], loads), statics.residual(q, loads)[:, order], atol=1e-16
    )


def test_opposed_actuators_cancel_at_rest(chain: ChainModel) -> None:
    opposed = chain.with_(actuators=(Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0)))
    efforts = ChainStatics(opposed).efforts
    rest, way = np.zeros((chain.n_joints, len(chain.axes))), np.ones(len(chain.axes))
    way[ChainStatics(chain).geometry.slide or len(way) :] = -1.0  # an extension is the same from both sides
    both = efforts.evaluate(rest, {"pressure_1_pa": 1e4, "pressure_2_pa": 1e4})
    np.testing.assert_allclose(both.tau[:, way > 0], 0.0, atol=1e-18)
    np.testing.assert_array_equal(both.dtau_dp["pressure_1_pa"], -way * both.dtau_dp["pressure_2_pa"])
    swapped = efforts.evaluate(rest + 0.1 * way, {"pressure_1_pa": 2e3, "pressure_2_pa": 7e3})
    mirrored = efforts.evaluate(rest - 0.1, {"pressure_1_pa": 7e3, "pressure_2_pa": 2e3})
    np.testing.assert_allclose(swapped.tau, -way * mirrored.tau, atol=1e-17)


def test_permuting_equal_laws_changes_nothing(chain: ChainModel) -> None:
    statics, q, loads = state(chain)
    joints = tuple(type(j)(1 - j.law, j.offset_m, j.rest_rotation) for j in chain.joints)
    swapped = ChainStatics(chain.with_(joints=joints, laws=chain.laws[::-1]))
    np.testing.assert_array_equal(swapped.residual(q, loads), statics.residual(q, loads))


def test_mass_matrix_gives_the_kinetic_energy(chain: ChainModel) -> None:
    statics, q, _ = state(chain)
    rates = np.random.default_rng(5).normal(size=q.shape)
    step = 1e-6
    before, after = (statics.geometry.forward(q + s * rates) for s in (-step, step))
    energy = 0.0
    middle = statics.geometry.forward(q)
    for i, body in enumerate(chain.bodies):
        spin = (after.rotations[i] - before.rotations[i]) @ middle.rotations[i].T / (2 * step)
        omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        positions = [p.origins[i] + p.rotations[i] @ body.com_m for p in (before, after)]
        velocity = (positions[1] - positions[0]) / (2 * step)
        inertia = middle.rotations[i] @ body.inertia_kg_m2 @ middle.rotations[i].T
        energy += 0.5 * body.mass_kg * velocity @ velocity + 0.5 * omega @ inertia @ omega
    tips = [statics.geometry.markers(q + s * rates)[-1] for s in (-step, step)]
    energy += 0.5 * chain.payload_kg * np.sum(((tips[1] - tips[0]) / (2 * step)) ** 2)
    matrix = mass_matrix(chain, q)
    np.testing.assert_allclose(0.5 * rates.ravel() @ matrix @ rates.ravel(), energy, rtol=1e-7)
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-12, atol=1e-20)


def opposed_in_a_box(chain: ChainModel, most_pa: float, least: float, most: float) -> ChainModel:
    one = chain.laws[0]
    box = Domain(np.array([0.0, most_pa]), np.tile([least, most], (len(chain.axes), 1)))
    law = type(one)(one.joint, box)  # type: ignore[call-arg]
    actuators = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0))
    return chain.with_(laws=(law, law), actuators=actuators)


def test_leaving_the_domain_is_reported_in_joint_coordinates(chain: ChainModel) -> None:
    efforts = JointEfforts(opposed_in_a_box(chain, 8e3, -0.5, 0.3))
    q = np.zeros((chain.n_joints, len(chain.axes)))
    q[2, 0] = 0.4
    found = efforts.outside_domain(q, {"pressure_1_pa": 9e3, "pressure_2_pa": 0.0}, 1.5)
    pressures = [entry for entry in found if entry.variable == "pressure_1_pa"]
    assert [entry.module for entry in pressures] == [1, 2, 3, 4, 5]
    assert all(entry.excess == pytest.approx(1e3) and entry.time_s == 1.5 for entry in pressures)
    (bent,) = [entry for entry in found if entry.variable != "pressure_1_pa"]
    assert (bent.module, bent.excess) == (3, pytest.approx(0.1))


def test_opposed_actuators_outside_their_boxes_are_told_once(chain: ChainModel) -> None:
    """At +0.5 the first chamber is 0.1 above its box and the second, with −0.5, is 0.3 below."""
    q = np.zeros((chain.n_joints, len(chain.axes)))
    q[1, 0], q[2, 0] = 0.5, -0.5
    efforts = JointEfforts(opposed_in_a_box(chain, 1e4, -0.2, 0.4))
    found = efforts.outside_domain(q, {"pressure_1_pa": 5e3, "pressure_2_pa": 5e3})
    assert [entry.module for entry in found] == [2, 3]
    assert [entry.excess for entry in found] == pytest.approx([0.3, -0.3])


def test_unstable_mode_in_an_upright_pendulum() -> None:
    assert unstable_mode(np.diag([1.0, 2.0])) is None
    assert unstable_mode(np.diag([0.0, 2.0])) is None
    mode = unstable_mode(np.diag([-1.0, 2.0]))
    assert mode is not None
    np.testing.assert_allclose(np.abs(mode), [1.0, 0.0])


def test_inputs_that_the_chain_cannot_use(spherical_chain: ChainModel, chain: ChainModel) -> None:
    statics, q, _ = state(spherical_chain)
    with pytest.raises(UserError, match="pressure_pa, which has no value"):
        statics.efforts.evaluate(q, {"pressure_1_pa": 1.0})
    with pytest.raises(ContractError, match="6 bodies"):
        ChainStatics(chain.with_(bodies=chain.bodies[1:]))
    if chain.laws[0].joint == "prismatic":
        with pytest.raises(UserError, match="no end moment"):
            Loads.from_inputs(chain, Inputs(IDLE, moment_n_m=1.0))


@pytest.mark.parametrize(
    ("inputs", "says"),
    [
        (Inputs({"pressure_pa": float("nan")}), "pressure_pa is nan"),
        (Inputs(IDLE, tip_force_n=np.array([0.0, np.inf, 0.0])), "tip_force_n is"),
        (Inputs(IDLE, moment_n_m=float("-inf")), "moment_n_m is -inf"),
        (Inputs(IDLE, forces=(PointForce(6, ZERO, ZERO),)), "body 6; the chain has bodies 0 to 5"),
        (Inputs(IDLE, cords=(Cord(1, ZERO, np.ones(3), np.nan),)), "tension_n of load 1 is nan"),
    ],
)
def test_inputs_are_finite_and_act_on_bodies(spherical_chain: ChainModel, inputs: Inputs, says: str) -> None:
    with pytest.raises(UserError, match=says):
        Loads.from_inputs(spherical_chain, inputs)


def test_laws_in_a_chain_must_agree(chain: ChainModel) -> None:
    first = chain.laws[0]
    kind: JointKind = "prismatic" if first.joint != "prismatic" else "revolute"
    with pytest.raises(ContractError, match="share the joint kind"):
        ChainStatics(chain.with_(laws=(first, type(first)(kind))))
    odd = type(first)(first.joint)
    odd.axes = ("x", "w")
    with pytest.raises(ContractError, match="of the axes x, y, z"):
        ChainStatics(chain.with_(laws=(odd, odd)))
    stray = type(chain.joints[0])(7, chain.joints[0].offset_m, chain.joints[0].rest_rotation)
    with pytest.raises(ContractError, match="does not have"):
        ChainStatics(chain.with_(joints=(stray, *chain.joints[1:])))


def test_a_force_at_the_tip_is_the_tip_force(chain: ChainModel) -> None:
    statics, q, _ = state(chain)
    force = np.array([0.1, -0.2, 0.3])
    at_tip = PointForce(chain.n_joints, chain.tip_offset_m, force)
    one = statics.residual(q, Loads.from_inputs(chain, Inputs(IDLE, force)))
    other = statics.residual(q, Loads.from_inputs(chain, Inputs(IDLE, forces=(at_tip,))))
    np.testing.assert_allclose(other, one, atol=1e-15)


def test_a_far_pulley_pulls_like_a_dead_force(spherical_chain: ChainModel) -> None:
    statics, q, _ = state(spherical_chain)
    away = np.array([0.0, 0.6, 0.8])
    cord, dead = Cord(3, ZERO, 1e6 * away, 0.5), PointForce(3, ZERO, 0.5 * away)
    pulled = statics.balance(q, Loads.from_inputs(spherical_chain, Inputs(IDLE, cords=(cord,))))
    pushed = statics.balance(q, Loads.from_inputs(spherical_chain, Inputs(IDLE, forces=(dead,))))
    np.testing.assert_allclose(pulled.residual, pushed.residual, atol=1e-8)
    np.testing.assert_allclose(pulled.stiffness, pushed.stiffness, atol=1e-8)


def test_point_jacobian_is_the_point_slope(chain: ChainModel) -> None:
    statics, q, _ = state(chain)

    def point(at: Array) -> Array:
        pose = statics.geometry.forward(at)
        return np.asarray(pose.origins[3] + pose.rotations[3] @ [0.01, -0.02, 0.005])

    jacobian = statics.point_jacobian(statics.geometry.forward(q), 3, point(q)).reshape(3, -1)
    np.testing.assert_allclose(jacobian, slope(point, q), atol=1e-9)


def test_loads_that_stay_are_not_faded_by_a_continuation(spherical_chain: ChainModel) -> None:
    stays, comes = PointForce(1, ZERO, np.ones(3)), PointForce(2, ZERO, np.ones(3))
    before = Loads.from_inputs(spherical_chain, Inputs(IDLE, forces=(stays,)))
    after = Loads.from_inputs(spherical_chain, Inputs(IDLE, forces=(stays, comes)))
    between = before.between(after, 0.25)
    assert [f.body for f in between.forces] == [1, 2]
    np.testing.assert_allclose([f.force_n[0] for f in between.forces], [1.0, 0.25])


def test_turned_actuators_derive_from_a_potential(spherical_chain: ChainModel) -> None:
    pair = (Actuator("pressure_1_pa", 1.0, 0.9), Actuator("pressure_2_pa", -1.0, -2.1))
    statics, q, loads = state(spherical_chain.with_(actuators=pair))
    balance = statics.balance(q, loads)
    np.testing.assert_allclose(
        balance.residual.ravel(), -slope(lambda q: statics.potential(q, loads), q)[0], rtol=1e-6, atol=1e-10
    )
    own = slope(lambda q: statics.residual(q, loads), q)
    np.testing.assert_allclose(balance.stiffness, -own, rtol=1e-5, atol=1e-8)
