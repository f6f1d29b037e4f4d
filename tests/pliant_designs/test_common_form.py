"""Laws of many designs in one form: its error, the information in states, stability, records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.records.fem import TRUSTED
from pliant.records.law import JointLaw
from pliant_designs.meta_models.common_form import CommonForm
from pliant_designs.meta_models.common_form_fit import fit_common_form
from pliant_designs.meta_models.common_form_scales import ParameterMap, turned
from pliant_designs.meta_models.common_form_stable import StabilityGrid
from pliant_designs.records import SolvedDesigns
from pliant_designs.samples import (
    sample_law,
    solved_designs,
    solved_spherical_designs,
    spherical_sample_law,
    unseen_designs,
)


@pytest.fixture(scope="module")
def one_axis() -> tuple[SolvedDesigns, CommonForm, np.ndarray]:
    designs = solved_designs()
    return designs, *fit_common_form(designs)


@pytest.fixture(scope="module")
def three_axes() -> tuple[SolvedDesigns, CommonForm, np.ndarray]:
    designs = solved_spherical_designs((3, 3))
    return designs, *fit_common_form(designs)


def _largest_relative_error(law: JointLaw, truth: JointLaw) -> float:
    random = np.random.default_rng(3)
    low, high = truth.domain.deformation.T
    u = low + (high - low) * random.random((60, len(low)))
    p = 15e3 * random.random(60)
    wanted = truth.evaluate(p, u).tau
    return float(np.max(np.abs(law.evaluate(p, u).tau - wanted) / np.ptp(wanted, axis=0)))


def test_polynomial_laws_are_recovered(one_axis) -> None:
    """The sample's laws are polynomials in p and u, so one form represents them all."""
    designs, form, targets = one_axis
    for values, own in zip(designs.values, targets, strict=True):
        assert _largest_relative_error(form.law(values, own), sample_law(values)) < 1e-3


def test_three_coupled_axes_are_recovered(three_axes) -> None:
    designs, form, targets = three_axes
    for values, own in zip(designs.values, targets, strict=True):
        assert _largest_relative_error(form.law(values, own), spherical_sample_law(values)) < 5e-3


def test_a_mirror_plane_is_found_in_the_data(one_axis, three_axes) -> None:
    assert three_axes[1].details["even"]
    assert np.all(three_axes[1].exponents[:, [1, 3]].sum(axis=1) % 2 == 0)
    assert not one_axis[1].details["even"]


def test_a_target_moves_the_effort_by_its_size(one_axis) -> None:
    """|Δz| is the mean effort's change as a share of its mean size, up to the slopes' share of the equations."""
    designs, form, _ = one_axis
    values, zero = designs.values[5], np.zeros(len(form.names))
    data = designs.data[5]
    at = (data.actuation, data.deformation)
    step = 0.01 * np.eye(len(zero))[0]
    moved = form.law(values, step).evaluate(*at).tau - form.law(values, zero).evaluate(*at).tau
    share = np.sqrt(np.mean(moved**2)) / form.effort(values[None])[0]
    assert 0.003 < share < 0.03


def test_a_design_with_few_states_follows_the_others(one_axis) -> None:
    """One design keeps only five states: the population determines what they leave open."""
    designs, _, _ = one_axis
    number = 5
    data = designs.data[number]
    status = np.where(np.arange(len(data)) % 4 == 0, data.status, "self_contact")
    poor = replace(data, status=status)
    rest = [poor if i == number else one for i, one in enumerate(designs.data)]
    form, targets = fit_common_form(replace(designs, data=tuple(rest)))
    law = form.law(designs.values[number], targets[number])
    assert _largest_relative_error(law, sample_law(designs.values[number])) < 0.02


def test_data_without_slopes_are_enough() -> None:
    designs = solved_designs((3, 3))
    bare = [
        replace(one, dtau_dp=np.full_like(one.dtau_dp, np.nan), dtau_du=np.full_like(one.dtau_du, np.nan))
        for one in designs.data
    ]
    form, targets = fit_common_form(replace(designs, data=tuple(bare)))
    law = form.law(designs.values[4], targets[4])
    assert _largest_relative_error(law, sample_law(designs.values[4])) < 5e-3


