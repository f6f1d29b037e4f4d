"""The parts of the physics benchmarks: the helix, the rod, the baseline, the networks, closed paths, verdicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.physics import closed_paths, cosserat, designs, helix, published
from benchmarks.physics.helix import UnmappedLaw, random_cases
from benchmarks.physics.published import fit_errors, network_law

from pliant.interfaces.simulation import Simulation
from pliant.mechanics.statics import ChainStatics
from pliant.records.chain import ChainModel
from pliant.records.law import JointLaw
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.surrogates.polynomial.study import fit_study

STILL = Quasistatic(QuasistaticConfig())


def test_the_stated_coefficients_equal_the_published_table() -> None:
    table = helix.read_table()
    if table is None:
        pytest.skip(f"reference data absent: {helix.FEM_TABLE}")
    fitted = fit_study(table, odd=False)
    for name in ("k_n", "m_a", "m_e", "b_e"):
        assert getattr(helix.FITTED_Y, name) == pytest.approx(getattr(fitted, name), rel=1e-5)
    box = helix.FITTED_BOX.deformation[0]
    np.testing.assert_allclose(box, [table.angle_rad.min(), table.angle_rad.max()], atol=1e-5)


def test_the_helix_is_the_published_one() -> None:
    chain = helix.helix()
    assert chain.n_joints == 22
    assert chain.length_m == pytest.approx(10 * 4.72e-3 + 12 * 4.77e-3 + 6e-3)
    mass = sum(body.mass_kg for body in chain.bodies)
    assert mass == pytest.approx(10 * 0.868e-3 + 12 * 0.892e-3 + 1150 * np.pi * 16e-6 * 6e-3)
    np.testing.assert_allclose(
        chain.base_rotation[:, 0], [np.cos(np.radians(28)), 0, -np.sin(np.radians(28))]
    )
    turns = [np.arctan2(j.rest_rotation[2, 1], j.rest_rotation[1, 1]) for j in chain.joints]
    np.testing.assert_allclose(np.cumsum(turns)[[0, 5, 10, 16]], [0, 0.85, 1.44, 2.45])
    assert sum(spec.modules for spec in helix.sized_segments(30)) == 30


@pytest.mark.parametrize("frame", ["child", "parent"])
def test_slopes_in_an_unmapped_law(frame: str) -> None:
    law = UnmappedLaw(helix.linear_law(), frame)  # type: ignore[arg-type]
    u, p = np.random.default_rng(0).normal(size=(3, 3)), np.full(3, 1e4)
    exact = law.evaluate(p, u).dtau_du
    for k, step in enumerate(1e-6 * np.eye(3)):
        found = (law.evaluate(p, u + step).tau - law.evaluate(p, u - step).tau) / 2e-6
        np.testing.assert_allclose(found, exact[:, :, k], atol=1e-9)
    assert np.abs(exact - exact.transpose(0, 2, 1)).max() > 1e-4  # no energy term


def test_closed_paths_tell_the_maps_apart() -> None:
    energy = ChainStatics(closed_paths.weightless(helix.helix_law()))
    wrong = closed_paths.weightless(UnmappedLaw(helix.helix_law(), "child"))
    leaks = [
        closed_paths.leak(closed_paths.static_efforts(chain), energy, seed=0, points=300)
        for chain in (closed_paths.weightless(helix.helix_law()), wrong)
    ]
    assert leaks[0] < 5e-6
    assert leaks[1] > 1e-2


def test_efforts_measured_at_an_engines_joints_are_the_laws() -> None:
    pytest.importorskip("pybullet")
    chain = closed_paths.weightless(helix.helix_law())
    q = np.random.default_rng(1).uniform(-0.5, 0.5, (4, 3))
    with Pybullet(PybulletConfig(joint_damping=0.0)).build(chain) as simulation:
        measured = closed_paths.engine_efforts(simulation, chain)(q)
    np.testing.assert_allclose(measured, closed_paths.static_efforts(chain)(q), atol=1e-7)


def test_networks_fit_and_know_their_slopes() -> None:
    law = helix.helix_law()
    networks = network_law(law)
    assert max(fit_errors(law, networks).values()) < 0.01
    p, u = np.full(2, 9e3), np.array([[0.1, 0.35, -0.2], [0.0, 0.2, 0.05]])
    effort = networks.evaluate(p, u)
    np.testing.assert_array_equal(effort.tau, networks.efforts(9e3, u))
    exact = np.diagonal(law.evaluate(p, u).dtau_du, axis1=1, axis2=2)
    slopes = np.diagonal(effort.dtau_du, axis1=1, axis2=2)
    np.testing.assert_allclose(slopes, exact, atol=0.01)  # piecewise constant, of the expected size
    net, sample = networks.networks[1], (9e3, 0.35)
    found = (net.value(9e3, 0.352) - net.value(9e3, 0.348)) / 0.004
    assert net.slopes(*sample)[1] == pytest.approx(found, rel=0.1)


def test_the_bare_script_moves_as_the_engine_without_friction(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare 30 ms of fall in two implementations, which differ by Bullet's link damping and the step length.

    Moments of inertia are raised so that the engine's lower bounds on them have no effect.
    """
    pytest.importorskip("pybullet")
    monkeypatch.setattr(published, "DURATION_S", 0.03)
    law = helix.helix_law()

    def heavy(joint_law: JointLaw) -> ChainModel:
        chain = helix.helix(joint_law)
        raised = 1e-7 * np.eye(3)
        return chain.with_(
            bodies=tuple(replace(body, inertia_kg_m2=body.inertia_kg_m2 + raised) for body in chain.bodies)
        )

    chain = heavy(law)
    bare = published.run(chain, helix.law_efforts(law), 0.02, motor_n_m=0.0)
    with Pybullet(PybulletConfig(joint_damping=0.0)).build(heavy(UnmappedLaw(law, "child"))) as simulation:
        _ramp(simulation, 0.03)
        moved = simulation.markers()
    straight = ChainStatics(chain).geometry.markers(np.zeros((22, 3)))
    assert np.linalg.norm(moved - straight, axis=1).max() > 20e-3
    np.testing.assert_allclose(bare.markers_m, moved, atol=2.5e-4)


