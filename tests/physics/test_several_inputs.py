"""Chains whose laws take several pressures at once, segment by segment: compiled efforts, and engines that agree."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from tests.mechanics.test_several_actuations import several_law

from pliant.config.chain import ChainConfig
from pliant.interfaces.physics import Case, settle_each
from pliant.mechanics.efforts import JointEfforts
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import Actuator, ChainModel
from pliant.records.rollout import Inputs
from pliant.registry.discovery import discover
from pliant_plugins.physics.compiled.efforts import efforts, law_potential
from pliant_plugins.physics.compiled.laws import CompiledLaws

ENGINES = ["quasistatic", "mujoco"]
ENGINES += ["pybullet"] if importlib.util.find_spec("pybullet") else []
AXES = ("x", "y", "z")


def arm() -> ChainModel:
    """Return two segments of two modules with three pressures each, one of them turned."""
    law, segments = several_law(3, AXES), []
    for number in range(2):
        own = tuple(Actuator(f"pressure_{3 * number + k}_pa") for k in (1, 2, 3))
        segments.append(Segment(rod_module(law, 0.02, 0.003), 2, 0.4 * number, actuators=own))
    return build_chain(ChainConfig(modules=2), segments)


def levels(chain: ChainModel) -> dict[str, float]:
    return {actuator.input: 2.5e3 * (k + 1) for k, actuator in enumerate(chain.actuators)}


def test_compiled_efforts_equal_the_laws_inside_and_outside_the_box() -> None:
    chain = arm()
    laws, statics = CompiledLaws.from_chain(chain), JointEfforts(chain)
    assert laws is not None
    q = np.random.default_rng(2).uniform(-0.5, 0.5, (4, 3))
    p = statics.values(levels(chain))
    tau, by_p, by_q = np.empty((4, 3)), np.empty((6, 4, 3)), np.empty((4, 3, 3))
    efforts(laws.arrays, q, p, tau, by_p, by_q)
    found = statics.evaluate(q, levels(chain))
    np.testing.assert_allclose(tau, found.tau, rtol=1e-11, atol=1e-15)
    np.testing.assert_allclose(by_q, found.dtau_du, rtol=1e-11, atol=1e-14)
    for k, actuator in enumerate(chain.actuators):
        np.testing.assert_allclose(by_p[k], found.dtau_dp[actuator.input], rtol=1e-10, atol=1e-18)
    inside = np.clip(q, -0.29, 0.29)
    energy = statics.potential(inside, levels(chain))
    assert law_potential(laws.arrays, inside, p) == pytest.approx(energy, rel=1e-10)


def test_engines_agree_on_every_segment() -> None:
    chain, registry, tips = arm(), discover(), {}
    for kind in ENGINES:
        component = registry.get("physics", kind)
        backend = component.build(component.config_model()(kind=kind))
        (found,) = settle_each(backend, [Case(chain, Inputs(levels(chain)))])
        assert found.converged
        tips[kind] = found.markers_m
    for kind in ENGINES[1:]:
        np.testing.assert_allclose(tips[kind], tips["quasistatic"], atol=1e-5)
