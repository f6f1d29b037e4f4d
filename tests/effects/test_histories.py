"""Effects in the quasi-static engine: whole runs of one joint and of a chain of eight, and static tasks.

Weightless joints of a linear law, τ = g p − K u, each follow the same closed form however many they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from tests.effects.bench import ENGINE, effect, stepped

from pliant.interfaces.effect import Model
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Inputs
from pliant.records.term import LawTerm
from pliant.testing.histories import triangles
from pliant.testing.samples import linear_law, sample_chain

K, GAIN = 0.04, 8e-7
P = 15e3
U = GAIN * P / K  # 0.3 rad
both = pytest.mark.parametrize("modules", [1, 8])
MEMORY: tuple[tuple[str, dict[str, float]], ...] = (
    ("viscous_damping", {"time_s": 0.3}),
    ("viscoelastic", {"share": 0.4, "time_s": 5.0}),
    ("friction_hysteresis", {"half_width_rad": 0.03, "break_away_rad": 0.01}),
    ("mullins", {"softening": 0.3, "scale_rad": 0.2}),
    ("permanent_set", {"share": 0.1}),
)


def make_chain(modules: int) -> ChainModel:
    return sample_chain(linear_law(GAIN, K), modules=modules, gravity=(0, 0, 0))


def model_with(chain: ChainModel, *effects: tuple[str, Mapping[str, Any]]) -> Model:
    model = Model(chain)
    for kind, values in effects:
        model = effect(kind, **values).apply(model)
    return model


def followed(modules: int, histories: list[History], *effects: tuple[str, Mapping[str, Any]]) -> list[Array]:
    """Return the (t,) angle of a joint in each history; all joints must agree."""
    model = model_with(make_chain(modules), *effects)
    runs, _ = ENGINE.follow(model.chain, [model.commanded(h) for h in histories])
    for run in runs:
        assert run.joint_angles.shape[1:] == (modules, 1)
        assert np.all(run.converged)
        np.testing.assert_allclose(run.joint_angles, run.joint_angles[:, :1].repeat(modules, 1), atol=1e-7)
    return [run.joint_angles[:, 0, 0] for run in runs]


def pressed(time_s: Array, pressure: Array, **more: Any) -> History:
    return History.from_arrays({"pressure_pa": pressure}, time_s, **more)


def ramps(levels: tuple[float, ...], rate: float, step_s: float, holds_s: float = 0.0) -> History:
    return pressed(*triangles(levels, rate, step_s, holds_s))


# -- time ------------------------------------------------------------------------------------------


@both
def test_damped_creep_after_a_step(modules: int) -> None:
    """u = U (1 − exp(−t/T)); by implicit Euler steps h it is U (1 − (1 + h/T)^−n) exactly."""
    h, T = 0.01, 0.3
    t = h * np.arange(201)
    (u,) = followed(modules, [pressed(t, np.where(t > 0, P, 0.0))], ("viscous_damping", {"time_s": T}))
    np.testing.assert_allclose(u, U * (1 - (1 + h / T) ** -np.arange(201.0)), atol=1e-7)
    np.testing.assert_allclose(u, U * (1 - np.exp(-t / T)), atol=0.02 * U)


@both
def test_viscoelastic_creep_and_recovery(modules: int) -> None:
    """Standard linear solid: u = U (1 − g/(1+g) exp(−t/T(1+g))) under constant pressure, and back after venting."""
    share, T, hold = 0.5, 10.0, 60.0
    h = 0.1
    t = h * np.arange(1201)
    loaded = (t > 0) & (t <= hold)
    (u,) = followed(
        modules, [pressed(t, np.where(loaded, P, 0.0))], ("viscoelastic", {"share": share, "time_s": T})
    )

    def creep(since: Array) -> Array:
        late = np.maximum(since, 0.0)
        return np.where(since > 0, U * (1 - share / (1 + share) * np.exp(-late / (T * (1 + share)))), 0.0)

    # A step of the pressure arrives within one sample; its middle is half a step late.
    wanted = creep(t - 0.5 * h) - creep(t - hold - 0.5 * h)
    np.testing.assert_allclose(u, wanted, atol=2e-3 * U)
    assert u[1] == pytest.approx(U / (1 + share), rel=0.02)
    assert u[-1] < 0.01 * U


@both
def test_a_lagging_supply_is_behind_on_a_ramp_and_even_on_a_hold(modules: int) -> None:
    history = ramps((P, 0.0), 3e3, 0.1, holds_s=8.0)
    (u,) = followed(modules, [history], ("supply_lag", {"time_s": 0.4, "second_ratio": 0.25}))
    (plain,) = followed(modules, [history])
    on_the_way_up, end_of_hold, on_the_way_down = 45, 129, 175
    late = GAIN * 3e3 * 0.5 / K
    assert plain[on_the_way_up] - u[on_the_way_up] == pytest.approx(late, rel=1e-3)
    assert u[on_the_way_down] - plain[on_the_way_down] == pytest.approx(late, rel=1e-3)
    assert u[end_of_hold] == pytest.approx(plain[end_of_hold], abs=1e-6)


# -- friction --------------------------------------------------------------------------------------


@both
def test_a_friction_loop_is_as_wide_at_every_rate(modules: int) -> None:
    """While slipping, K u = g p ∓ w K: the branches are 2 w apart."""
    friction = ("friction_hysteresis", {"half_width_rad": 0.03, "break_away_rad": 0.01})
    runs = [ramps((P, 0.0, P, 0.0), rate, 150.0 / rate) for rate in (300.0, 30e3)]
    slow, fast = followed(modules, runs, friction)
    np.testing.assert_allclose(slow, fast, atol=1e-7)
    p = runs[0].actuation["pressure_pa"]
    middle = np.flatnonzero(np.abs(p - 7500.0) < 1.0)
    np.testing.assert_allclose(slow[middle], U / 2 + np.array([-0.03, 0.03, -0.03, 0.03]), atol=1e-6)
    # After a reversal the joint moves only by its friction spring: K (1 + w/δ).
    turned = np.flatnonzero(p == P)[0]
    first_move = slow[turned] - slow[turned + 1]
    assert first_move == pytest.approx(GAIN * 150.0 / (K * (1 + 0.03 / 0.01)), rel=1e-3)


@both
def test_friction_acts_on_data_without_a_clock(modules: int) -> None:
    levels = np.array([0.0, 5e3, 10e3, P, 10e3, 5e3])
    friction = ("friction_hysteresis", {"half_width_rad": 0.03, "break_away_rad": 0.01})
    (u,) = followed(modules, [History.from_arrays({"pressure_pa": levels})], friction)
    side = np.array([0, -1, -1, -1, 1, 1])
    np.testing.assert_allclose(u, GAIN * levels / K + 0.03 * side, atol=1e-6)


# -- damage ----------------------------------------------------------------------------------------


@both
def test_mullins_softens_a_specimen_for_good(modules: int) -> None:
    low, high = (ramps((level, 0.0), 3e3, 0.1) for level in (0.6 * P, P))
    runs = [
        low.with_(specimen="a"),
        low.with_(specimen="a"),
        low.with_(specimen="b"),
        high.with_(specimen="a"),
    ]
    virgin, again, other, further = followed(modules, runs, ("mullins", {"softening": 0.3, "scale_rad": 0.2}))
    (plain, plain_high) = followed(modules, [low, high])
    rising = slice(1, 30)
    np.testing.assert_allclose(virgin[:31], plain[:31], atol=1e-7)
    assert np.all(again[rising] > virgin[rising] + 1e-4)
    np.testing.assert_allclose(other, virgin, atol=1e-9)
    np.testing.assert_allclose(further[30:51], plain_high[30:51], atol=1e-6)
    assert np.all(further[rising] > plain_high[rising] + 1e-4)


@both
def test_a_set_stays_after_venting_and_is_remembered(modules: int) -> None:
    """K (u − s u₊) = g p: u₊ = U / (1 − s), and s u₊ when vented."""
    t = np.arange(0.0, 101.0, 1.0)
    run = pressed(t, np.where((t > 10) & (t < 30), P, 0.0), specimen="a")
    first, second = followed(modules, [run, run], ("permanent_set", {"share": 0.1}))
    largest = U / 0.9
    np.testing.assert_allclose(first[20], largest, atol=1e-6)
    np.testing.assert_allclose(first[40:], 0.1 * largest, atol=1e-6)
    np.testing.assert_allclose(second[0], 0.1 * largest, atol=1e-6)
    np.testing.assert_allclose(second[20:], first[20:], atol=1e-6)


# -- without memory --------------------------------------------------------------------------------


@both
def test_contact_bends_the_curve_at_its_angle(modules: int) -> None:
    history = ramps((P,), 3e3, 0.05)
    (u,) = followed(modules, [history], ("self_contact", {"stiffening": 2.0, "contact_rad": 0.2}))
    free = GAIN * history.actuation["pressure_pa"] / K
    np.testing.assert_allclose(u, np.where(free < 0.2, free, (free + 2 * 0.2) / 3), atol=1e-6)


@both
def test_a_warm_run_is_softer(modules: int) -> None:
    history = ramps((P,), 3e3, 0.25).with_(temperature_c=np.full(21, 42.0))
    (u,) = followed(modules, [history], ("thermal_softening", {"loss_per_k": 0.01}))
    np.testing.assert_allclose(u, GAIN * history.actuation["pressure_pa"] / (0.8 * K), atol=1e-6)


@both
def test_effects_compose_in_one_run(modules: int) -> None:
    """K f c (u − s u₊) = g (G p + p₀) on the way up."""
    history = ramps((P,), 3e3, 0.25).with_(temperature_c=np.full(21, 32.0))
    (u,) = followed(
        modules,
        [history],
        ("actuation_gain", {"gain": 0.8}),
        ("pressure_offset", {"offset_pa": 500.0}),
        ("stiffness", {"factor": 1.25}),
        ("thermal_softening", {"loss_per_k": 0.01}),
        ("permanent_set", {"share": 0.1}),
    )
    acting = 0.8 * history.actuation["pressure_pa"] + 500.0
    np.testing.assert_allclose(u, GAIN * acting / (K * 1.25 * 0.9 * 0.9), atol=1e-6)


# -- the engine against plain Python and against its own steps ---------------------------------------


@pytest.mark.parametrize("memory", MEMORY, ids=[kind for kind, _ in MEMORY])
def test_settle_and_step_walk_the_same_path_as_a_history(memory: tuple[str, Mapping[str, float]]) -> None:
    """A loaded chain of eight under gravity, by Newton in all joints at once: another implementation."""
    chain = model_with(sample_chain(modules=8), memory).chain
    history = ramps((P, 4e3), 5e3, 0.5, holds_s=2.0)
    (run,) = ENGINE.follow(chain, [history])[0]
    np.testing.assert_allclose(run.joint_angles, stepped(chain, history, 0.5), atol=2e-5)


def excess(angle: float) -> float:
    return max(angle - GAP, 0.0)


GAP = 0.2


def pushed(u: float, rate: float, dt: float, p: float, t: float, old: Array, new: Array, c: Array) -> float:
    return -c[0] * excess(u)  # type: ignore[no-any-return]


def test_a_term_may_call_functions_in_its_own_file() -> None:
    chain = make_chain(1).with_(terms=(LawTerm("moment", pushed, (2 * K,)),))
    ((run,), _) = ENGINE.follow(chain, [ramps((P,), 3e3, 0.5)])
    assert run.joint_angles[-1, 0, 0] == pytest.approx((U + 2 * GAP) / 3, abs=1e-6)


# -- static tasks ----------------------------------------------------------------------------------

STATIC = [
    ("viscous_damping", {"time_s": 0.3}, U, U / 2),
    ("viscoelastic", {"share": 0.4, "time_s": 5.0}, U, U / 2),
    ("friction_hysteresis", {"half_width_rad": 0.03, "break_away_rad": 0.01}, U - 0.03, U / 2 + 0.03),
    ("mullins", {"softening": 0.3, "scale_rad": 0.2}, U, None),
    ("permanent_set", {"share": 0.1}, U / 0.9, U / 2 + 0.1 * U / 0.9),
]


@both
@pytest.mark.parametrize(("kind", "values", "pressed_to", "released_to"), STATIC, ids=[s[0] for s in STATIC])
def test_a_settled_chain_is_where_a_slow_path_ends(
    modules: int, kind: str, values: dict[str, float], pressed_to: float, released_to: float | None
) -> None:
    chain = model_with(make_chain(modules), (kind, values)).chain
    with ENGINE.build(chain) as simulation:
        simulation.apply(Inputs({"pressure_pa": P}))
        loaded = simulation.settle()
        simulation.apply(Inputs({"pressure_pa": P / 2}))
        released = simulation.settle()
    assert loaded.converged
    assert released.converged
    np.testing.assert_allclose(loaded.joint_angles, pressed_to, atol=1e-6)
    if released_to is None:  # softened: the same pressure bends farther than at first
        assert np.all(released.joint_angles > U / 2 + 0.01)
    else:
        np.testing.assert_allclose(released.joint_angles, released_to, atol=1e-6)
