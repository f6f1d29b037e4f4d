"""`bimodulus`: two stiffnesses, one on either side of the straight joint."""

from __future__ import annotations

import numpy as np
import pytest
from tests.effects.bench import chain_with, followed

from pliant.records.chain import Actuator, ChainModel
from pliant.records.history import History
from pliant.testing.histories import HeldMotion, drive
from pliant.testing.samples import linear_law, sample_chain, softening_law
from pliant_plugins.effects.bimodulus import BimodulusConfig

K, GAIN, P = 0.04, 8e-7, 12e3


def two_sided(b: float, width: float = 1e-4, modules: int = 1, *actuators: Actuator) -> ChainModel:
    chain = sample_chain(linear_law(GAIN, K), modules=modules, gravity=(0, 0, 0))
    chain = chain.with_(actuators=actuators) if actuators else chain
    return chain_with(chain, "bimodulus", asymmetry=b, width_rad=width)


@pytest.mark.parametrize("modules", [1, 4])
def test_loads_with_both_signs_meet_two_stiffnesses(modules: int) -> None:
    """An opposing moment bends away from the actuation: K (1 − b) there, K (1 + b) on the other side."""
    loads = np.array([4e-3, -4e-3, 1e-2, -1e-2])
    run = History.from_arrays({"pressure_pa": 0.0}, moment_n_m=loads)
    (angles,) = followed(two_sided(0.25, modules=modules), run)
    wanted = -loads / (K * (1 - np.sign(loads) * 0.25))
    np.testing.assert_allclose(angles, np.tile(wanted[:, None], modules), rtol=1e-5)


def test_actuation_is_left_alone() -> None:
    chain, plain = two_sided(0.3, 0.02), two_sided(0.0)
    angle = np.linspace(-0.4, 0.4, 21)
    pressed, vented = (
        drive(chain, HeldMotion.from_angles(np.arange(21.0), angle, p)).effort for p in (P, 0.0)
    )
    wanted, none = (drive(plain, HeldMotion.from_angles(np.arange(21.0), angle, p)).effort for p in (P, 0.0))
    np.testing.assert_allclose(pressed - vented, wanted - none, atol=1e-15)
    np.testing.assert_allclose(vented, none * (1 + 0.3 * angle / np.hypot(angle, 0.02)), atol=1e-15)


def test_opposed_chambers_bend_farther_to_the_soft_side() -> None:
    """Two laws in parallel: 2 K (1 ± b) u = g (p₁ − p₂)."""
    pair = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0))
    inputs = {"pressure_1_pa": np.array([P, 0.0]), "pressure_2_pa": np.array([0.0, P])}
    (angles,) = followed(two_sided(0.2, 1e-4, 1, *pair), History.from_arrays(inputs))
    np.testing.assert_allclose(angles[:, 0], GAIN * P / (2 * K) * np.array([1 / 1.2, -1 / 0.8]), rtol=1e-5)


@pytest.mark.parametrize("b", BimodulusConfig.fit_parameters()[0].bounds)
@pytest.mark.parametrize("law", [linear_law(GAIN, K), softening_law()], ids=["linear", "softening"])
def test_a_joint_is_stable_up_to_the_bounds(b: float, law: object) -> None:
    chain = sample_chain(law, modules=1)  # type: ignore[arg-type]
    chain = chain_with(chain, "bimodulus", asymmetry=b)
    angle = np.linspace(-0.6, 0.6, 601)
    assert drive(chain, HeldMotion.from_angles(np.arange(601.0), angle)).slope.max() < 0.0
