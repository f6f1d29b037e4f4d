"""Identities of rotation vectors, from zero to beyond π."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pliant.mechanics.rotations import (
    exp_map,
    left_jacobian,
    left_jacobian_transpose_slope,
    log_map,
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_vector,
    right_jacobian,
    right_jacobian_inverse,
    vector_from_quaternion,
)
from pliant.records.design import Array

directions = (
    arrays(np.float64, 3, elements=st.floats(-1, 1))
    .filter(lambda v: np.linalg.norm(v) > 0.1)
    .map(lambda v: v / np.linalg.norm(v))
)
# Angles near 0, near the series' ends and near π are where the closed forms fail.
angles = st.one_of(
    st.floats(0.0, 3.1),
    st.floats(1e-12, 1e-6),
    st.floats(0.09, 0.11),
    st.floats(0.29, 0.31),
    st.floats(3.1, np.pi),
)


def difference(function: Callable[[Array], Array], phi: Array, step: float = 1e-6) -> Array:
    """Return central differences of an array-valued function of φ; the last axis is φ's."""
    columns = [(function(phi + d) - function(phi - d)) / (2 * step) for d in step * np.eye(3)]
    return np.stack(columns, axis=-1)


vectors = st.builds(lambda angle, direction: angle * direction, angles, directions)


@given(vectors)
def test_log_inverts_exp(phi: Array) -> None:
    back = log_map(exp_map(phi))
    np.testing.assert_allclose(exp_map(back), exp_map(phi), atol=1e-14)
    if np.linalg.norm(phi) < np.pi - 1e-6:
        np.testing.assert_allclose(back, phi, atol=1e-9)


@given(vectors)
def test_exp_is_a_rotation_and_agrees_with_quaternions(phi: Array) -> None:
    rotation, quaternion = exp_map(phi), quaternion_from_vector(phi)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) > 0
    np.testing.assert_allclose(matrix_from_quaternion(quaternion), rotation, atol=1e-14)
    np.testing.assert_allclose(np.abs(quaternion_from_matrix(rotation) @ quaternion), 1.0, atol=1e-14)
    turned = [vector_from_quaternion(sign * quaternion) for sign in (-1, 1)]
    np.testing.assert_allclose(turned[0], turned[1], atol=1e-14)


@given(vectors)
def test_jacobians_are_the_angular_velocity_seen_from_parent_and_child(phi: Array) -> None:
    spin = difference(exp_map, phi)
    for i, column in enumerate(left_jacobian(phi).T):
        matrix = spin[:, :, i] @ exp_map(phi).T
        np.testing.assert_allclose([matrix[2, 1], matrix[0, 2], matrix[1, 0]], column, atol=1e-8)
    np.testing.assert_allclose(exp_map(phi) @ right_jacobian(phi), left_jacobian(phi), atol=1e-13)
    np.testing.assert_allclose(right_jacobian_inverse(phi) @ right_jacobian(phi), np.eye(3), atol=1e-12)


@given(vectors, directions)
def test_jacobian_slope(phi: Array, moment: Array) -> None:
    numeric = difference(lambda vector: left_jacobian(vector).T @ moment, phi)
    np.testing.assert_allclose(left_jacobian_transpose_slope(phi, moment), numeric, atol=1e-8)


def test_half_turns_about_every_axis() -> None:
    for axis in np.eye(3):
        vector = log_map(exp_map(np.pi * axis))
        np.testing.assert_allclose(np.abs(vector), np.pi * axis, atol=1e-9)


def test_vectorised_over_leading_axes() -> None:
    phi = np.random.default_rng(0).normal(size=(4, 2, 3))
    one_by_one = np.array([[exp_map(v) for v in row] for row in phi])
    np.testing.assert_allclose(exp_map(phi), one_by_one, atol=1e-15)
    assert left_jacobian_transpose_slope(phi, phi).shape == (4, 2, 3, 3)
