"""The error of a law at the tip: closed form of one hinge, failures counted, wrong input."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from tests.law_errors import require_errors_as_the_bar

from pliant.config.noise import UncertaintyConfig
from pliant.errors import UserError
from pliant.pipeline.simulate import drawn_chains, spread
from pliant.records.law import Domain
from pliant.records.rollout import Equilibrium, Inputs, TaskResult
from pliant.testing.samples import LinearLaw, barred_law, linear_law, sample_chain
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.2, 0.6]]))
ERROR_N_M = 2e-4


def barred() -> LinearLaw:
    return barred_law(linear_law(), BOX, ERROR_N_M)


def test_one_hinge_turns_by_the_error_over_its_stiffness() -> None:
    law = barred()
    chain = sample_chain(law, modules=1, gravity=(0, 0, 0))
    drawn = drawn_chains(chain, 2000, seed=4)
    many = drawn_chains(sample_chain(law, modules=5), 1, seed=0)[0]
    assert len(many.laws) == 1 and {joint.law for joint in many.joints} == {0}, (
        "a design's modules share one draw"
    )
    backend = Quasistatic(QuasistaticConfig())
    turns = []
    for one in drawn[:6]:
        with backend.build(one) as simulation:
            simulation.apply(Inputs({"pressure_pa": 1e4}))
            turns.append(simulation.settle().joint_angles[0, 0])
    at_rest = np.array([[0.2]])  # g p / k of the linear law at 10 kPa
    there = [one.laws[0].evaluate(np.array([1e4]), at_rest) for one in drawn[:6]]
    wanted = [effort.tau[0, 0] / -effort.dtau_du[0, 0, 0] for effort in there]
    assert np.array(turns) - 0.2 == pytest.approx(wanted, rel=0.05, abs=2e-5)
    require_errors_as_the_bar(law, [one.laws[0] for one in drawn])


def test_stated_laws_have_no_error_to_carry() -> None:
    with pytest.raises(UserError, match="'uncertainty' needs a law with an error bar"):
        drawn_chains(sample_chain(linear_law()), 3, seed=0)


def result(x: float, converged: bool = True, **metrics: object) -> TaskResult:
    markers = np.array([[0.0, 0, 0], [x, 0, 0]])
    final = Equilibrium(np.zeros((1, 1)), markers, 0.0, converged, True, 1, 0.0)
    return TaskResult(final, metrics)


def test_intervals_hold_their_share_and_failures_are_counted() -> None:
    results = [result(x, height_m=2 * x, mode="slip") for x in np.linspace(0, 1, 101)]
    none = spread([result(0.0, converged=False)] * 3, 0.9)
    assert none["failed"] == 3 and "tip_radius_m" not in none
    told = spread([*results, result(9.0, converged=False, height_m=0.0)], 0.8)
    assert told["failed"] == 1 and told["samples"] == 102
    assert told["tip_low_m"][0] == pytest.approx(0.1) and told["tip_high_m"][0] == pytest.approx(0.9)
    assert told["tip_radius_m"] == pytest.approx(0.4)
    assert told["metrics"]["height_m"]["high"] == pytest.approx(1.8)
    assert "mode" not in told["metrics"]


@pytest.mark.parametrize("wrong", [{"samples": 2}, {"level": "150 %"}, {"sample": 9}])
def test_wrong_settings_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        UncertaintyConfig.model_validate(wrong)


@pytest.mark.parametrize(("level", "least"), [(0.95, 18), (0.99, 98)])
def test_a_level_needs_samples_enough_to_see_it(level: float, least: int) -> None:
    assert UncertaintyConfig(level=level, samples=least).samples == least
    with pytest.raises(ValidationError, match=f"needs at least {least} samples, and there are {least - 1}"):
        UncertaintyConfig(level=level, samples=least - 1)
