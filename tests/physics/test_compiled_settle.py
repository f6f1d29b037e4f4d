"""Settling in compiled code: results of the Python path, large chains, a thousand designs from a cold start."""

from __future__ import annotations

import numpy as np
import pytest
from tests.physics.conftest import SCALAR, ScalarSpatial, ScalarStudy, finger, random_chain, settle
from tests.physics.random_designs import random_cases

from pliant.interfaces.physics import Case
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel, default_base_rotation
from pliant.records.design import Array
from pliant.records.law import Domain
from pliant.records.rollout import Cord, Equilibrium, Inputs, PointForce
from pliant_plugins.physics.compiled import equilibrium
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.simulation import QuasistaticSimulation

CONFIG = QuasistaticConfig()
BACKEND = Quasistatic(CONFIG)
TOLERANCE = 1e-9


def both_ways(chain: ChainModel, inputs: Inputs) -> tuple[Equilibrium, Equilibrium]:
    plain = QuasistaticSimulation(chain, CONFIG)
    plain.apply(inputs)
    return settle(BACKEND, chain, inputs), plain.settle()


def chains() -> dict[str, ChainModel]:
    made = {kind: finger(law(), 9, 0.0016, 0.01, payload_kg=0.02) for kind, law in SCALAR.items()}
    return {**made, "random": random_chain().with_(laws=(ScalarSpatial(),))}


@pytest.mark.parametrize("name", chains())
def test_the_answer_equals_the_python_path(name: str) -> None:
    chain = chains()[name]
    inputs = Inputs(
        {"pressure_pa": 12e3},
        np.array([0.02, 0.01, -0.05]),
        0.0 if name == "prismatic" else 2e-3,
        (PointForce(2, np.array([0.0, 0.0, 0.004]), np.array([0.0, 0.05, 0.02])),),
        (Cord(5, np.array([0.002, 0.0, 0.003]), np.array([0.3, 0.1, -0.2]), 0.1),),
    )
    fast, plain = both_ways(chain, inputs)
    assert fast.converged and fast.stable and plain.converged
    np.testing.assert_allclose(fast.joint_angles, plain.joint_angles, atol=1e-8)
    np.testing.assert_allclose(fast.markers_m, plain.markers_m, atol=1e-9)
    residual = ChainStatics(chain).residual(fast.joint_angles, Loads.from_inputs(chain, inputs))
    assert np.abs(residual).max() == pytest.approx(fast.residual, abs=1e-15)
    assert fast.residual <= TOLERANCE
    markers = ChainStatics(chain).geometry.markers(fast.joint_angles)
    np.testing.assert_allclose(fast.markers_m, markers, atol=1e-15)


@pytest.mark.parametrize(
    ("highest_pa", "widest_rad", "left"),
    [(10e3, 0.3, {"pressure_pa", "angle_rad"}), (20e3, 1e-3, {"angle_rad"}), (10e3, 3.0, {"pressure_pa"})],
)
def test_leaving_the_domain_is_told_as_by_the_python_path(
    highest_pa: float, widest_rad: float, left: set[str]
) -> None:
    """Also if every joint leaves the box in one variable only."""
    box = Domain(np.array([0.0, highest_pa]), np.array([[-widest_rad, widest_rad]]))
    chain = finger(ScalarStudy(domain=box), 4, gravity_m_s2=np.zeros(3))
    fast, plain = both_ways(chain, Inputs({"pressure_pa": 12e3}))
    assert {entry.variable for entry in fast.outside_domain} == left
    assert {entry.module for entry in fast.outside_domain} == set(range(1, 5))
    assert [(e.module, e.variable) for e in fast.outside_domain] == [
        (e.module, e.variable) for e in plain.outside_domain
    ]
    inside, _ = both_ways(chain, Inputs({"pressure_pa": 0.0}))
    assert inside.outside_domain == ()


