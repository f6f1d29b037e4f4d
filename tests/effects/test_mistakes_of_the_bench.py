"""Mistakes of the record as effects: the history that reaches the chain for a recorded one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.effects.bench import REGISTRY, effect, model_with

from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.testing.samples import sample_chain

TIME_S = np.arange(0.0, 20.0, 0.5)
PRESSURE = 1e3 * TIME_S
CHAIN = sample_chain(modules=2, payload=0.02)


def reached(kind: str, history: History, chain: ChainModel = CHAIN, **values: Any) -> History:
    """Return the history that reaches the chain with this effect."""
    return model_with(chain, kind, **values).commanded(history)


def payload_history(payload_kg: Any) -> History:
    return History.from_arrays({"pressure_pa": PRESSURE}, TIME_S, payload_kg=payload_kg)


def test_a_factor_scales_every_stated_payload_and_leaves_none_alone() -> None:
    np.testing.assert_allclose(
        reached("payload_error", payload_history(0.013), factor=1.5).payload_kg, 0.0195
    )
    np.testing.assert_array_equal(reached("payload_error", payload_history(0.0), factor=1.5).payload_kg, 0.0)


def test_the_chains_own_payload_is_stated_too() -> None:
    np.testing.assert_allclose(reached("payload_error", payload_history(None), factor=0.5).payload_kg, 0.01)
    bare = CHAIN.with_(payload_kg=0.0)
    assert reached("payload_error", payload_history(None), bare, factor=0.5).payload_kg is None


@pytest.mark.parametrize("stated_kg", [0.005, 0.01, 0.05])
def test_a_hook_adds_the_same_mass_to_every_payload(stated_kg: float) -> None:
    """At c = 1 the mass is (f − 1) times the chain's own 20 g."""
    found = reached("payload_error", payload_history(stated_kg), factor=1.2, constant=1.0)
    np.testing.assert_allclose(found.payload_kg, stated_kg + 0.2 * 0.02)


def test_the_heaviest_payload_may_be_the_one_that_is_wrong() -> None:
    """At c = −3 the error grows with the fourth power of the payload."""
    off = [
        reached("payload_error", payload_history(kg), factor=1.2, constant=-3.0).payload_kg[0] - kg
        for kg in (0.01, 0.02)
    ]
    np.testing.assert_allclose(off, [0.2 * 0.01 / 8, 0.2 * 0.02])


def test_a_gravity_that_was_left_out_is_added_along_the_world() -> None:
    lying = CHAIN.with_(gravity_m_s2=np.zeros(3))
    corrected = model_with(lying, "gravity_error", x_m_s2=3.0, z_m_s2=-9.34).chain
    np.testing.assert_allclose(corrected.gravity_m_s2, [3.0, 0.0, -9.34])


def test_loads_at_the_tip_are_scaled_and_payloads_are_not() -> None:
    history = History.from_arrays(
        {"pressure_pa": PRESSURE}, TIME_S, moment_n_m=2e-3, tip_force_n=[0.0, 0.1, 0.2], payload_kg=0.01
    )
    found = reached("load_error", history, factor=1.3)
    np.testing.assert_allclose(found.moment_n_m, 2.6e-3)
    np.testing.assert_allclose(found.tip_force_n[0], [0.0, 0.13, 0.26])
    np.testing.assert_array_equal(found.payload_kg, 0.01)


@pytest.mark.parametrize("late_s", [-0.7, 0.3])
def test_a_clock_shifts_inputs_and_loads_and_the_ends_hold_on(late_s: float) -> None:
    moment = np.where(TIME_S > 10.0, 1e-3, 0.0)
    history = History.from_arrays({"pressure_pa": PRESSURE}, TIME_S, moment_n_m=moment)
    found = reached("clock_offset", history, late_s=late_s)
    wanted = np.clip(TIME_S - late_s, TIME_S[0], TIME_S[-1])
    np.testing.assert_allclose(found.actuation["pressure_pa"], 1e3 * wanted)
    np.testing.assert_allclose(found.moment_n_m, np.interp(wanted, TIME_S, moment))
    np.testing.assert_array_equal(found.time_s, TIME_S)


def test_a_drift_is_none_at_first_and_grows_along_the_run() -> None:
    history = History.from_arrays({"pressure_pa": PRESSURE}, 100.0 + TIME_S)
    found = reached("clock_drift", history, rate=0.01)
    np.testing.assert_allclose(PRESSURE - found.actuation["pressure_pa"], 1e3 * 0.01 * TIME_S, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "values"), [("clock_offset", {"late_s": 1.0}), ("clock_drift", {"rate": 0.1})]
)
def test_without_a_clock_there_is_none_to_be_wrong(kind: str, values: dict[str, float]) -> None:
    history = History.from_arrays({"pressure_pa": PRESSURE})
    np.testing.assert_array_equal(reached(kind, history, **values).actuation["pressure_pa"], PRESSURE)


@pytest.mark.parametrize(
    ("kind", "history", "chain", "says"),
    [
        ("payload_error", payload_history(None), CHAIN.with_(payload_kg=0.0), "no run states a payload"),
        ("payload_error", payload_history(0.01), CHAIN.with_(gravity_m_s2=np.zeros(3)), "no gravity"),
        ("payload_error", payload_history(None), CHAIN, ""),
        ("gravity_error", payload_history(None), CHAIN, "the gravity of a level bench"),
        ("gravity_error", payload_history(None), CHAIN.with_(gravity_m_s2=np.zeros(3)), ""),
        ("load_error", payload_history(0.01), CHAIN, "no run has a moment or a force"),
        ("clock_offset", History.from_arrays({"pressure_pa": PRESSURE}), CHAIN, "no run has a clock"),
        ("clock_drift", History.from_arrays({"pressure_pa": 5e3}, TIME_S), CHAIN, "no input moves"),
        ("clock_drift", payload_history(None), CHAIN, ""),
    ],
)
def test_recordings_that_cannot_have_a_mistake_are_said(
    kind: str, history: History, chain: ChainModel, says: str
) -> None:
    smallest = REGISTRY.get("effect", kind).smallest_block()
    reason = effect(kind, **smallest).unsuited(chain, [history])
    assert says in reason and bool(says) == bool(reason)
