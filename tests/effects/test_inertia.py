"""`inertia`: free swings against closed forms, a chain's lowest mode, MuJoCo's own masses, and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh
from tests.effects.bench import ENGINE, chain_with, engine, followed

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend, Variation
from pliant.mechanics.inertia import mass_matrix
from pliant.pipeline.engine_checks import check_terms
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.testing.samples import linear_law, linear_prismatic_law, linear_spherical_law, sample_chain
from pliant_plugins.effects.inertia import lumped_inertia

K, GAIN, P = 0.04, 8e-7, 15e3
END = GAIN * P / K


def make_chain(modules: int, **chain: object) -> ChainModel:
    return sample_chain(linear_law(GAIN, K), modules=modules, gravity=(0, 0, 0), **chain)


def heavy(chain: ChainModel, scale: float = 1.0, damping: float = 0.0) -> ChainModel:
    return chain_with(chain, "inertia", scale=scale, damping_ratio=damping)


def after_a_step(chain: ChainModel, time_s: Array) -> Array:
    """Return (t, n) joint angles after the pressure rises within the first step."""
    run = History.from_arrays({"pressure_pa": np.where(time_s > 0.0, P, 0.0)}, time_s)
    return followed(chain, run)[0]


def swing_period(swing: Array, time_s: Array) -> float:
    """Return the mean time between rising zero crossings, by linear interpolation between samples."""
    k = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    rises = time_s[k] - swing[k] * (time_s[k + 1] - time_s[k]) / (swing[k + 1] - swing[k])
    return float(np.diff(rises).mean())


# -- closed forms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_a_joint_swings_at_its_frequency_and_keeps_its_amplitude(scale: float) -> None:
    """50 samples per period: 2π √(f J / K) within 1 %, and exactly that of Newmark's rule, tan(ω' h/2) = ω h/2."""
    chain = make_chain(1, payload=0.005)
    inertia = float(mass_matrix(chain, np.zeros((1, 1)))[0, 0])
    omega = np.sqrt(K / (scale * inertia))
    h = 2 * np.pi / omega / 50
    time_s = h * np.arange(20 * 50 + 26)
    swing = after_a_step(heavy(chain, scale), time_s)[:, 0] - END
    period = swing_period(swing, time_s)
    assert period == pytest.approx(2 * np.pi / omega, rel=0.01)
    assert period == pytest.approx(np.pi * h / np.arctan(omega * h / 2), rel=1e-5)
    first, last = np.abs(swing[1:101]).max(), np.abs(swing[-100:]).max()
    assert first == pytest.approx(END, rel=0.01)
    assert last == pytest.approx(first, rel=2e-3)


def test_a_dashpot_beside_it_damps_as_the_oscillator() -> None:
    """J u'' + T K u' + K u = g p after a step, ζ = T ω / 2 = 0.2; the dashpot's backward rate needs fine steps."""
    chain = make_chain(1)
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


def test_its_damping_equals_the_oscillator() -> None:
    """f (u'' + 2 ζ ω u') + ω² (u − U) = 0: the swing decays as e^(−ζ ω t) for every f."""
    chain = make_chain(1)
    omega, ratio, scale = np.sqrt(K / lumped_inertia(chain)[0]), 0.15, 1.7
    time_s = np.linspace(0.0, 15.0 / omega, 3001)
    wet = np.sqrt(omega**2 / scale - (ratio * omega) ** 2)
    swing = np.cos(wet * time_s) + ratio * omega / wet * np.sin(wet * time_s)
    exact = END * (1 - np.exp(-ratio * omega * time_s) * swing)
    np.testing.assert_allclose(after_a_step(heavy(chain, scale, ratio), time_s)[:, 0], exact, atol=4e-3 * END)


def test_a_swing_that_samples_cannot_show_is_gone_after_a_few() -> None:
    """With one sample in two or in forty periods the joint reaches its static angle after a step."""
    chain = make_chain(1)
    for periods in (0.5, 2.0, 40.0):
        h = periods * 2 * np.pi * np.sqrt(lumped_inertia(chain)[0] / K)
        angle = after_a_step(heavy(chain), h * np.arange(20))[:, 0]
        np.testing.assert_allclose(angle[8:], END, atol=2e-3 * END)


@pytest.mark.parametrize("payload", [0.0, 0.01])
@pytest.mark.parametrize("modules", [2, 5])
def test_a_chain_has_the_lowest_eigenfrequency_from_its_mass_matrix(modules: int, payload: float) -> None:
    chain = make_chain(modules, payload=payload)
    lowest = np.sqrt(eigh(K * np.eye(modules), mass_matrix(chain, np.zeros((modules, 1))))[0][0])
    time_s = np.arange(450) * 2 * np.pi / lowest / 100
    angle = after_a_step(heavy(chain), time_s).sum(axis=1) - modules * END
    assert swing_period(angle, time_s) == pytest.approx(2 * np.pi / lowest, rel=1e-3)


def test_what_is_reached_slowly_and_slow_runs_have_none() -> None:
    chain, pressures = heavy(make_chain(3)), np.array([0.0, P, 5e3, P])
    (angles,) = followed(chain, History.from_arrays({"pressure_pa": pressures}))
    np.testing.assert_allclose(angles[:, 0], GAIN * pressures / K, atol=1e-7)
    time_s = np.linspace(0.0, 20.0, 201)
    (angles,) = followed(chain, History.from_arrays({"pressure_pa": P * time_s / 20.0}, time_s))
    np.testing.assert_allclose(angles[:, 0], END * time_s / 20.0, atol=2e-3 * END)


@pytest.mark.parametrize(
    ("law", "axis"), [(linear_spherical_law(), 1), (linear_prismatic_law(), 0)], ids=["ball", "slide"]
)
def test_one_joint_in_any_kind_has_its_own_inertia(law: object, axis: int) -> None:
    chain = sample_chain(law, modules=1, payload=0.004)  # type: ignore[arg-type]
    still = np.zeros((1, len(chain.axes)))
    assert lumped_inertia(chain) == pytest.approx([mass_matrix(chain, still)[axis, axis]])


# -- another engine --------------------------------------------------------------------------------


def mujoco(drag_1_s: float) -> PhysicsBackend:
    return engine("mujoco", timestep_s=1e-3, joint_damping=0.0, drag_1_s=drag_1_s)


@pytest.mark.slow
def test_it_is_what_mujoco_has_by_itself() -> None:
    """One joint with a dashpot after a step, in MuJoCo without its drag: the same swing within 2 %."""
    chain = make_chain(1, payload=0.02)
    omega = np.sqrt(K / lumped_inertia(chain)[0])
    damped = chain_with(chain, "viscous_damping", time_s=0.2 / omega)
    time_s = np.linspace(0.0, 15.0 / omega, 3001)
    run = History.from_arrays({"pressure_pa": np.where(time_s > 0.0, P, 0.0)}, time_s)
    (moved,) = followed(damped, run, by=mujoco(0.0))
    mine = after_a_step(heavy(damped), time_s)[:, 0]
    assert mine.max() > 1.6 * END
    np.testing.assert_allclose(mine, moved[:, 0], atol=0.02 * END)


def test_mujoco_s_drag_is_this_damping() -> None:
    """Both are proportional to mass: ζ = drag / 2 ω."""
    chain = make_chain(1, payload=0.02)
    omega, drag = float(np.sqrt(K / lumped_inertia(chain)[0])), 20.0
    time_s = np.linspace(0.0, 15.0 / omega, 3001)
    run = History.from_arrays({"pressure_pa": np.where(time_s > 0.0, P, 0.0)}, time_s)
    (moved,) = followed(chain, run, by=mujoco(drag))
    mine = after_a_step(heavy(chain, damping=0.5 * drag / omega), time_s)[:, 0]
    assert 1.2 * END < mine.max() < 1.9 * END
    np.testing.assert_allclose(mine, moved[:, 0], atol=0.02 * END)


def test_engines_that_accelerate_masses_refuse_it() -> None:
    with pytest.raises(UserError, match="physics 'mujoco' accelerates the chain's masses by itself"):
        check_terms(engine("mujoco"), heavy(make_chain(2)))
    check_terms(ENGINE, heavy(make_chain(2)))


# -- payloads of a recording -----------------------------------------------------------------------


@pytest.mark.parametrize("modules", [1, 4])
def test_a_run_with_a_payload_swings_as_a_chain_that_has_it(modules: int) -> None:
    """Exact for one joint; for four the shape of the lowest swing changes a little with the payload."""
    plain, payload = make_chain(modules), 0.01
    time_s = np.linspace(0.0, 2.0, 801)
    pressure = {"pressure_pa": np.where(time_s > 0.0, P, 0.0)}
    light, loaded = (
        History.from_arrays(pressure, time_s, payload_kg=kg, run=str(kg)) for kg in (0.0, payload)
    )
    alone, hung = followed(heavy(plain), light, loaded)
    own = followed(heavy(plain.with_(payload_kg=payload)), loaded)[0]
    rest = modules * END
    periods = [swing_period(swing.sum(axis=1) - rest, time_s) for swing in (alone, hung, own)]
    assert periods[1] > 1.5 * periods[0]
    assert periods[1] == pytest.approx(periods[2], rel=1e-9 if modules == 1 else 0.02)
    np.testing.assert_array_equal(alone, followed(heavy(plain), light)[0])


def test_variations_have_the_payload_in_each_run() -> None:
    """First-order changes agree with the difference of two simulations, run by run."""
    plain, step = make_chain(2), 1e-5
    time_s = np.linspace(0.0, 0.5, 201)
    pressure = {"pressure_pa": np.where(time_s > 0.0, P, 0.0)}
    runs = [History.from_arrays(pressure, time_s, payload_kg=kg, run=str(kg)) for kg in (0.01, 0.0)]
    base, moved = (heavy(plain, scale, damping=0.1) for scale in (1.0, 1.0 + step))
    _, changes = ENGINE.follow(base, runs, [Variation(moved, tuple(runs))])
    for before, after, change in zip(followed(base, *runs), followed(moved, *runs), changes[0], strict=True):
        difference = (after - before) / step
        np.testing.assert_allclose(
            change.joint_angles[:, :, 0] / step, difference, atol=2e-3 * np.abs(difference).max()
        )
