"""The compiled polynomial law: the same bits for any grouping of points, any shape of coefficients, any memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher
from tests.surrogates.laws import BOX, TABLE, WAVY, require_same

from pliant.records.law import Domain
from pliant_plugins.surrogates.continued import ContinuedLaw
from pliant_plugins.surrogates.polynomial import kernel
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw

LAWS = {
    "wavy": WAVY,
    "unstable": replace(WAVY, coefficients=-TABLE),
    "no box": replace(WAVY, domain=Domain.unbounded(1)),
    "no box in u": replace(WAVY, domain=Domain(BOX.actuation, Domain.unbounded(1).deformation)),
}
NAMES = ("tau", "dtau_dp", "dtau_du")


def many(n: int = 1111) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    return rng.uniform(-10e3, 30e3, n), rng.uniform(-0.6, 0.9, (n, 1))


@pytest.mark.parametrize("size", [1, 3, 64, 255, 256, 257, 1000])
def test_a_point_gives_the_same_bits_whatever_stands_beside_it(size: int) -> None:
    p, u = many()
    whole = WAVY.evaluate(p, u)
    for start in (0, 7):
        some = WAVY.evaluate(p[start : start + size], u[start : start + size])
        for name in NAMES:
            np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[start : start + size])


def test_points_inside_do_not_feel_points_outside() -> None:
    p, u = many(200)
    inside = np.array([5e3]), np.array([[0.1]])
    alone = WAVY.evaluate(*inside)
    among = WAVY.evaluate(np.append(p, inside[0]), np.append(u, inside[1], axis=0))
    for name in NAMES:
        np.testing.assert_array_equal(getattr(among, name)[-1], getattr(alone, name)[0])


@pytest.mark.parametrize("name", LAWS)
def test_it_is_the_law_in_numpy(name: str) -> None:
    p, u = many()
    require_same(LAWS[name].evaluate(p, u), ContinuedLaw.evaluate(LAWS[name], p, u))


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (3, 4), (4, 3), (10, 10), (2, 7)])
@pytest.mark.parametrize("corner", [False, True])
def test_rows_with_every_length(shape: tuple[int, int], corner: bool) -> None:
    """A triangle of coefficients skips zeros at the end of its rows; a row may be empty."""
    table = np.random.default_rng(shape).normal(size=shape)
    if corner:
        i, j = np.indices(shape)
        table[i / shape[0] + j / shape[1] >= 1] = 0.0
        table[-1] = 0.0
    law = PolynomialLaw(1e-3 * table, np.array([7.5e3, 7.5e3]), np.array([0.125, 0.325]), BOX)
    p, u = many()
    require_same(law.evaluate(p, u), ContinuedLaw.evaluate(law, p, u))


def test_strided_and_integer_input_is_read_as_it_is() -> None:
    p, u = many(300)
    wanted = WAVY.evaluate(p[::3].copy(), u[::3].copy())
    spaced = WAVY.evaluate(p[::3], np.repeat(u, 2, axis=1)[::3, 1:])
    np.testing.assert_array_equal(spaced.tau, wanted.tau)
    whole = WAVY.evaluate(np.array([5000]), np.array([[0]]))
    np.testing.assert_array_equal(whole.tau, WAVY.evaluate(np.array([5e3]), np.zeros((1, 1))).tau)
    assert WAVY.evaluate(np.zeros(0), np.zeros((0, 1))).dtau_du.shape == (0, 1, 1)


def test_what_is_not_a_number_stays_so_and_spoils_no_other_point() -> None:
    p, u = many(100)
    wanted = WAVY.evaluate(p, u).tau
    p[3], u[8] = np.nan, np.nan
    tau = WAVY.evaluate(p, u).tau[:, 0]
    assert np.flatnonzero(np.isnan(tau)).tolist() == [3, 8]
    others = np.isfinite(tau)
    np.testing.assert_array_equal(tau[others], wanted[others, 0])


def test_compiled_functions_call_none_in_other_files() -> None:
    """numba's cache on disk detects changes of a function's own file only."""
    called = [value for value in vars(kernel).values() if isinstance(value, CPUDispatcher)]
    assert called
    assert all(function.py_func.__module__ == kernel.__name__ for function in called)