def test_a_law_that_runs_away_is_an_honest_failure() -> None:
    backend = Quasistatic(QuasistaticConfig(max_iterations=15, smallest_step=0.25))
    chain = finger(ScalarStudy(m_e=0.0, b_e=-0.02), gravity_m_s2=np.zeros(3))
    end = settle(backend, chain, Inputs({"pressure_pa": 1e3}))
    assert not end.converged and not end.stable
    assert end.residual > 1e-4
    assert {entry.variable for entry in end.outside_domain} == {"dtau_du"}


def test_a_saddle_is_left() -> None:
    """The chain is upright under a load beyond buckling: in balance at once, and unstable."""
    turned = default_base_rotation() @ np.diag([-1.0, 1.0, -1.0])
    for law in (ScalarStudy(), ScalarSpatial()):
        chain = finger(law, gravity_m_s2=np.zeros(3), base_rotation=turned)
        fast, _ = both_ways(chain, Inputs({"pressure_pa": 0.0}, np.array([0.0, 0.0, -3.0])))
        assert fast.converged and fast.stable
        assert np.abs(fast.joint_angles).max() > 0.1


def test_a_cord_that_reaches_its_pulley_is_an_honest_failure() -> None:
    """The cord has no direction there: the residual cannot vanish, and the chain ends where the cord is short."""
    chain = finger(ScalarSpatial(), 12, 0.0016)
    pulley = np.array([0.05, 0.0, -0.08])
    cord = Cord(12, chain.tip_offset_m, pulley, 2.0)
    end = settle(BACKEND, chain, Inputs({"pressure_pa": 5e3}, cords=(cord,)))
    assert not end.converged
    assert np.linalg.norm(end.tip_m - pulley) < 1e-3


def circulating(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    for a in range(3):
        tau[a] = p * c[a] - 0.03 * u[a]
        dtau_dp[a] = c[a]
        for b in range(3):
            dtau_du[a, b] = 0.0
        dtau_du[a, a] = -0.03
    tau[0] += 0.01 * u[1]
    dtau_du[0, 1] = 0.01
    tau[1] -= 0.01 * u[0]
    dtau_du[1, 0] = -0.01


class Circulating(ScalarSpatial):
    """A law without an energy: ∂τ/∂u is not symmetric."""

    function = staticmethod(circulating)


def test_a_law_without_an_energy_converges_quadratically_too() -> None:
    fast, plain = both_ways(finger(Circulating(), 9, 0.0016), Inputs({"pressure_pa": 12e3}))
    assert fast.converged and fast.iterations <= plain.iterations + 2
    np.testing.assert_allclose(fast.joint_angles, plain.joint_angles, atol=1e-8)


def test_large_chains() -> None:
    """256 modules have 256 and 768 coordinates."""
    for law in (ScalarStudy(), ScalarSpatial()):
        chain = finger(law, 256, 1e-6)
        end = settle(BACKEND, chain, Inputs({"pressure_pa": 1e3}))
        assert end.converged and end.stable and end.residual <= TOLERANCE


def test_one_compiled_form_serves_all_chains() -> None:
    """Another type of argument would take another twenty seconds of compiling."""
    for chain in chains().values():
        odd = np.asfortranarray(chain.base_rotation)
        odd.setflags(write=False)
        settle(BACKEND, chain.with_(base_rotation=odd), Inputs({"pressure_pa": 5e3}))
    assert len(equilibrium.settle.signatures) == 1


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_random_designs_settle_from_a_cold_start(count: int) -> None:
    cases = random_cases(count)
    found = BACKEND.settle_batch(cases)
    failed = [number for number, end in enumerate(found) if not (end.converged and end.stable)]
    assert failed == []
    assert max(end.residual for end in found) <= TOLERANCE
    _confirm(cases[:: count // 10], found[:: count // 10])


def _confirm(cases: list[Case], found: tuple[Equilibrium, ...]) -> None:
    """Check in Python that these are stable equilibria."""
    for case, end in zip(cases, found, strict=True):
        balance = ChainStatics(case.chain).balance(
            end.joint_angles, Loads.from_inputs(case.chain, case.inputs)
        )
        assert np.abs(balance.residual).max() <= 1.01 * TOLERANCE
        assert np.linalg.eigvalsh(balance.stiffness)[0] > 0.0
