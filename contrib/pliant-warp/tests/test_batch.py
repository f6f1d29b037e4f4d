"""Batches on the CPU device: the equilibria of the quasi-static engine, whatever is mixed."""

import numpy as np
import pytest
from pliant_warp.backend import MujocoWarp
from pliant_warp.batch import suits
from pliant_warp.config import MujocoWarpConfig

from pliant.errors import UserError
from pliant.interfaces.physics import Case
from pliant.records.rollout import Inputs
from pliant.testing.samples import PRESSURE_PA, linear_law, linear_spherical_law, sample_chain, softening_law
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

BAR_M = 1e-4
ENGINE = MujocoWarp(MujocoWarpConfig(device="cpu"))
REFERENCE = Quasistatic(QuasistaticConfig())


def drawn(count: int, modules: int, rng: np.random.Generator) -> list[Case]:
    """Return fingers of one length, each with its own pressure, payload, pull and end moment."""
    cases = []
    for k in range(count):
        law = softening_law() if k % 2 else linear_law()
        chain = sample_chain(law, modules=modules, payload=0.004 * rng.random())
        pull = 0.005 * rng.normal(size=3) * [1.0, 0.0, 1.0]
        pressure = {"pressure_pa": PRESSURE_PA * rng.random()}
        cases.append(Case(chain, Inputs(pressure, tip_force_n=pull, moment_n_m=0.001 * rng.random())))
    return cases


def test_many_chain_kinds_settle_where_the_quasi_static_engine_has_them() -> None:
    rng = np.random.default_rng(0)
    cases = [*drawn(24, 8, rng), *drawn(8, 3, rng)]
    cases.insert(
        5, Case(sample_chain(linear_spherical_law(), modules=2), Inputs({"pressure_pa": PRESSURE_PA}))
    )
    assert [suits(case) for case in cases].count(False) == 1
    found, wanted = ENGINE.settle_batch(cases), REFERENCE.settle_batch(cases)
    for got, there in zip(found, wanted, strict=True):
        assert got.converged and there.converged and got.stable
        assert np.abs(got.markers_m - there.markers_m).max() < BAR_M


def test_a_batch_that_is_given_up_says_so() -> None:
    hurried = MujocoWarp(MujocoWarpConfig(device="cpu", batch_steps=1, batch_tolerance=1e-12))
    (found,) = hurried.settle_batch(drawn(1, 8, np.random.default_rng(1)))
    assert not found.converged and found.residual > 1e-12


def test_a_device_that_is_not_there_is_refused() -> None:
    engine = MujocoWarp(MujocoWarpConfig(device="cuda:77"))
    with pytest.raises(UserError, match=r"'cuda:77'; this machine has .*cpu"):
        engine.settle_batch(drawn(1, 2, np.random.default_rng(2)))