def _ramp(simulation: Simulation, duration_s: float) -> None:
    for k in range(round(duration_s / published.STEP_S)):
        simulation.apply(helix.inputs(0.02, helix.PRESSURE_PA * k * published.STEP_S))
        simulation.step(published.STEP_S)


@pytest.mark.slow
def test_a_short_rod_settles_where_the_chain_does() -> None:
    pytest.importorskip("elastica")
    short = [spec._replace(modules=1) for spec in helix.SEGMENTS]
    law = helix.linear_law()
    options = replace(cosserat.FAST, cells=2, duration_s=0.12, damping_per_s=80.0)
    rod = cosserat.settle_rod(law, 0.02, options, short)
    fine = helix.helix(helix.linear_law(cells=2), helix.cut(2, short), end_cylinder=False)
    with STILL.build(fine) as simulation:
        simulation.apply(helix.inputs(0.02))
        tip = simulation.settle().tip_m
    moved = np.linalg.norm(tip - rod.history_m[0])
    assert moved > 2e-3
    assert np.linalg.norm(rod.tip_m - tip) < 0.05e-3


@pytest.mark.slow
def test_a_rod_let_go_swings_as_a_beam_does() -> None:
    pytest.importorskip("elastica")
    from benchmarks.motion import BEAM_HZ, FLEXURAL_N_M2, LENGTH_M, LINE_KG_M
    from benchmarks.physics.swinging_rod import SlenderRod, swing

    rod = SlenderRod(LENGTH_M, FLEXURAL_N_M2, LINE_KG_M, 16)
    free = swing(rod, 0.05, 0.0, 2.5 / BEAM_HZ[0], 0.02)
    assert free.angle[0] == pytest.approx(0.05 * LENGTH_M)

    def left(first_hz: float) -> float:
        """Return the norm of the motion that two modes with the beam's frequency ratio do not fit."""
        angle = 2 * np.pi * first_hz * np.outer(free.time_s, BEAM_HZ / BEAM_HZ[0])
        waves = np.hstack([np.cos(angle), np.sin(angle)])
        return float(np.linalg.norm(free.angle - waves @ np.linalg.lstsq(waves, free.angle, rcond=None)[0]))

    tried = BEAM_HZ[0] * np.linspace(0.8, 1.2, 201)
    assert min(tried, key=left) == pytest.approx(BEAM_HZ[0], rel=0.02)
    held = swing(rod, 0.05, 0.05, 0.2, 0.02)
    np.testing.assert_allclose(held.angle, 0.05 * LENGTH_M, rtol=1e-6)


def test_random_designs_repeat_and_wrong_answers_are_found_out() -> None:
    cases, again = random_cases(3), random_cases(3)
    assert [case.chain.n_joints for case in cases] == [case.chain.n_joints for case in again]
    for case, end in zip(cases, STILL.settle_batch(cases), strict=True):
        assert designs.verdict(case, end) == "stable equilibrium"
        wrong = replace(end, joint_angles=end.joint_angles + 1e-3)
        assert designs.verdict(case, wrong) == "no balance (NOT SAID)"
        assert designs.verdict(case, replace(wrong, converged=False)) == "no balance (said so)"
