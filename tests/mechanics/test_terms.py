"""Law terms in plain Python, poses over time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pliant.errors import ContractError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import ChainGeometry, base_rotations, trajectory
from pliant.mechanics.rotations import exp_map
from pliant.mechanics.terms import LawTerms, TermMemory
from pliant.records.chain import ChainModel
from pliant.records.term import LawTerm
from pliant.testing.samples import linear_prismatic_law, linear_spherical_law, sample_chain, softening_law


def constant(angle, rate, dt, p, t, old, new, c):
    return c[0]


def bent(angle, rate, dt, p, t, old, new, c):
    return c[0] * angle * angle


def dashpot(angle, rate, dt, p, t, old, new, c):
    return -c[0] * rate


def counter(angle, rate, dt, p, t, old, new, c):
    new[0] = old[0] + 1.0
    new[1] = max(old[1], angle)
    return 0.0


def chain_with(*terms: LawTerm) -> ChainModel:
    return sample_chain(modules=2).with_(terms=terms)


def effort(chain: ChainModel, q: np.ndarray, p: float, memory: TermMemory | None = None) -> np.ndarray:
    return JointEfforts(chain).evaluate(q, {"pressure_pa": p}, memory).tau


def test_the_effort_with_terms_is_the_formula_in_the_record() -> None:
    """τ' = Π f_e E(u − Σ rest) + Π f_a A(p, u) + Σ M."""
    terms = [
        LawTerm("moment", constant, (0.002,)),
        LawTerm("elastic", constant, (1.3,)),
        LawTerm("elastic", constant, (0.7,)),
        LawTerm("actuation", constant, (0.9,)),
        LawTerm("rest", constant, (0.05,)),
        LawTerm("rest", constant, (-0.02,)),
    ]
    law, q, p = softening_law(), np.array([[0.2], [-0.1]]), 9e3
    zero = np.zeros(2)
    elastic = law.evaluate(zero, q - 0.03).tau
    actuated = law.evaluate(zero + p, q).tau - law.evaluate(zero, q).tau
    wanted = 1.3 * 0.7 * elastic + 0.9 * actuated + 0.002
    np.testing.assert_allclose(effort(chain_with(*terms), q, p), wanted, rtol=1e-12)


@pytest.mark.parametrize("role", ["moment", "elastic", "actuation", "rest"])
def test_slopes_match_the_effort(role: str) -> None:
    chain = chain_with(LawTerm(role, bent, (0.4,)))
    q, h = np.array([[0.25], [0.1]]), 1e-5
    slope = JointEfforts(chain).evaluate(q, {"pressure_pa": 9e3}).dtau_du[:, 0, 0]
    wanted = (effort(chain, q + h, 9e3) - effort(chain, q - h, 9e3))[:, 0] / (2 * h)
    np.testing.assert_allclose(slope, wanted, rtol=1e-5)


def test_a_rate_needs_a_finite_step() -> None:
    terms = LawTerms([LawTerm("moment", dashpot, (2.0,), needs_time=True)], (1, 1))
    q = np.array([[0.3]])
    for dt, wanted in ((0.1, -6.0), (math.inf, 0.0), (0.0, 0.0)):
        got = terms.contribution(q, 0.0, terms.rested().over(dt)).moment
        assert got == pytest.approx(wanted)


def test_memory_is_kept_per_joint_and_the_old_one_is_left_alone() -> None:
    terms = LawTerms(
        [LawTerm("moment", constant, (1.0,)), LawTerm("moment", counter, (), n_states=2)], (2, 1)
    )
    first = terms.rested()
    second = terms.advance(np.array([[0.2], [0.4]]), 0.0, first)
    third = terms.advance(np.array([[0.1], [0.5]]), 0.0, second)
    assert not first.states.any()
    np.testing.assert_array_equal(third.states[:, 0], [[2.0, 0.2], [2.0, 0.5]])
    np.testing.assert_array_equal(third.previous, [[0.1], [0.5]])


def test_no_terms_are_the_plain_law() -> None:
    q = np.array([[0.2], [0.1]])
    np.testing.assert_array_equal(
        effort(chain_with(), q, 5e3), softening_law().evaluate(np.full(2, 5e3), q).tau
    )


@pytest.mark.parametrize("law", [softening_law(), linear_spherical_law(), linear_prismatic_law()])
def test_a_trajectory_is_the_markers_in_each_sample(law) -> None:
    chain = sample_chain(law, modules=3, turns_rad=(0.0, 0.8))
    geometry = ChainGeometry.from_chain(chain)
    rng = np.random.default_rng(1)
    scale = 0.002 if law.joint == "prismatic" else 0.4
    q = scale * rng.normal(size=(5, 6, len(law.axes)))
    turns = base_rotations(chain.base_rotation, rng.normal(size=(5, 3)))
    markers = trajectory(geometry, q, turns)
    for k in range(5):
        there = ChainGeometry.from_chain(chain.with_(base_rotation=turns[k])).markers(q[k])
        np.testing.assert_allclose(markers[k], there, atol=1e-14)


def test_base_angles_turn_about_world_x_then_y_then_z() -> None:
    rotation = exp_map(np.array([0.3, -0.2, 0.5]))
    angles = np.array([[0.4, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, -1.1], [0.4, 0.7, -1.1], [0.0, 0.0, 0.0]])
    got = base_rotations(rotation, angles)

    def about(axis: int, angle: float) -> np.ndarray:
        return exp_map(angle * np.eye(3)[axis])

    for one, (x, y, z) in zip(got, angles, strict=True):
        np.testing.assert_allclose(one, about(2, z) @ about(1, y) @ about(0, x) @ rotation, atol=1e-14)
    np.testing.assert_array_equal(base_rotations(rotation, np.zeros((2, 3)))[1], rotation)


def test_numbers_per_joint_reach_their_joint() -> None:
    def pull(angle, rate, dt_s, actuation, temperature_c, old, new, parameters):
        return parameters[0] * parameters[1]

    term = LawTerm("moment", pull, (2.0,), per_joint=((1.0,), (10.0,)))
    terms = LawTerms([term], (2, 1))
    values = terms.contribution(np.zeros((2, 1)), 0.0, terms.rested())
    assert values.moment[:, 0].tolist() == [2.0, 20.0]
    with pytest.raises(ContractError, match="2 joints"):
        LawTerms([term], (3, 1))
