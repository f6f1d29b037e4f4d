"""Expected log Bayes factors against closed forms, on linear hypotheses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pliant.diagnosis.next_run import Contender, expected

NO_SLOPES, NO_KNOBS = np.zeros((40, 0)), np.zeros((0, 0))


def fixed(mean: np.ndarray, probability: float = 0.5, form: float = 0.0) -> Contender:
    """Return a hypothesis without parameters."""
    return Contender(probability, mean, np.zeros((len(mean), 0)), NO_KNOBS, form)


def test_two_fixed_means_differ_by_half_their_squared_distance() -> None:
    apart = np.linspace(0.0, 1.0, 40)
    found = expected([fixed(np.zeros(40)), fixed(apart)], 1.0, 0.9)
    distance = 0.5 * float(apart @ apart)
    assert found.factors[0, 1] == pytest.approx(distance)
    assert found.factors[1, 0] == pytest.approx(distance)
    assert found.factors[0, 0] == found.factors[1, 1] == pytest.approx(0.0, abs=1e-12)


def test_the_probability_for_a_right_verdict_is_that_for_a_normal_deviate() -> None:
    """For even odds and means 2 d apart ln odds ~ N(2 d², 4 d²), and a verdict requires ln 9."""
    d = 1.5
    mean = np.zeros(40)
    mean[3] = 2 * d
    found = expected([fixed(np.zeros(40)), fixed(mean)], 1.0, 0.9)
    right = 0.5 * math.erfc((math.log(9.0) - 2 * d * d) / (2 * d) / math.sqrt(2.0))
    wrong = 0.5 * math.erfc((math.log(9.0) + 2 * d * d) / (2 * d) / math.sqrt(2.0))
    assert found.right == pytest.approx(right, abs=0.04)
    assert found.wrong == pytest.approx(wrong, abs=0.02)
    assert 0.0 < found.information < math.log(2.0)


def test_what_a_parameter_can_imitate_does_not_tell() -> None:
    """A difference along the direction that b can bend in counts only by the old data's information on it."""
    along, across = np.zeros(40), np.zeros(40)
    along[0], across[1] = 3.0, 3.0
    slope = np.zeros((40, 1))
    slope[0, 0] = 1.0

    def factor(mean: np.ndarray, known: float) -> float:
        bent = Contender(0.5, np.zeros(40), slope, np.array([[known]]))
        return float(expected([fixed(mean), bent], 1.0, 0.9).factors[0, 1])

    for known in (1e-4, 1.0, 1e6):
        spread = 1.0 + 1.0 / known
        mismatch = 0.5 * (1.0 / spread - 1.0 + math.log(spread))  # the width that a does not have
        assert factor(along, known) == pytest.approx(mismatch + 0.5 * 9.0 / spread)
        assert factor(across, known) == pytest.approx(mismatch + 0.5 * 9.0)


def test_the_separating_run_in_a_linear_toy_is_known() -> None:
    """y = θ u against y = θ u + ψ u²: the more curved input separates; one that repeats the old line does not."""
    old, straight, curved = np.linspace(0, 1, 20), np.linspace(0, 1, 20), np.linspace(0, 3, 20)
    psi = 0.8

    def told(drive: np.ndarray) -> float:
        plain = Contender(0.5, drive, drive[:, None], np.array([[old @ old]]))
        design = np.column_stack([drive, drive**2])
        was = np.column_stack([old, old**2])
        # the rival's line fits the old data as well as possible, with its curvature known to be psi
        tilt = -psi * (old @ old**2) / (old @ old)
        rival = Contender(0.5, drive * (1 + tilt) + psi * drive**2, design, was.T @ was)
        return expected([plain, rival], 1.0, 0.9).information

    assert told(curved) > 5 * told(straight)


def test_a_law_that_may_be_off_makes_readings_worth_less_and_tempering_slows() -> None:
    apart = np.full(40, 0.8)
    sharp = expected([fixed(np.zeros(40)), fixed(apart)], 1.0, 0.9)
    off = expected([fixed(np.zeros(40), form=3.0), fixed(apart, form=3.0)], 1.0, 0.9)
    assert off.factors[0, 1] == pytest.approx(sharp.factors[0, 1] / 4.0)
    slow = expected([fixed(np.zeros(40)), fixed(apart)], 4.0, 0.9)
    assert slow.right < sharp.right
    assert slow.information < sharp.information


def test_a_certain_belief_has_nothing_to_learn() -> None:
    found = expected([fixed(np.zeros(40), 1.0), fixed(np.ones(40), 1e-12)], 2.0, 0.9)
    assert found.right == pytest.approx(1.0)
    assert found.information == pytest.approx(0.0, abs=1e-6)
