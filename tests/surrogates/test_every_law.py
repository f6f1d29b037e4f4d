"""Properties of every law: an energy's gradient, smooth across its box, its plain function, its record."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from tests.surrogates.laws import (
    AXES,
    STATED,
    WAVY,
    energy_law,
    network_law,
    one_by_one,
    points,
    require_same,
    spatial,
    split,
    with_a_box,
)

from pliant.errors import UserError
from pliant.records.error_bar import ErrorBar
from pliant.records.law import JointLaw, LawRecord
from pliant.store.codec import decode, encode
from pliant.testing.samples import opposed_table, sample_table, softening_law
from pliant_plugins.physics.compiled.laws import law_address
from pliant_plugins.surrogates.config import NeuralConfig, PolynomialConfig, TableConfig
from pliant_plugins.surrogates.neural.surrogate import Neural
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial
from pliant_plugins.surrogates.table.surrogate import TableSurrogate

# Laws by name, made when a test uses them.
STABLE: dict[str, Callable[[], JointLaw]] = {
    "wavy": lambda: WAVY,
    "even": lambda: replace(WAVY, odd=0.0),
    "stated": lambda: STATED["stated"],
    "table": lambda: TableSurrogate(TableConfig()).fit(sample_table(softening_law(), noise_n_m=2e-5)).law,
    "table of two inputs": lambda: TableSurrogate(TableConfig()).fit_module(opposed_table()).law,
    **{f"energy {k}": partial(energy_law, k) for k in AXES},
    **{f"network {k}": partial(network_law, k) for k in AXES},
    "network of two inputs": partial(network_law, 1, m=2),
    "network of three inputs": partial(network_law, 3, m=3),
}
LAWS: dict[str, Callable[[], JointLaw]] = {
    **STABLE,
    **{name: partial(STATED.__getitem__, name) for name in STATED},
    "unstable": lambda: replace(WAVY, coefficients=-WAVY.coefficients),
    "three stated axes": spatial,
    "three axes with a box": with_a_box,
}
LOADERS = {
    "polynomial": Polynomial(PolynomialConfig()),
    "table": TableSurrogate(TableConfig()),
    "neural": Neural(NeuralConfig()),
}
every_law = pytest.mark.parametrize("law", LAWS, indirect=True)
stable_law = pytest.mark.parametrize("law", STABLE, indirect=True)


@cache
def made(name: str) -> JointLaw:
    return LAWS[name]()


@pytest.fixture
def law(request: pytest.FixtureRequest) -> JointLaw:
    return made(request.param)


@every_law
@pytest.mark.parametrize("beyond", [0.0, 0.15, 2.0])
def test_efforts_and_slopes_are_derivatives_from_one_potential(law: JointLaw, beyond: float) -> None:
    p, u = points(law, beyond)
    effort, h, dp = law.evaluate(p, u), 1e-5, 0.05
    k = len(law.axes)
    assert [v.shape for v in (effort.tau, effort.dtau_dp, effort.dtau_du)] == [
        (200, k),
        (200, k, *p.shape[1:]),
        (200, k, k),
    ]
    steps = np.array([dp]) if p.ndim == 1 else dp * np.eye(p.shape[1])
    for j, step in enumerate(steps):
        in_p = (law.evaluate(p + step, u).tau - law.evaluate(p - step, u).tau) / (2 * dp)
        by_p = effort.dtau_dp.reshape(200, k, -1)[:, :, j]
        np.testing.assert_allclose(by_p, in_p, rtol=1e-4, atol=1e-4 * np.abs(in_p).max())
    for i, step in enumerate(h * np.eye(k)):
        fall = -(law.potential(p, u + step) - law.potential(p, u - step)) / (2 * h)
        in_u = (law.evaluate(p, u + step).tau - law.evaluate(p, u - step).tau) / (2 * h)
        np.testing.assert_allclose(effort.tau[:, i], fall, rtol=1e-5, atol=1e-6 * np.abs(fall).max())
        np.testing.assert_allclose(effort.dtau_du[:, :, i], in_u, rtol=1e-4, atol=1e-5 * np.abs(in_u).max())
    np.testing.assert_allclose(effort.dtau_du, np.swapaxes(effort.dtau_du, 1, 2), atol=1e-14)
    np.testing.assert_array_equal(law.potential(p, np.zeros_like(u)), 0.0)


@every_law
def test_efforts_and_slopes_are_continuous_across_every_box_side(law: JointLaw) -> None:
    """C¹: on both sides of a face, other coordinates inside and outside, τ and all slopes agree."""
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    for side, limits in enumerate(box):
        for border in limits[np.isfinite(limits)]:
            at = np.column_stack(points(law, 0.3, 40))
            at[:, side] = border
            gap = 1e-9 * np.eye(len(box))[side] * np.ptp(at if np.isinf(limits).any() else limits)
            require_same(*(law.evaluate(*split(law, at + d)) for d in (-gap, gap)), rtol=1e-6)


@stable_law
@pytest.mark.parametrize("beyond", [0.05, 0.2, 1.0, 20.0])
def test_a_stable_law_keeps_a_fifth_as_stiffness_however_far_outside(law: JointLaw, beyond: float) -> None:
    inside = np.linalg.eigvalsh(-law.evaluate(*points(law, 0.0, 2000)).dtau_du).min()
    assert inside > 0
    assert np.linalg.eigvalsh(-law.evaluate(*points(law, beyond, 2000)).dtau_du).min() > 0.2 * inside


@stable_law
def test_no_work_over_a_closed_loop_that_leaves_the_box(law: JointLaw) -> None:
    turn = np.linspace(0, 2 * np.pi, 4001)[:-1]
    k = len(law.axes)
    path = 0.1 + 0.7 * np.stack([np.cos(turn + 0.7 * i) * np.sin((i + 1) * turn) for i in range(k)], axis=1)
    velocity = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    tau = law.evaluate(9e3 + law.unactuated(len(turn)), path).tau
    assert abs(np.sum(tau * velocity)) < 1e-4 * np.sum(np.abs(tau * velocity))


@every_law
def test_far_away_is_finite_and_flagged(law: JointLaw) -> None:
    u = np.outer([1e3, -50.0], np.ones(len(law.axes)))
    p, _ = split(law, np.outer([1e9, -1e9], np.ones(len(law.actuations) + 1)))
    effort = law.evaluate(p, u)
    values = (effort.tau, effort.dtau_dp, effort.dtau_du, law.potential(p, u))
    assert all(np.isfinite(one).all() for one in values)
    bounded = np.isfinite(law.domain.actuation).any() or np.isfinite(law.domain.deformation).any()
    assert np.all(np.any(law.domain.excess(p, u) != 0, axis=1)) == bounded


@every_law
@pytest.mark.parametrize("beyond", [0.0, 1.0])
def test_the_plain_function_is_the_law_and_compiles(law: JointLaw, beyond: float) -> None:
    p, u = points(law, beyond, 40, seed=4)
    scalar = law.scalar()
    assert scalar is not None and np.isfinite(scalar.parameters).all()
    assert (
        law_address(scalar.function, len(law.actuations)) != 0
    )  # numba refuses what an engine could not compile
    require_same(one_by_one(law, p, u), law.evaluate(p, u), rtol=1e-9)


@every_law
def test_a_record_gives_the_same_bits_through_json(law: JointLaw) -> None:
    if law.error is None and law.joint == "revolute" and np.isfinite(law.domain.deformation).all():
        box = np.vstack([law.domain.actuation, law.domain.deformation])
        p, u = points(law, 0.0, 12)
        law = replace(
            law, error=ErrorBar.from_residuals(box, p, u, np.random.default_rng(0).normal(0, 1e-5, u.shape))
        )  # type: ignore[type-var]
    arrays: dict[str, np.ndarray] = {}
    text = json.dumps(encode(law.record(), arrays))
    record = decode(json.loads(text), arrays)
    again = LOADERS[record.kind].load(record)
    p, u = points(law, 1.0)
    first, second = law.evaluate(p, u), again.evaluate(p, u)
    for name in ("tau", "dtau_dp", "dtau_du"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    np.testing.assert_array_equal(law.potential(p, u), again.potential(p, u))
    assert (again.error is None) == (law.error is None)
    np.testing.assert_array_equal(again.band(p, u), law.band(p, u))  # type: ignore[arg-type]
    assert (again.joint, again.axes, again.actuation_name) == (law.joint, law.axes, law.actuation_name)
    np.testing.assert_array_equal(again.domain.deformation, law.domain.deformation)


@pytest.mark.parametrize("kind", LOADERS)
def test_another_record_kind_is_refused(kind: str) -> None:
    with pytest.raises(UserError, match="cannot read a law of kind 'another'"):
        LOADERS[kind].load(LawRecord("another", {}, {}))


def test_laws_with_one_form_share_their_function() -> None:
    functions = {law.scalar().function for law in map(made, LAWS) if law.record().kind == "polynomial"}  # type: ignore[union-attr]
    assert len(functions) == 2  # of polynomials and of energies
