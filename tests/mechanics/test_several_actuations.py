"""Several actuations on one joint: laws that take them at once, elasticity counted once, inputs of segments."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.config.chain import ActuatorConfig, ChainConfig
from pliant.errors import UserError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.shared_actuation import SharedActuation
from pliant.mechanics.shared_elasticity import SharedElasticity
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.actuation import ActuationKind, actuation_kind, expected, register, split_actuation_names
from pliant.records.chain import Actuator
from pliant.records.law import Domain
from pliant.testing.samples import linear_law
from pliant_plugins.surrogates.polynomial.several_fit import weighted_degree_exponents
from pliant_plugins.surrogates.polynomial.several_law import SeveralLaw

K = 0.04
PAIR = (ActuatorConfig(input="pressure_1_pa"), ActuatorConfig(input="pressure_2_pa", sign=-1))


def several_law(m: int = 2, axes: tuple[str, ...] = ("y",), seed: int = 0) -> SeveralLaw:
    """Return a stable law: a random energy of degree 3 plus a strong quadratic one in u."""
    k, random = len(axes), np.random.default_rng(seed)
    joint = "revolute" if k == 1 else "extensible" if "e" in axes else "spherical"
    exponents = weighted_degree_exponents(3, 3, m, k)
    coefficients = 1e-5 * random.standard_normal(len(exponents))
    stiff = (exponents[:, m:].sum(axis=1) == 2) & (exponents[:, m:].max(axis=1) == 2)
    coefficients[stiff & (exponents[:, :m].sum(axis=1) == 0)] = 2e-3
    half = [1e-3 if axis == "e" else 0.3 for axis in axes]
    maps = np.array([[1e4, 1e4]] * m + [[0.0, width] for width in half])
    box = np.column_stack([maps[:, 0] - maps[:, 1], maps[:, 0] + maps[:, 1]])
    name = ", ".join(f"pressure_{j}_pa" for j in range(1, m + 1))
    return SeveralLaw(exponents, coefficients, maps, Domain(box[:m], box[m:]), name, axes, joint)


def make_chain(law, modules: int = 3, segments: int = 1, own=((),), **config):
    pieces = [Segment(rod_module(law, 0.02, 0.002), modules, actuators=own[s]) for s in range(segments)]
    return build_chain(ChainConfig(modules=modules, **config), pieces)


def test_a_second_chamber_brings_its_push_and_no_stiffness() -> None:
    """Σ_k T_k [τ(p_k, T_kᵀu) − (1 − 1/K) τ(0, T_kᵀu)] = g (p₁ − p₂) − k u of a linear law."""
    law = linear_law(2e-6, K)
    chain = make_chain(law, actuators=PAIR)
    q = np.array([[0.1], [-0.05], [0.2]])
    found = JointEfforts(chain).evaluate(q, {"pressure_1_pa": 9e3, "pressure_2_pa": 4e3})
    np.testing.assert_allclose(found.tau, 2e-6 * 5e3 - K * q, rtol=1e-13)
    np.testing.assert_allclose(found.dtau_du, -K, rtol=1e-13)
    assert isinstance(chain.laws[0], SharedElasticity)
    assert make_chain(law).laws[0] is law


def test_equal_chambers_on_every_side_keep_the_law_without_any() -> None:
    law = several_law(1)
    none = JointEfforts(make_chain(law)).evaluate(np.full((3, 1), 0.1), {"pressure_1_pa": 0.0})
    four = [ActuatorConfig(input=f"pressure_{k}_pa") for k in range(1, 5)]
    idle = JointEfforts(make_chain(law, actuators=four)).evaluate(
        np.full((3, 1), 0.1), {f"pressure_{k}_pa": 0.0 for k in range(1, 5)}
    )
    np.testing.assert_allclose(idle.tau, none.tau, rtol=1e-12)
    np.testing.assert_allclose(idle.dtau_du, none.dtau_du, rtol=1e-12)


@pytest.mark.parametrize(("m", "axes"), [(2, ("y",)), (3, ("x", "y", "z"))])
def test_slopes_and_travel_match_the_energy(m: int, axes: tuple[str, ...]) -> None:
    """Inside the box and outside: differences of Π, τ; ∂Π/∂a is minus the travel."""
    law, random = several_law(m, axes), np.random.default_rng(1)
    box = law.domain.box
    at = box[:, 0] + np.ptp(box, axis=1) * random.uniform(-0.4, 1.4, (20, len(box)))
    a, u = at[:, :m], at[:, m:]
    effort = law.evaluate(a, u)
    rest = np.zeros_like(u)
    for i in range(len(axes)):
        step = np.zeros(len(axes))
        step[i] = 1e-5
        slope = (law.potential(a, u + step) - law.potential(a, u - step)) / 2e-5
        np.testing.assert_allclose(-effort.tau[:, i], slope, rtol=1e-5, atol=1e-8)
        by_u = (law.evaluate(a, u + step).tau - law.evaluate(a, u - step).tau) / 2e-5
        np.testing.assert_allclose(effort.dtau_du[:, :, i], by_u, rtol=1e-4, atol=1e-6)
    for j in range(m):
        step = np.zeros(m)
        step[j] = 1.0
        by_a = (law.evaluate(a + step, u).tau - law.evaluate(a - step, u).tau) / 2
        np.testing.assert_allclose(effort.dtau_dp[:, :, j], by_a, rtol=1e-4, atol=1e-12)
        work = (law.potential(a + step, u) - law.potential(a - step, u)) / 2
        np.testing.assert_allclose((law.travel(a, rest) - law.travel(a, u))[:, j], work, atol=1e-13)


def test_a_record_makes_the_same_law() -> None:
    law = several_law(3, ("x", "y", "z"))
    again = SeveralLaw.from_record(law.record())
    a, u = np.full((4, 3), 3e3), np.linspace(-0.4, 0.4, 12).reshape(4, 3)
    np.testing.assert_array_equal(again.evaluate(a, u).tau, law.evaluate(a, u).tau)
    assert again.actuations == ("pressure_1_pa", "pressure_2_pa", "pressure_3_pa")


def test_each_segment_has_its_own_inputs() -> None:
    law = several_law(2)
    first = (Actuator("pressure_1_pa"), Actuator("pressure_2_pa"))
    second = (Actuator("pressure_3_pa"), Actuator("pressure_4_pa"))
    chain = make_chain(law, 2, 2, (first, second))
    levels = {f"pressure_{k}_pa": 3e3 * k for k in range(1, 5)}
    q = np.full((4, 1), 0.05)
    found = JointEfforts(chain).evaluate(q, levels)
    wanted = law.evaluate(np.array([[3e3, 6e3]] * 2 + [[9e3, 12e3]] * 2), q)
    np.testing.assert_allclose(found.tau, wanted.tau, rtol=1e-13)
    np.testing.assert_array_equal(found.dtau_dp["pressure_3_pa"][:2], 0.0)
    np.testing.assert_allclose(found.dtau_dp["pressure_3_pa"][2:], wanted.dtau_dp[2:, :, 0], rtol=1e-13)
    assert list(chain.parts) == [1, 1, 1, 1]


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        (("pressure_1_pa", "pressure_2_pa", "pressure_3_pa"), "more than the module has"),
        (("pressure_1_pa",), "fewer than the module has"),
        (("pressure_1_pa", "tendon_force_n"), "gives 'tendon_force_n' to pressure_2_pa"),
    ],
)
def test_a_law_takes_as_many_inputs_as_it_has(inputs: tuple[str, ...], words: str) -> None:
    with pytest.raises(UserError, match=words):
        make_chain(several_law(2), actuators=[ActuatorConfig(input=name) for name in inputs])


def test_the_actuation_registry_is_open() -> None:
    kind = ActuationKind("coil_current", "_a", "A", "flux_linkage_wb")
    with pytest.raises(UserError, match="no actuation"):
        actuation_kind("coil_current_2_a")
    try:
        register(kind)
        assert actuation_kind("coil_current_2_a") == kind
        assert kind.travel_name("coil_current_2_a") == "flux_linkage_2_wb"
        assert ActuatorConfig(input="coil_current_2_a").input == "coil_current_2_a"
        assert "coil_current_a" in expected()
        with pytest.raises(UserError, match="name it otherwise"):
            register(ActuationKind("coil_current", "_a", "A", "charge_c"))
    finally:
        from pliant.records import actuation

        actuation._KINDS.pop(kind.name, None)
    assert split_actuation_names("pressure_1_pa, pressure_2_pa") == ("pressure_1_pa", "pressure_2_pa")


def test_a_share_in_all_actuations_has_a_compiled_form() -> None:
    """With a separate regulator a segment gets s a; slopes are by the chain's a, inside and outside the box."""
    law = SharedActuation(several_law(2, ("x", "y", "z")), 0.7)
    scalar = law.scalar()
    assert scalar is not None
    for a, u in (([8e3, 1e4], [0.1, -0.2, 0.05]), ([4e4, -5e3], [0.4, 0.1, -0.5])):
        tau, by_a, by_u = np.empty(3), np.empty(6), np.empty((3, 3))
        scalar.function(np.array(a), np.array(u), scalar.parameters, tau, by_a, by_u)
        wanted = law.evaluate(np.array([a]), np.array([u]))
        np.testing.assert_allclose(tau, wanted.tau[0], rtol=1e-12)
        np.testing.assert_allclose(by_a.reshape(3, 2), wanted.dtau_dp[0], rtol=1e-11)
        np.testing.assert_allclose(by_u, wanted.dtau_du[0], rtol=1e-11)
