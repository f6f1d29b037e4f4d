"""The table surrogate: it reproduces its data, smooths scatter, decreases, and is an energy's gradient."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.surrogates.laws import states

from pliant.fem_tables.reading import read_table
from pliant.fem_tables.writing import write_table
from pliant.testing.samples import sample_table, softening_law
from pliant_plugins.surrogates.config import TableConfig
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.table import spline
from pliant_plugins.surrogates.table.surrogate import TableLaw, TableSurrogate

RANDOM = np.random.default_rng(4)


def table() -> TableSurrogate:
    return TableSurrogate(TableConfig())


def scattered(n: int, noise: float = 0.0, seed: int = 0):
    """Return states at random positions of a softening law, without slopes."""
    random = np.random.default_rng(seed)
    data = sample_table(softening_law())
    p = random.uniform(0, data.actuation.max(), n)
    u = random.uniform(data.angle_rad.min(), data.angle_rad.max(), n)
    tau = softening_law().evaluate(p, u[:, None]).tau[:, 0]
    return states(p, u, tau + noise * np.ptp(tau) * random.normal(size=n))


def points(law: TableLaw, n: int = 400, reach: float = 0.0):
    """Return points in the box, or up to `reach` half-boxes outside."""
    box = np.concatenate([law.domain.actuation[None], law.domain.deformation])
    x = RANDOM.uniform(-1 - reach, 1 + reach, (n, 2))
    place = box.mean(axis=1) + x * np.ptp(box, axis=1) / 2
    return place[:, 0], place[:, 1:]


@pytest.mark.parametrize("cells", [3, 7])
def test_splines_hold_lines_and_integrate_to_their_antiderivative(cells: int) -> None:
    x = np.linspace(0, 1, 50)
    centres = (np.arange(cells + 3) - 1) / cells
    np.testing.assert_allclose(spline.rows(x, cells) @ np.ones(cells + 3), 1, atol=1e-14)
    np.testing.assert_allclose(spline.rows(x, cells) @ centres, x, atol=1e-14)
    np.testing.assert_allclose(spline.rows(x, cells, slopes=True) @ centres, 1, atol=1e-12)
    cell, t = spline.place(x, cells)
    area = spline.antiderivative(centres[None])[0]
    whole = np.einsum("nm,nm->n", area[cell[:, None] + np.arange(5)], spline.area_weights(t))
    np.testing.assert_allclose(whole - whole[0], x**2 / 2, atol=1e-14)


def test_a_law_without_noise_is_reproduced_between_its_states() -> None:
    law = table().fit(scattered(120)).law
    p, u = points(law)
    wanted = softening_law().evaluate(p, u).tau
    assert np.abs(law.evaluate(p, u).tau - wanted).max() < 5e-3 * np.ptp(wanted)


def test_slopes_make_the_law_better_than_values_alone() -> None:
    data = sample_table(softening_law(), pressures=4, angles=4)
    blank = np.full(len(data), np.nan)
    with_slopes = table().fit(data).law
    without = table().fit(replace(data, dmoment_dp=blank, dmoment_du=blank)).law
    p, u = points(with_slopes)
    wanted = softening_law().evaluate(p, u).tau
    errors = [np.abs(law.evaluate(p, u).tau - wanted).max() for law in (with_slopes, without)]
    assert errors[0] < 0.7 * errors[1]


def test_noise_is_smoothed_and_widens_the_band() -> None:
    quiet, noisy = (table().fit(scattered(150, noise)).law for noise in (0.0, 0.03))
    p, u = points(quiet)
    wanted = softening_law().evaluate(p, u).tau
    rms = np.sqrt(np.mean((noisy.evaluate(p, u).tau - wanted) ** 2))
    assert rms < 0.015 * np.ptp(wanted)  # half of the noise in the data
    assert np.median(noisy.band(p, u)) > 5 * np.median(quiet.band(p, u))


def test_the_band_covers_noisy_states_as_stated() -> None:
    law = table().fit(scattered(200, 0.03)).law
    fresh = scattered(2000, 0.03, seed=9)
    inside = np.all(law.domain.excess(fresh.actuation, fresh.angle_rad[:, None]) == 0, axis=1)
    fresh = fresh.rows(inside)
    missed = law.evaluate(fresh.actuation, fresh.angle_rad[:, None]).tau[:, 0] - fresh.moment_n_m
    covered = np.mean(np.abs(missed) <= law.band(fresh.actuation, fresh.angle_rad[:, None])[:, 0])
    assert 0.83 < covered < 0.97


@pytest.mark.parametrize("seed", range(3))
def test_noise_does_not_make_a_falling_law_snap(seed: int) -> None:
    law = table().fit(scattered(40, 0.08, seed)).law
    p, u = points(law, 2000, reach=1.0)
    assert law.evaluate(p, u).dtau_du.max() < 0


def test_a_law_that_rises_in_its_data_keeps_rising_and_says_so() -> None:
    data = scattered(150)
    span = np.ptp(data.moment_n_m)
    snapping = replace(data, moment_n_m=data.moment_n_m + span * np.sin(12 * data.angle_rad))
    fitted = table().fit(snapping)
    assert fitted.report.details["stable"] is False
    assert fitted.report.worst_of_range < 0.05


def test_three_tables_make_a_spherical_joint(tmp_path: Path) -> None:
    paths = {}
    for axis in "xyz":
        paths[axis] = tmp_path / f"{axis}.csv"
        write_table(replace(sample_table(softening_law()), axis=axis), paths[axis])
    surrogate = TableSurrogate(
        TableConfig.model_validate({"axes": {a: {"data": p} for a, p in paths.items()}})
    )
    assert set(surrogate.tables()) == set("xyz")
    assert not surrogate.needs_fem()
    fitted = surrogate.fit_axes({axis: read_table(path) for axis, path in paths.items()})
    law = fitted.law
    assert isinstance(law, AxesLaw)
    assert law.joint == "spherical"
    p, u = RANDOM.uniform(0, 1e4, 20), RANDOM.uniform(-0.1, 0.3, (20, 3))
    again = surrogate.load(law.record())
    np.testing.assert_array_equal(again.evaluate(p, u).tau, law.evaluate(p, u).tau)
    scalar = law.scalar()
    tau, by_p, by_u = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    scalar.function(float(p[0]), u[0], scalar.parameters, tau, by_p, by_u)
    np.testing.assert_allclose(tau, law.evaluate(p[:1], u[:1]).tau[0], rtol=1e-10)
