"""MuJoCo's compiled motion: the same as step by step in Python, with and without law terms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.physics.scalar_laws import SCALAR

from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant.records.term import LawTerm
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.simulation import MujocoSimulation


def branch(
    angle: float, rate: float, dt_s: float, actuation: float, temperature_c: float, old: Any, new: Any, c: Any
) -> float:
    """A moment with memory, rate and temperature."""
    new[0] = 0.8 * old[0] + angle
    new[1] = max(old[1], angle)
    return float(-c[0] * rate - c[1] * old[0] * angle**2 + 1e-4 * (temperature_c - 22.0))


def factor(
    angle: float, rate: float, dt_s: float, actuation: float, temperature_c: float, old: Any, new: Any, c: Any
) -> float:
    """A factor that depends on angle and memory."""
    new[0] = old[0] + dt_s * abs(angle)
    return 1.0 + c[0] * angle * angle + 0.1 * old[0]


def shift(
    angle: float, rate: float, dt_s: float, actuation: float, temperature_c: float, old: Any, new: Any, c: Any
) -> float:
    """A resting place that follows the input."""
    return float(c[0] * actuation * angle)


TERMS = (
    LawTerm("moment", branch, (2e-3, 1e-3), n_states=2, needs_time=True),
    LawTerm("elastic", factor, (0.3,), n_states=1, needs_time=True),
    LawTerm("rest", shift, (1e-6,)),
    LawTerm("actuation", factor, (-0.2,), n_states=1, needs_time=True),
)


@pytest.mark.parametrize("terms", [(), TERMS])
@pytest.mark.parametrize("kind", SCALAR)
def test_compiled_motion_is_that_of_python(
    kind: str, terms: tuple[LawTerm, ...], finger_of: Callable[..., ChainModel]
) -> None:
    chain = finger_of(kind, 3).with_(laws=(SCALAR[kind](),), terms=terms)
    pushed = {"tip_force_n": np.array([0.01, 0.02, 0.005])}
    if kind != "prismatic":
        pushed["moment_n_m"] = 1e-3  # type: ignore[assignment]
    ends = []
    for compiled in (True, False):
        with MujocoSimulation(chain, MujocoConfig(timestep_s=0.004)) as simulation:
            assert simulation.engine.compiled is not None
            if not compiled:
                simulation.engine.compiled = None
            simulation.warm(31.0)
            for pressure, duration in ((9e3, 0.05), (4e3, 0.013), (12e3, 0.001)):
                simulation.apply(Inputs({"pressure_pa": pressure}, **pushed))  # type: ignore[arg-type]
                simulation.step(duration)
            ends.append(simulation.snapshot())
    one, other = ends
    assert np.abs(one.velocity).max() > 1e-4
    np.testing.assert_allclose(one.position, other.position, rtol=0, atol=1e-10)
    np.testing.assert_allclose(one.velocity, other.velocity, rtol=0, atol=1e-7)
    if terms:
        assert one.memory is not None and other.memory is not None and np.abs(one.memory).max() > 1e-3
        np.testing.assert_allclose(one.memory, other.memory, rtol=0, atol=1e-9)
