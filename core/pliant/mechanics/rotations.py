"""Rotation vectors, rotation matrices and quaternions (w, x, y, z), vectorised over leading axes.

The left Jacobian J maps the rate of a rotation vector φ to the angular velocity in the parent frame:
(dR/dt) Rᵀ = [J(φ) dφ/dt]×. With θ = |φ| and K = [φ]×,

    R = I + a K + b K²,   J = I + b K + c K²,
    a = sin θ / θ,  b = (1 − cos θ) / θ²,  c = (θ − sin θ) / θ³            (Chirikjian 2012, §10.6).
"""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array

# Below this angle the closed forms cancel; a series to θ⁶ is exact to rounding there.
SMALL_ANGLE = 0.1


def skew(vector: Array) -> Array:
    """Return [v]× (..., 3, 3) with [v]× w = v × w, for v of shape (..., 3)."""
    matrix = np.zeros((*vector.shape[:-1], 3, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix


def exp_map(phi: Array) -> Array:
    """Return the rotation matrix (..., 3, 3) of the rotation vector φ (..., 3) by Rodrigues' formula."""
    theta_sq, theta = _angles(phi)
    half = _half_sinc(theta)
    a, b = half * np.cos(0.5 * theta), 0.5 * half**2
    rotation: Array = a[..., None, None] * skew(phi) + b[..., None, None] * _square(phi, theta_sq)
    return rotation + np.eye(3)


def log_map(rotation: Array) -> Array:
    """Return the rotation vector (..., 3) with θ ≤ π of a rotation matrix (..., 3, 3); accurate near 0 and π."""
    return vector_from_quaternion(quaternion_from_matrix(rotation))


def left_jacobian(phi: Array) -> Array:
    """Return J(φ), (..., 3, 3): angular velocity in the parent frame per rate of φ."""
    theta_sq, theta = _angles(phi)
    b = 0.5 * _half_sinc(theta) ** 2
    c = _c(theta, theta_sq)
    jacobian: Array = b[..., None, None] * skew(phi) + c[..., None, None] * _square(phi, theta_sq)
    return jacobian + np.eye(3)


def right_jacobian(phi: Array) -> Array:
    """Return Jᵣ(φ) = J(−φ) = J(φ)ᵀ: angular velocity in the child's frame per rate of φ."""
    return left_jacobian(-phi)


def right_jacobian_inverse(phi: Array) -> Array:
    """Return Jᵣ(φ)⁻¹ = I + K/2 + d K² with d = (1 − (θ/2) cot(θ/2)) / θ²; singular at θ = 2π."""
    theta_sq, theta = _angles(phi)
    small = theta < SMALL_ANGLE
    t = np.where(small, 1.0, theta)
    closed = (1.0 - 0.5 * t / np.tan(0.5 * t)) / t**2
    series = 1 / 12 + theta_sq / 720 + theta_sq**2 / 30240 + theta_sq**3 / 1209600
    d = np.where(small, series, closed)
    inverse: Array = 0.5 * skew(phi) + d[..., None, None] * _square(phi, theta_sq)
    return inverse + np.eye(3)


def left_jacobian_transpose_slope(phi: Array, moment: Array) -> Array:
    """Return ∂(J(φ)ᵀ g)/∂φ at fixed g, (..., 3, 3) with rows = components of Jᵀg, columns = components of φ.

    Differentiates Jᵀg = g − b φ×g + c (φ (φ·g) − θ² g); its skew part is ½ [..]× of the structure equation.
    """
    theta_sq, theta = _angles(phi)
    b = (0.5 * _half_sinc(theta) ** 2)[..., None, None]
    c = _c(theta, theta_sq)[..., None, None]
    db, dc = _slopes_over_angle(theta, theta_sq)
    along = np.einsum("...i,...i->...", phi, moment)[..., None]
    row = phi[..., None, :]
    slope: Array = b * skew(moment) - db[..., None, None] * np.cross(phi, moment)[..., None] * row
    slope += c * (along[..., None] * np.eye(3) + phi[..., :, None] * moment[..., None, :])
    slope -= 2 * c * moment[..., :, None] * row
    slope += dc[..., None, None] * (phi * along - theta_sq[..., None] * moment)[..., None] * row
    return slope


def quaternion_from_vector(phi: Array) -> Array:
    """Return the unit quaternion (..., 4) of a rotation vector."""
    theta = np.linalg.norm(phi, axis=-1)
    vector = 0.5 * _half_sinc(theta)[..., None] * phi
    return np.concatenate([np.cos(0.5 * theta)[..., None], vector], axis=-1)


def vector_from_quaternion(quaternion: Array) -> Array:
    """Return the rotation vector (..., 3) with θ ≤ π of a unit quaternion (..., 4) of either sign."""
    q = np.where(quaternion[..., :1] < 0.0, -quaternion, quaternion)
    length = np.linalg.norm(q[..., 1:], axis=-1)
    angle = 2.0 * np.arctan2(length, q[..., 0])
    # angle / length → 2 / w as the rotation vanishes.
    tiny = length < 1e-9
    ratio = np.where(tiny, 2.0 / np.where(tiny, q[..., 0], 1.0), angle / np.where(tiny, 1.0, length))
    return np.asarray(ratio[..., None] * q[..., 1:])


def quaternion_from_matrix(rotation: Array) -> Array:
    """Return the unit quaternion (..., 4), w ≥ 0, of a rotation matrix, from its best-conditioned column.

    The symmetric matrix 4 q qᵀ is linear in R; its column of largest diagonal gives q without cancellation.
    """
    R = np.asarray(rotation, float)
    outer = np.empty((*R.shape[:-2], 4, 4))
    trace = np.trace(R, axis1=-2, axis2=-1)
    outer[..., 0, 0] = 1.0 + trace
    outer[..., 1:, 1:] = R + np.swapaxes(R, -1, -2) + (1.0 - trace)[..., None, None] * np.eye(3)
    axial = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1
    )
    outer[..., 0, 1:] = axial
    outer[..., 1:, 0] = axial
    best = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    column = np.take_along_axis(outer, best[..., None, None], axis=-1)[..., 0]
    quaternion: Array = column / np.linalg.norm(column, axis=-1, keepdims=True)
    return np.where(quaternion[..., :1] < 0.0, -quaternion, quaternion)


def matrix_from_quaternion(quaternion: Array) -> Array:
    """Return the rotation matrix (..., 3, 3) of a quaternion (..., 4), which is normalised first."""
    q = np.asarray(quaternion, float)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    K = skew(q[..., 1:])
    rotation: Array = 2.0 * q[..., :1, None] * K + 2.0 * K @ K
    return rotation + np.eye(3)


def _angles(phi: Array) -> tuple[Array, Array]:
    theta_sq = np.einsum("...i,...i->...", phi, phi)
    return theta_sq, np.sqrt(theta_sq)


def _half_sinc(theta: Array) -> Array:
    """Return sin(θ/2) / (θ/2), from which a and b follow without cancellation."""
    half = np.maximum(0.5 * theta, 1e-12)
    return np.asarray(np.sin(half) / half)


def _square(phi: Array, theta_sq: Array) -> Array:
    """Return K² = φ φᵀ − θ² I."""
    return np.asarray(phi[..., :, None] * phi[..., None, :] - theta_sq[..., None, None] * np.eye(3))


def _c(theta: Array, theta_sq: Array) -> Array:
    small = theta < SMALL_ANGLE
    t = np.where(small, 1.0, theta)
    series = 1 / 6 - theta_sq / 120 + theta_sq**2 / 5040 - theta_sq**3 / 362880
    return np.where(small, series, (t - np.sin(t)) / t**3)


def _slopes_over_angle(theta: Array, theta_sq: Array) -> tuple[Array, Array]:
    """Return the derivatives of the coefficients b and c of the left Jacobian by the angle, over the angle."""
    # These cancel two orders earlier than b and c, so that the series is used further.
    small = theta < 3 * SMALL_ANGLE
    t = np.where(small, 1.0, theta)
    db = (t * np.sin(t) - 2.0 * (1.0 - np.cos(t))) / t**4
    dc = (t * (1.0 - np.cos(t)) - 3.0 * (t - np.sin(t))) / t**5
    x = theta_sq
    db_series = -1 / 12 + x / 180 - x**2 / 6720 + x**3 / 453600 - x**4 / 47900160
    dc_series = -1 / 60 + x / 1260 - x**2 / 60480 + x**3 / 4989600 - x**4 / 622702080
    return np.where(small, db_series, db), np.where(small, dc_series, dc)
