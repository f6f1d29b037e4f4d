"""Many chains at once: the answers of one after another."""

from __future__ import annotations

import numpy as np
from tests.physics.conftest import StudyLaw, finger
from tests.physics.random_designs import random_cases

from pliant.interfaces.physics import Case, PhysicsBackend
from pliant.records.rollout import Inputs
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig


def test_a_batch_is_one_after_another() -> None:
    """Also where some laws have no compiled form."""
    backend = Quasistatic(QuasistaticConfig())
    plain = Case(finger(StudyLaw()), Inputs({"pressure_pa": 9e3}))
    cases = [*random_cases(60, seed=5), plain]
    together = backend.settle_batch(cases)
    assert len(together) == len(cases)
    for one, other in zip(together, PhysicsBackend.settle_batch(backend, cases), strict=True):
        np.testing.assert_array_equal(one.joint_angles, other.joint_angles)
        np.testing.assert_array_equal(one.markers_m, other.markers_m)
        assert (one.converged, one.stable, one.residual, one.iterations, one.outside_domain) == (
            other.converged,
            other.stable,
            other.residual,
            other.iterations,
            other.outside_domain,
        )


def test_an_empty_batch() -> None:
    assert Quasistatic(QuasistaticConfig()).settle_batch([]) == ()
