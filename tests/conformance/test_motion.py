"""The checks of motion pass for a correct engine, and are skipped for one that declares no motion."""

from __future__ import annotations

import pytest
from tests.conformance import broken
from tests.conformance.broken.physics_motion import GOOD

from pliant.testing import CheckSkipped, Subject, checks_for

MOTION = {"swings_with_its_period", "gains_no_energy", "damps_as_the_law_says"}


@pytest.mark.parametrize("name", sorted(MOTION | {"dynamic_is_what_it_says"}))
def test_a_right_engine_passes(name: str) -> None:
    {c.name: c for c in checks_for("physics")}[name].run(Subject(GOOD))


@pytest.mark.parametrize("name", sorted(MOTION))
def test_a_static_engine_is_not_asked(name: str) -> None:
    with pytest.raises(CheckSkipped):
        {c.name: c for c in checks_for("physics")}[name].run(Subject(broken.good("physics")))
