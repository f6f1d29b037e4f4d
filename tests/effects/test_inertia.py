"""`inertia`: free swings against closed forms, a chain's lowest swing, MuJoCo's own masses, and who refuses it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh
from tests.effects.bench import ENGINE, chain_with, engine, followed

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.mechanics.inertia import mass_matrix
from pliant.pipeline.engine_checks import check_terms
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.testing.samples import linear_law, linear_prismatic_law, linear_spherical_law, sample_chain
from pliant_plugins.effects.inertia import lumped_inertia

K, GAIN, P = 0.04, 8e-7, 15e3
END = GAIN * P / K


def chain_of(modules: int, **chain: object) -> ChainModel:
    return sample_chain(linear_law(GAIN, K), modules=modules, gravity=(0, 0, 0), **chain)


def heavy(chain: ChainModel, scale: float = 1.0, damping: float = 0.0) -> ChainModel:
    return chain_with(chain, "inertia", scale=scale, damping_ratio=damping)


def after_a_step(chain: ChainModel, time_s: Array) -> Array:
    """(t, n) joint angles after the pressure has come within the first step."""
    run = History.of({"pressure_pa": np.where(time_s > 0.0, P, 0.0)}, time_s)
    return followed(chain, run)[0]


def period_of(swing: Array, time_s: Array) -> float:
    """Mean time between rises through zero, by straight lines between samples."""
    k = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    rises = time_s[k] - swing[k] * (time_s[k + 1] - time_s[k]) / (swing[k + 1] - swing[k])
    return float(np.diff(rises).mean())


# -- closed forms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_a_joint_swings_at_its_frequency_and_keeps_its_amplitude(scale: float) -> None:
    """50 samples per period: 2π √(f J / K) within 1 %, and exactly that of Newmark's rule, tan(ω' h/2) = ω h/2."""
    chain = chain_of(1, payload=0.005)
    inertia = float(mass_matrix(chain, np.zeros((1, 1)))[0, 0])
    omega = np.sqrt(K / (scale * inertia))
    h = 2 * np.pi / omega / 50
    time_s = h * np.arange(20 * 50 + 26)
    swing = after_a_step(heavy(chain, scale), time_s)[:, 0] - END
    period = period_of(swing, time_s)
    assert period == pytest.approx(2 * np.pi / omega, rel=0.01)
    assert period == pytest.approx(np.pi * h / np.arctan(omega * h / 2), rel=1e-5)
    first, last = np.abs(swing[1:101]).max(), np.abs(swing[-100:]).max()
    assert first == pytest.approx(END, rel=0.01)
    assert last == pytest.approx(first, rel=2e-3)


def test_a_dashpot_beside_it_damps_as_the_oscillator() -> None:
    """J u'' + T K u' + K u = g p after a step, ζ = T ω / 2 = 0.2; backward rates of the dashpot need fine steps."""
    chain = chain_of(1)
    omega = np.sqrt(K / lumped_inertia(chain)[0])
    damped = chain_with(heavy(chain), "viscous_damping", time_s=0.4 / omega)
    time_s = np.linspace(0.0, 12.0 / omega, 4801)
    ratio, wet = 0.2, omega * np.sqrt(1 - 0.04)
    exact = END * (
        1
        - np.exp(-ratio * omega * time_s)
        * (np.cos(wet * time_s) + ratio / np.sqrt(1 - 0.04) * np.sin(wet * time_s))
    )
    np.testing.assert_allclose(after_a_step(damped, time_s)[:, 0], exact, atol=5e-3 * END)


def test_its_own_damping_is_that_of_the_oscillator() -> None:
    """f (u'' + 2 ζ ω u') + ω² (u − U) = 0: the swing falls as e^(−ζ ω t) whatever f."""
    chain = chain_of(1)
    omega, ratio, scale = np.sqrt(K / lumped_inertia(chain)[0]), 0.15, 1.7
    time_s = np.linspace(0.0, 15.0 / omega, 3001)
    wet = np.sqrt(omega**2 / scale - (ratio * omega) ** 2)
    swing = np.cos(wet * time_s) + ratio * omega / wet * np.sin(wet * time_s)
    exact = END * (1 - np.exp(-ratio * omega * time_s) * swing)
    np.testing.assert_allclose(after_a_step(heavy(chain, scale, ratio), time_s)[:, 0], exact, atol=4e-3 * END)


