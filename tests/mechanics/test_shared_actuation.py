"""A law behind a share of the actuation is τ(s p, u), in numpy and in the scalar form of every shipped law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.surrogates.laws import STATED, WAVY, energy_law, network_law, one_by_one
from tests.surrogates.test_drawn_laws import with_bar

from pliant.config.chain import ChainConfig
from pliant.mechanics.law_draws import draws
from pliant.mechanics.shared_actuation import SharedActuation
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.pipeline.simulate import drawn_chains
from pliant.records.law import JointLaw
from pliant.testing.samples import sample_table, softening_law
from pliant_plugins.surrogates.config import TableConfig
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.table.surrogate import TableSurrogate

SHARES = (0.6, 1.7)


def shipped() -> dict[str, JointLaw]:
    """Return a law of each scalar form, with and without limits."""
    polynomials = {"wavy": WAVY, **{name: STATED[name] for name in ("unbounded", "plain square")}}
    table = TableSurrogate(TableConfig(kind="table")).fit(sample_table(softening_law())).law
    return {
        **polynomials,
        "axes": AxesLaw((WAVY, STATED["unbounded"], replace(WAVY, odd=0.0))),
        "energy": with_bar(energy_law(3)),
        "neural": network_law(3),
        "table": table,
    }


NAMES = ("wavy", "unbounded", "plain square", "axes", "energy", "neural", "table")


def states(law: JointLaw) -> tuple[np.ndarray, np.ndarray]:
    """Return states inside the box of a shared law and around it."""
    random = np.random.default_rng(3)
    return random.uniform(-5e3, 30e3, 80), random.uniform(-0.6, 0.9, (80, len(law.axes)))


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("name", NAMES)
def test_the_scalar_form_is_the_law_at_the_share(name: str, share: float) -> None:
    law = shipped()[name]
    p, u = states(law)
    wanted, found = law.evaluate(share * p, u), one_by_one(SharedActuation(law, share), p, u)
    for part, gain in (("tau", 1.0), ("dtau_dp", share), ("dtau_du", 1.0)):
        values = gain * getattr(wanted, part)
        np.testing.assert_allclose(
            getattr(found, part), values, rtol=1e-9, atol=1e-11 * np.abs(values).max(), err_msg=part
        )
    own, inside = SharedActuation(law, share).scalar(), law.scalar()
    assert own is not None and inside is not None and own.function is inside.function


@pytest.mark.parametrize("name", NAMES)
def test_slopes_match_the_effort_and_the_effort_the_energy(name: str) -> None:
    law = SharedActuation(shipped()[name], 0.6)
    p = np.linspace(1e3, 20e3, 15)
    u = np.random.default_rng(4).uniform(-0.15, 0.35, (15, len(law.axes)))
    effort = law.evaluate(p, u)
    in_p = (law.evaluate(p + 1, u).tau - law.evaluate(p - 1, u).tau) / 2
    np.testing.assert_allclose(effort.dtau_dp, in_p, rtol=1e-5, atol=1e-11)
    for k in range(len(law.axes)):
        h = 1e-5 * np.eye(len(law.axes))[k]
        fall = -(law.potential(p, u + h) - law.potential(p, u - h)) / 2e-5
        np.testing.assert_allclose(effort.tau[:, k], fall, rtol=1e-5, atol=1e-8)


def test_domain_and_error_are_told_in_the_chains_actuation() -> None:
    inside = with_bar(WAVY)
    law = SharedActuation(inside, 0.5)
    np.testing.assert_allclose(law.domain.actuation, 2 * inside.domain.actuation)
    p, u = np.array([4e3, 20e3]), np.array([[0.1], [0.5]])
    wanted = inside.band(p / 2, u)
    assert wanted is not None and law.error is not None
    np.testing.assert_allclose(np.asarray(law.band(p, u)), wanted)
    np.testing.assert_allclose(law.error.half_width(p, u), wanted)


def test_draws_equal_the_law_inside() -> None:
    inside = with_bar(WAVY)
    p, u = np.array([4e3, 20e3]), np.array([[0.1], [0.5]])
    for found, wanted in zip(draws(SharedActuation(inside, 0.5), 3, 7), draws(inside, 3, 7), strict=True):
        np.testing.assert_allclose(found.evaluate(p, u).tau, wanted.evaluate(p / 2, u).tau)
        assert found.scalar() is not None


def test_segments_with_one_law_share_its_drawn_error() -> None:
    module = rod_module(with_bar(WAVY), 0.01, 0.002)
    config = ChainConfig.model_validate(
        {"segments": [{"modules": 1}, {"modules": 1, "actuation_share": 0.5}]}
    )
    chain = build_chain(config, [Segment(module, 1), Segment(module, 1, 0.0, 0.5)])
    p, u = np.array([4e3, 12e3]), np.array([[0.1], [0.5]])
    for drawn in drawn_chains(chain, 3, 7):
        plain, half = drawn.laws
        np.testing.assert_allclose(half.evaluate(2 * p, u).tau, plain.evaluate(p, u).tau)
        assert np.abs(plain.evaluate(p, u).tau - chain.laws[0].evaluate(p, u).tau).max() > 1e-6


def test_a_law_without_scalar_form_has_none_behind_a_share() -> None:
    assert SharedActuation(softening_law(), 0.5).scalar() is None
