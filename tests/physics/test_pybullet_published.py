"""The published formulation as a preset: its differences, and that the other presets do not use it."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, field

import numpy as np
import pytest
from tests.physics.conftest import settle

from pliant.errors import UserError
from pliant.interfaces.simulation import SimulationState
from pliant.records.design import Array
from pliant.records.law import Effort
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, Scene
from pliant.records.term import LawTerm
from pliant.testing.samples import (
    PRESSURE_PA,
    LinearLaw,
    dashpot,
    linear_spherical_law,
    sample_chain,
    sample_finger,
    softening_law,
)
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("pybullet") is None,
    reason="pybullet is not installed (it has wheels for Python up to 3.11 only)",
)
PUBLISHED = Pybullet(PybulletConfig(preset="published"))
PLIANT = Pybullet(PybulletConfig())
PRESSED = Inputs({"pressure_pa": PRESSURE_PA})


@dataclass(frozen=True, eq=False)
class CountingLaw(LinearLaw):
    """A law that records how many joints each call evaluates."""

    calls: list[int] = field(default_factory=list)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        self.calls.append(len(deformation))
        return super().evaluate(actuation, deformation)


def test_steps_are_fixed_and_the_law_is_called_for_every_joint_and_axis_at_each() -> None:
    """Also where an explicit step of 1/2400 s cannot resolve the stiffness."""
    plain = linear_spherical_law()
    soft = CountingLaw(plain.gain, plain.stiffness, plain.domain, plain.joint, plain.axes)
    stiff = CountingLaw(np.array([8e-7]), np.array([[40.0]]), softening_law().domain)
    for law, modules, steps, each in ((soft, 4, 5, 4 * 3), (stiff, 1, 24, 1)):
        with PUBLISHED.build(sample_chain(law, modules=modules)) as simulation:
            simulation.apply(PRESSED)
            law.calls.clear()
            simulation.step(steps / 2400)
        assert law.calls == [1] * (steps * each)


def test_friction_motors_hold_a_small_effort() -> None:
    """Efforts below the motors' 1e-4 N·m do not move a joint; `settle` switches the motors off and on again."""
    chain = sample_chain(softening_law(), modules=1, gravity=(0, 0, 0))
    held, free = 0.8e-4 / 1.637e-6, 4e-4 / 1.637e-6
    for _ in range(2):
        with PUBLISHED.build(chain) as simulation:
            simulation.apply(Inputs({"pressure_pa": held}))
            simulation.step(0.2)
            assert np.abs(simulation.snapshot().position).max() < 1e-6
            simulation.apply(Inputs({"pressure_pa": free}))
            simulation.step(0.05)
            assert simulation.snapshot().position[0, 0] > 1e-3
            simulation.apply(Inputs({"pressure_pa": held}))
            wanted = simulation.settle()
            assert wanted.converged and wanted.joint_angles[0, 0] > 1e-3
            simulation.apply(Inputs({"pressure_pa": 0.0}))
            simulation.step(0.1)
            stuck = simulation.snapshot().position[0, 0]
            assert stuck == pytest.approx(wanted.joint_angles[0, 0], abs=1e-5)


def test_efforts_are_applied_naively() -> None:
    """Bent out of plane, the published chain leaves the equilibrium of its laws."""
    law = linear_spherical_law()
    chain = sample_finger(law=law, modules=6, base={"direction": [1, 0, 0]})
    inputs = Inputs({"pressure_pa": 3 * PRESSURE_PA}, tip_force_n=np.array([0.0, 0.3, -0.2]))
    wanted = settle(Quasistatic(QuasistaticConfig()), chain, inputs)
    at_rest = SimulationState(0.0, wanted.joint_angles, np.zeros_like(wanted.joint_angles))
    away = {}
    for preset, engine in (("published", PUBLISHED), ("pliant", PLIANT)):
        with engine.build(chain) as simulation:
            simulation.restore(at_rest)
            simulation.apply(inputs)
            simulation.step(0.1)
            away[preset] = np.linalg.norm(simulation.markers()[-1] - wanted.tip_m)
    assert away["pliant"] < 1e-6
    assert away["published"] > 5e-4


def test_what_it_does_not_know_is_refused() -> None:
    with pytest.raises(UserError, match="baseline for single chains"):
        PUBLISHED.build_scene(Scene((Arm(sample_finger()),)))
    assert "found as without it" in (PUBLISHED.preparing(sample_finger(), histories=False) or "")
    assert PLIANT.preparing(sample_finger(), histories=False) is None
    term = LawTerm("moment", dashpot, (0.1,))
    with pytest.raises(UserError, match="does not support effects"):
        PUBLISHED.build(sample_chain(modules=1).with_(terms=(term,)))
