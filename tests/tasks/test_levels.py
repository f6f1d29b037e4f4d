"""Reasons why an equilibrium is not accepted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.compile_first import bent_chain

from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.tasks.levels import why_not_held


def test_a_joint_far_outside_its_law_is_named_with_the_laws_range() -> None:
    chain = bent_chain()
    with Quasistatic(QuasistaticConfig()).build(chain) as simulation:
        rest = simulation.settle()
    assert why_not_held(chain, rest) == ""
    low, high = chain.laws[0].domain.deformation[0]
    angles = rest.joint_angles.copy()
    angles[1] = high + 0.5 * (high - low)
    said = why_not_held(chain, replace(rest, joint_angles=angles))
    ends = " to ".join(f"{np.degrees(end):.3g}".replace("-", "−") for end in (low, high))
    assert said.startswith("is held by no data: joint 2 stands 50 % of its law's range outside")
    assert f"{ends}° about y" in said