def test_a_swing_that_samples_cannot_show_is_gone_after_a_few() -> None:
    """Sampled once in two and in forty periods: after a step the joint stands where statics has it."""
    chain = chain_of(1)
    for periods in (0.5, 2.0, 40.0):
        h = periods * 2 * np.pi * np.sqrt(lumped_inertia(chain)[0] / K)
        angle = after_a_step(heavy(chain), h * np.arange(20))[:, 0]
        np.testing.assert_allclose(angle[8:], END, atol=2e-3 * END)


@pytest.mark.parametrize("payload", [0.0, 0.01])
@pytest.mark.parametrize("modules", [2, 5])
def test_a_chain_has_the_lowest_swing_of_its_mass_matrix(modules: int, payload: float) -> None:
    chain = chain_of(modules, payload=payload)
    lowest = np.sqrt(eigh(K * np.eye(modules), mass_matrix(chain, np.zeros((modules, 1))))[0][0])
    time_s = np.arange(450) * 2 * np.pi / lowest / 100
    angle = after_a_step(heavy(chain), time_s).sum(axis=1) - modules * END
    assert period_of(angle, time_s) == pytest.approx(2 * np.pi / lowest, rel=1e-3)


def test_what_is_reached_slowly_and_slow_runs_have_none() -> None:
    chain, pressures = heavy(chain_of(3)), np.array([0.0, P, 5e3, P])
    (angles,) = followed(chain, History.of({"pressure_pa": pressures}))
    np.testing.assert_allclose(angles[:, 0], GAIN * pressures / K, atol=1e-7)
    time_s = np.linspace(0.0, 20.0, 201)
    (angles,) = followed(chain, History.of({"pressure_pa": P * time_s / 20.0}, time_s))
    np.testing.assert_allclose(angles[:, 0], END * time_s / 20.0, atol=2e-3 * END)


@pytest.mark.parametrize(
    ("law", "axis"), [(linear_spherical_law(), 1), (linear_prismatic_law(), 0)], ids=["ball", "slide"]
)
def test_one_joint_of_any_kind_has_its_own_inertia(law: object, axis: int) -> None:
    chain = sample_chain(law, modules=1, payload=0.004)  # type: ignore[arg-type]
    still = np.zeros((1, len(chain.axes)))
    assert lumped_inertia(chain) == pytest.approx([mass_matrix(chain, still)[axis, axis]])


# -- another engine --------------------------------------------------------------------------------


def mujoco(drag_1_s: float) -> PhysicsBackend:
    return engine("mujoco", timestep_s=1e-3, joint_damping=0.0, drag_1_s=drag_1_s)


@pytest.mark.slow
def test_it_is_what_mujoco_has_by_itself() -> None:
    """One joint with a dashpot after a step, in MuJoCo without its drag: the same swing within 2 % of it."""
    chain = chain_of(1, payload=0.02)
    omega = np.sqrt(K / lumped_inertia(chain)[0])
    damped = chain_with(chain, "viscous_damping", time_s=0.2 / omega)
    time_s = np.linspace(0.0, 15.0 / omega, 3001)
    run = History.of({"pressure_pa": np.where(time_s > 0.0, P, 0.0)}, time_s)
    (moved,) = followed(damped, run, by=mujoco(0.0))
    mine = after_a_step(heavy(damped), time_s)[:, 0]
    assert mine.max() > 1.6 * END
    np.testing.assert_allclose(mine, moved[:, 0], atol=0.02 * END)


def test_mujoco_s_drag_is_this_damping() -> None:
    """Both are in proportion to mass: ζ = drag / 2 ω."""
    chain = chain_of(1, payload=0.02)
    omega, drag = float(np.sqrt(K / lumped_inertia(chain)[0])), 20.0
    time_s = np.linspace(0.0, 15.0 / omega, 3001)
    run = History.of({"pressure_pa": np.where(time_s > 0.0, P, 0.0)}, time_s)
    (moved,) = followed(chain, run, by=mujoco(drag))
    mine = after_a_step(heavy(chain, damping=0.5 * drag / omega), time_s)[:, 0]
    assert 1.2 * END < mine.max() < 1.9 * END
    np.testing.assert_allclose(mine, moved[:, 0], atol=0.02 * END)


def test_engines_that_accelerate_masses_refuse_it() -> None:
    with pytest.raises(UserError, match="physics 'mujoco' accelerates the chain's masses by itself"):
        check_terms(engine("mujoco"), heavy(chain_of(2)))
    check_terms(ENGINE, heavy(chain_of(2)))
