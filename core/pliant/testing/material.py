"""Checks of a `Material`: consistent derivatives, objectivity, stability."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.testing import Subject, agree, require

STEP = 1e-6
GRADIENT_TOLERANCE = 1e-6
UNIT = np.eye(3)


def _sample_gradients(amplitude: float = 0.12, count: int = 8) -> Array:
    """Return deformation gradients (n, 3, 3) around the rest state, det F > 0."""
    return np.eye(3) + amplitude * np.random.default_rng(3).uniform(-1, 1, (count, 3, 3))


def _derivative_gradients() -> Array:
    """Return the sample and, for laws of principal stretches, states where two or three of them are equal."""
    equal = [np.eye(3), np.diag([1.6, 0.8, 0.8]), np.diag([0.7, 1.2, 1.2]), 1.02 * np.eye(3)]
    turned = _rotation() @ np.diag([1.4, 1.4, 0.5])
    nearly = np.diag([1.3, 1.3 * (1 + 1e-9), 0.6])
    return np.concatenate([_sample_gradients(), equal, [turned, nearly]])


def _rotation() -> Array:
    axis = np.array([[0.0, -0.5, 0.3], [0.5, 0.0, -0.8], [-0.3, 0.8, 0.0]])
    rotation: Array = np.linalg.solve(np.eye(3) - axis, np.eye(3) + axis)  # Cayley
    return rotation


def _by_differences(function: Callable[[Array], Array], F: Array) -> Array:
    """Return ∂/∂F by central differences, its two indices last."""
    steps = STEP * np.eye(9).reshape(3, 3, 3, 3)
    columns = [[(function(F + s) - function(F - s)) / (2 * STEP) for s in row] for row in steps]
    slopes: Array = np.moveaxis(np.array(columns), (0, 1), (-2, -1))
    return slopes


def stress_free_at_rest(subject: Subject) -> None:
    """at F = I energy and stress are zero."""
    rest = subject.build().evaluate(UNIT)
    small = 1e-9 * float(np.abs(rest.tangent).max())
    agree(rest.stress, np.zeros((3, 3)), "the stress at F = I is not zero", atol=small)
    agree(rest.energy, 0.0, "the energy at F = I is not zero: subtract its constant", atol=small)


def energy_is_positive(subject: Subject) -> None:
    """W ≥ 0, and W > 0 away from rotations."""
    energy = subject.build().energy(_sample_gradients())
    require(np.all(energy > 0), f"the energy of a deformed state is {np.min(energy):.3g} J/m³")


def stress_is_the_energys_slope(subject: Subject) -> None:
    """P = ∂W/∂F, also where principal stretches are equal."""
    material, F = subject.build(), _derivative_gradients()
    finding = "P differs from the finite difference of W: a missing term, or P of another stress measure"
    agree(material.evaluate(F).stress, _by_differences(material.energy, F), finding, rtol=GRADIENT_TOLERANCE)


def tangent_is_the_stress_slope(subject: Subject) -> None:
    """A = ∂P/∂F, and so A_ijkl = A_klij, also where principal stretches are equal."""
    material, F = subject.build(), _derivative_gradients()
    slopes = _by_differences(lambda at: material.evaluate(at).stress, F)
    finding = (
        "A differs from the finite difference of P: a wrong term or index order, and Newton converges slowly"
    )
    agree(material.evaluate(F).tangent, slopes, finding, rtol=GRADIENT_TOLERANCE)


def is_frame_indifferent(subject: Subject) -> None:
    """frame indifference: W(QF) = W(F) and P(QF) = Q P(F) for rotations Q."""
    material, F, Q = subject.build(), _sample_gradients(), _rotation()
    here, turned = material.evaluate(F), material.evaluate(Q @ F)
    agree(
        turned.energy, material.energy(F), "W changes under a rotation: it must depend on FᵀF only", rtol=1e-9
    )
    agree(turned.stress, Q @ here.stress, "P(QF) ≠ Q P(F)", rtol=1e-9)


def is_isotropic(subject: Subject) -> None:
    """the solid is isotropic: W(FQ) = W(F)."""
    material, F = subject.build(), _sample_gradients()
    finding = "W depends on the material's orientation, which families do not give"
    agree(material.energy(F @ _rotation()), material.energy(F), finding, rtol=1e-9)


def states_its_moduli(subject: Subject) -> None:
    """`shear_modulus_pa` and `bulk_modulus_pa` are those of A at F = I and positive: A_1212 = μ, A_1111 = K + 4/3 μ."""
    material: Material = subject.build()
    mu, K = float(material.shear_modulus_pa), float(material.bulk_modulus_pa)
    require(
        mu > 0 and K > 0, f"μ = {mu:.6g} Pa and K = {K:.6g} Pa: at rest a solid is stiff in every direction"
    )
    pairs = (("ij", "kl"), ("ik", "jl"), ("il", "jk"))
    outer, straight, crossed = (np.einsum(f"{i},{j}->ijkl", UNIT, UNIT) for i, j in pairs)
    hooke = (K - 2 / 3 * mu) * outer + mu * (straight + crossed)
    finding = f"A at rest is not that of μ = {mu:.6g} Pa and K = {K:.6g} Pa, which mixed elements rely on"
    agree(material.evaluate(UNIT).tangent, hooke, finding, rtol=1e-8)


def remarks_are_sentences(subject: Subject) -> None:
    """`remarks` are sentences, none for unproblematic constants."""
    for remark in subject.build().remarks():
        require(isinstance(remark, str) and remark.endswith("."), f"a remark is {remark!r}, not a sentence")


def accepts_points_in_any_shape(subject: Subject) -> None:
    """`energy` and `evaluate` take F of any shape (..., 3, 3) and agree with each other."""
    material, F = subject.build(), _sample_gradients(count=6)
    flat = material.evaluate(F)
    for shape in ((), (1,), (2, 3)):
        count = int(np.prod(shape))
        points = F[:count].reshape(*shape, 3, 3)
        given = material.evaluate(points)
        for name, tail in (("energy", ()), ("stress", (3, 3)), ("tangent", (3, 3, 3, 3))):
            got = np.asarray(getattr(given, name))
            require(got.shape == (*shape, *tail), f"{name} of F {points.shape} has shape {got.shape}")
            wanted = np.reshape(getattr(flat, name)[:count], got.shape)
            agree(got, wanted, f"{name} depends on how points are batched", rtol=1e-10)
        energy = np.asarray(material.energy(points))
        require(energy.shape == shape, f"energy(F) of F {points.shape} has shape {energy.shape}")
        agree(energy, given.energy, "energy(F) differs from evaluate(F).energy", rtol=1e-10)


def leaves_its_input_alone(subject: Subject) -> None:
    """F belongs to the caller and is not changed."""
    material, F = subject.build(), _sample_gradients()
    before = F.copy()
    material.energy(F)
    material.evaluate(F)
    require(np.array_equal(F, before), "F was changed in place")


def has_a_density(subject: Subject) -> None:
    """the density is positive, in kg/m³."""
    density = subject.build().density_kg_m3
    require(
        50 < density < 25e3, f"the density is {density:g} kg/m³: no solid has that (were units forgotten?)"
    )