def test_laws_from_any_targets_are_stable(one_axis, three_axes) -> None:
    """For targets far from all solved ones the law is moved until ∂τ/∂u is negative definite in its box."""
    random = np.random.default_rng(0)
    moved = 0
    for _, form, targets in (one_axis, three_axes):
        for values in unseen_designs(4):
            wild = 6 * form.spread * random.standard_normal(targets.shape[1])
            law = form.law(values, wild)
            low, high = law.domain.deformation.T
            u = low + (high - low) * random.random((300, len(low)))
            slopes = law.evaluate(15e3 * random.random(300), u).dtau_du
            assert np.linalg.eigvalsh((slopes + np.swapaxes(slopes, 1, 2)) / 2).max() < 0
            place = form.parameters(values[None])
            moved += bool(np.any(form._stable(place[0], wild, form._box(place)) != wild))
    assert moved > 0


def test_the_nearest_stable_coefficients_are_the_projection() -> None:
    """One axis, two terms: slope −c₁ − 2 c₂ v ≤ −2 margin on [−1, 1] is |2 c₂| ≤ c₁ − 2 margin."""
    grid = StabilityGrid.from_box(
        np.array([[0, 2], [0, 3]]), np.array([[0.0, 1.0], [-1.0, 1.0]]), 0, np.array([1.0])
    )
    keep = np.ones(len(grid.points), bool)
    start = np.array([0.5, 1.0])  # Π = ½ c₁' v² …: slope −2·0.5 − 6·1 v, unstable for v < −1/6
    found = grid.nearest(start, np.eye(2), keep)
    # Active constraint 2 a − 6 b = 2 m: the foot of the perpendicular from `start`.
    normal, limit = np.array([-2.0, 6.0]), -2 * grid.margin[0]
    foot = start - normal * (normal @ start - limit) / (normal @ normal)
    np.testing.assert_allclose(found, foot, rtol=1e-6)
    assert grid.stable(grid.at(found, keep))


def test_targets_move_no_farther_than_stability_asks(one_axis) -> None:
    """For extreme targets the result is stable, and no point between it and the start is; a stable start is kept."""
    _, form, targets = one_axis
    grid = form._grid
    keep = np.ones(len(grid.points), bool)
    random, moved = np.random.default_rng(1), 0
    for _ in range(8):
        wild = 4 * form.spread * random.standard_normal(targets.shape[1])
        if grid.stable(grid.at(np.concatenate([[1.0], wild]), keep)):
            continue
        found = grid.nearest_targets(wild, keep)
        if found is None:
            continue
        moved += 1
        blend = grid.blended(np.concatenate([[1.0], wild]), np.concatenate([[1.0], targets[0]]), keep)[1:]
        assert np.linalg.norm(found - wild) <= 1.001 * np.linalg.norm(blend - wild) + 1e-9
        short = wild + 0.9 * (found - wild)
        assert not grid.stable(grid.at(np.concatenate([[1.0], short]), keep))
    assert moved > 0


def test_side_axes_count_as_far_as_they_were_turned(three_axes) -> None:
    """States that are not trusted still give the intended range of side axes: ranges do not jump between designs."""
    data = three_axes[0].data[4]
    main = data.axes.index("y")
    far = np.abs(data.deformation[:, 2]) > 0.6 * np.abs(data.deformation[:, 2]).max()
    lost = replace(data, status=np.where(far, "self_contact", data.status))
    low, high = turned(lost)
    assert low[2] == data.deformation[data.role == "fit", 2].min()
    trusted = np.isin(lost.status, TRUSTED) & (lost.role == "fit")
    assert high[main] == lost.deformation[trusted, main].max()


def test_parameters_count_by_their_logarithm_where_they_can() -> None:
    values = np.array([[1e-3, -1.0], [2e-3, 0.5], [4e-3, 2.0]])
    scaled = ParameterMap.from_designs(values)(values)
    np.testing.assert_allclose(scaled[:, 0], [-1, 0, 1], atol=1e-12)
    np.testing.assert_allclose(scaled[:, 1], [-1, 0, 1], atol=1e-12)


def test_a_design_without_trusted_states_is_named() -> None:
    designs = solved_designs((2, 2))
    lost = replace(designs.data[2], status=np.full(len(designs.data[2]), "self_contact"))
    with pytest.raises(UserError, match=r"design 3 of 4 has 0 trusted states .*fem\.self_contact: pass"):
        fit_common_form(replace(designs, data=(*designs.data[:2], lost, designs.data[3])))
