"""`inter_module_compliance`: springs between modules, in series with the neighbouring joints."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.effects.bench import NO_GRAVITY, chain_with, followed, settled

from pliant.config.chain import ActuatorConfig
from pliant.records.chain import ChainModel, Joint
from pliant.records.design import MassProperties
from pliant.records.history import History
from pliant.records.law import Domain, JointLaw
from pliant.testing.joint_laws import require_exact_slopes, require_potential
from pliant.testing.samples import (
    PRESSURE_PA,
    barred_law,
    coupled_law,
    linear_law,
    linear_spherical_law,
    sample_chain,
    softening_law,
)
from pliant_plugins.effects.scale import rest_stiffness
from pliant_plugins.effects.series_law import SeriesLaw

GAIN, K = 8e-7, 0.04
SHARE = 0.3


def connected(chain: ChainModel, share: float = SHARE) -> ChainModel:
    return chain_with(chain, "inter_module_compliance", share=share)


def angles(chain: ChainModel, pressure: float, moment: float = 0.0) -> Any:
    history = History.from_arrays({"pressure_pa": pressure}, moment_n_m=moment)
    return followed(chain, history)[0][0]


@pytest.mark.parametrize(("pressure", "moment"), [(9e3, 0.0), (0.0, 4e-3), (9e3, 4e-3), (5e3, -6e-3)])
def test_a_linear_chain_under_a_moment_has_its_closed_form(pressure: float, moment: float) -> None:
    """u_i = (g p − M) / k − n_i/2 κ M / k: free bending is unchanged, the end joints get half a connection."""
    chain = connected(sample_chain(linear_law(GAIN, K), modules=4, gravity=NO_GRAVITY))
    halves = np.array([0.5, 1.0, 1.0, 0.5])
    wanted = (GAIN * pressure - moment) / K - halves * SHARE * moment / K
    np.testing.assert_allclose(angles(chain, pressure, moment), wanted, rtol=1e-6, atol=1e-10)


def test_only_the_sum_over_many_modules_is_a_stiffness() -> None:
    """For two modules all joints are alike, with the stiffness factor 1/(1 + κ/2) at zero pressure."""
    chain = sample_chain(linear_law(GAIN, K), modules=2, gravity=NO_GRAVITY)
    softer = chain_with(chain, "stiffness", factor=1 / (1 + SHARE / 2))
    np.testing.assert_allclose(angles(connected(chain), 0.0, 4e-3), angles(softer, 0.0, 4e-3), rtol=1e-6)
    free = angles(connected(chain), 9e3), angles(softer, 9e3)
    assert np.all(free[1] > 1.1 * free[0])


def states(law: JointLaw) -> tuple[Any, Any]:
    random = np.random.default_rng(4)
    return PRESSURE_PA * random.random(60), random.uniform(-0.4, 0.6, (60, len(law.axes)))


LAWS = [linear_law(), softening_law(), linear_spherical_law(), coupled_law()]
ALL = pytest.mark.parametrize("law", LAWS, ids=["linear", "softening", "ball", "coupled ball"])


@ALL
def test_the_series_law_is_solved_to_rounding(law: JointLaw) -> None:
    """τ' = τ(p, q + C τ') at every state."""
    p, q = states(law)
    series = SeriesLaw(law, 6.0)
    tau = series.evaluate(p, q).tau
    np.testing.assert_allclose(law.evaluate(p, q + 6.0 * tau).tau, tau, rtol=1e-11, atol=1e-15)


@ALL
def test_slopes_are_derivatives_and_the_energy_belongs_to_both_springs(law: JointLaw) -> None:
    p, q = states(law)
    series = SeriesLaw(law, 6.0)
    require_exact_slopes(series, p, q, 1e-5)
    require_potential(series, p, q, 1e-5)
    np.testing.assert_allclose(series.potential(p, 0 * q), 0.0, atol=1e-18)
    by_work = JointLaw.potential(series, p, q)
    np.testing.assert_allclose(series.potential(p, q), by_work, rtol=1e-3, atol=1e-8)


def test_joints_with_one_kind_share_a_law_and_the_same_springs_are_the_same_objects() -> None:
    chain = sample_chain(modules=5)
    once, again = connected(chain), connected(chain)
    assert len(once.laws) == 2
    assert [joint.law for joint in once.joints] == [0, 1, 1, 1, 0]
    assert all(a is b for a, b in zip(once.laws, again.laws, strict=True))
    assert once.joints is again.joints
    assert connected(chain, 0.0) is chain
    assert len(connected(sample_chain(modules=2)).laws) == 1


def test_opposed_chambers_share_a_connection() -> None:
    """Two chambers on one elasticity behind one spring: k = k₁, so that a moment bends by (1 + κ n/2) M / k."""
    opposed = {
        "actuators": [ActuatorConfig(input="pressure_1_pa"), ActuatorConfig(input="pressure_2_pa", sign=-1)]
    }
    chain = sample_chain(linear_law(GAIN, K), modules=2, gravity=NO_GRAVITY, **opposed)
    assert rest_stiffness(chain) == pytest.approx(K)
    history = History.from_arrays({"pressure_1_pa": 9e3, "pressure_2_pa": 3e3}, moment_n_m=4e-3)
    ((found,),) = followed(connected(chain), history)
    wanted = GAIN * 6e3 / K - (1 + SHARE / 2) * 4e-3 / K
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


def test_error_bars_shrink_by_what_the_spring_takes() -> None:
    law = linear_law()
    barred = barred_law(law, Domain(np.array([0.0, PRESSURE_PA]), np.array([[-0.5, 0.7]])), 1e-4)
    p, q = states(law)
    series = SeriesLaw(barred, 6.0)
    inner = barred.band(p, q)
    assert inner is not None
    np.testing.assert_allclose(series.band(p, q), inner / (1 + 6.0 * K), rtol=0.2)
    assert SeriesLaw(law, 6.0).band(p, q) is None


def with_springs_as_joints(chain: ChainModel, compliance: float) -> ChainModel:
    """Return the same body with a separate joint for every spring, at the position of the joint that it belongs to."""
    n_axes, last = len(chain.axes), chain.n_joints - 1
    halves = [0.5 if i in (0, last) else 1.0 for i in range(chain.n_joints)]
    laws, joints, bodies = list(chain.laws), [], [chain.bodies[0]]
    for joint, body, share in zip(chain.joints, chain.bodies[1:], halves, strict=True):
        stiffness = np.eye(n_axes) / (share * compliance)
        own = replace(chain.laws[joint.law], gain=np.zeros(n_axes), stiffness=stiffness)  # type: ignore[type-var]
        joints += [replace(joint, law=len(laws)), Joint(joint.law, np.zeros(3), np.eye(3))]
        laws.append(own)
        bodies += [MassProperties.none(), body]
    return chain.with_(joints=tuple(joints), bodies=tuple(bodies), laws=tuple(laws))


@pytest.mark.parametrize(
    ("law", "tolerance_m"), [(linear_law(), 1e-8), (linear_spherical_law(), 2e-5)], ids=["hinge", "ball"]
)
def test_springs_as_separate_joints_give_the_same_pose(law: JointLaw, tolerance_m: float) -> None:
    """Under gravity, a lateral load and pressure; exact for hinges, for balls as far as rotation vectors add."""
    chain = sample_chain(law, modules=3, payload=0.01, base={"direction": [1.0, 0.0, 0.0]})
    tips = []
    for body in (connected(chain), with_springs_as_joints(chain, SHARE / rest_stiffness(chain)), chain):
        found = settled(body, tip_force_n=np.array([0.0, 0.1, 0.0]))
        assert found.converged
        tips.append(found.tip_m)
    assert float(np.abs(tips[0] - tips[1]).max()) < tolerance_m
    assert float(np.abs(tips[2] - tips[1]).max()) > 3e-4
