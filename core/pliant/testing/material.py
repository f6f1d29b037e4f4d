"""Checks of a `Material`: consistent derivatives, objectivity, stability."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.testing.suite import Subject, Suite, require, require_close

suite = Suite("material")
STEP = 1e-6
GRADIENT_TOLERANCE = 1e-6


def sample_gradients(amplitude: float = 0.12, count: int = 8) -> Array:
    """Deformation gradients (n, 3, 3) around the rest state, det F > 0."""
    return np.eye(3) + amplitude * np.random.default_rng(3).uniform(-1, 1, (count, 3, 3))


def derivative_gradients() -> Array:
    """The sample and, for laws of principal stretches, states where two or three of them are equal."""
    equal = [np.eye(3), np.diag([1.6, 0.8, 0.8]), np.diag([0.7, 1.2, 1.2]), 1.02 * np.eye(3)]
    turned = _rotation() @ np.diag([1.4, 1.4, 0.5])
    nearly = np.diag([1.3, 1.3 * (1 + 1e-9), 0.6])
    return np.concatenate([sample_gradients(), equal, [turned, nearly]])


def _rotation() -> Array:
    axis = np.array([[0.0, -0.5, 0.3], [0.5, 0.0, -0.8], [-0.3, 0.8, 0.0]])
    rotation: Array = np.linalg.solve(np.eye(3) - axis, np.eye(3) + axis)  # Cayley
    return rotation


def _stiffness_scale(material: Material) -> float:
    return float(np.abs(material.evaluate(np.eye(3)).tangent).max())


@suite.check("at F = I energy and stress are zero.")
def stress_free_at_rest(subject: Subject) -> None:
    material: Material = subject.build()
    scale = _stiffness_scale(material)
    rest = material.evaluate(np.eye(3))
    require_close(rest.stress, np.zeros((3, 3)), "the stress at F = I is not zero", atol=1e-9 * scale)
    require_close(
        rest.energy, 0.0, "the energy at F = I is not zero: subtract its constant", atol=1e-9 * scale
    )


@suite.check("W ≥ 0, and W > 0 away from rotations.")
def energy_is_positive(subject: Subject) -> None:
    energy = subject.build().energy(sample_gradients())
    require(np.all(energy > 0), f"the energy of a deformed state is {np.min(energy):.3g} J/m³")


@suite.check("P = ∂W/∂F, also where principal stretches are equal.")
def stress_is_the_energys_slope(subject: Subject) -> None:
    material: Material = subject.build()
    F = derivative_gradients()
    numeric = np.empty_like(F)
    for i in range(3):
        for j in range(3):
            step = np.zeros((3, 3))
            step[i, j] = STEP
            numeric[:, i, j] = (material.energy(F + step) - material.energy(F - step)) / (2 * STEP)
    require_close(
        material.evaluate(F).stress,
        numeric,
        "P differs from the finite difference of W: a missing term, or P of another stress measure",
        rtol=GRADIENT_TOLERANCE,
    )


@suite.check("A = ∂P/∂F, also where principal stretches are equal.")
def tangent_is_the_stress_slope(subject: Subject) -> None:
    material: Material = subject.build()
    F = derivative_gradients()
    numeric = np.empty((len(F), 3, 3, 3, 3))
    for k in range(3):
        for l in range(3):  # noqa: E741 - indices of mechanics
            step = np.zeros((3, 3))
            step[k, l] = STEP
            after, before = material.evaluate(F + step).stress, material.evaluate(F - step).stress
            numeric[..., k, l] = (after - before) / (2 * STEP)
    require_close(
        material.evaluate(F).tangent,
        numeric,
        "A differs from the finite difference of P: Newton would lose its quadratic convergence",
        rtol=GRADIENT_TOLERANCE,
    )


@suite.check("A has major symmetry: A_ijkl = A_klij, since P derives from an energy.")
def tangent_is_symmetric(subject: Subject) -> None:
    tangent = subject.build().evaluate(derivative_gradients()).tangent
    require_close(
        tangent, np.einsum("...ijkl->...klij", tangent), "A_ijkl ≠ A_klij: index order mixed up", rtol=1e-10
    )


@suite.check("frame indifference: W(QF) = W(F) and P(QF) = Q P(F) for rotations Q.")
def ignores_rotations_of_the_frame(subject: Subject) -> None:
    material: Material = subject.build()
    F, Q = sample_gradients(), _rotation()
    turned = material.evaluate(Q @ F)
    require_close(
        turned.energy, material.energy(F), "W changes under a rotation: it must depend on FᵀF only", rtol=1e-9
    )
    require_close(turned.stress, Q @ material.evaluate(F).stress, "P(QF) ≠ Q P(F)", rtol=1e-9)


@suite.check("the solid is isotropic: W(FQ) = W(F).")
def is_isotropic(subject: Subject) -> None:
    material: Material = subject.build()
    F = sample_gradients()
    require_close(
        material.energy(F @ _rotation()),
        material.energy(F),
        "W depends on the material's orientation, which families do not give",
        rtol=1e-9,
    )


@suite.check("at rest the solid is stiff in every direction: m⊗n : A : m⊗n > 0.")
def is_stiff_at_rest(subject: Subject) -> None:
    tangent = subject.build().evaluate(np.eye(3)).tangent
    directions = np.random.default_rng(5).standard_normal((40, 2, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    m, n = directions[:, 0], directions[:, 1]
    stiffness = np.einsum("pi,pj,ijkl,pk,pl->p", m, n, tangent, m, n)
    require(
        np.all(stiffness > 0), f"the smallest stiffness is {stiffness.min():.3g} Pa: a wrong sign or modulus"
    )


@suite.check(
    "`shear_modulus_pa` and `bulk_modulus_pa` are those of A at F = I: A_1212 = μ, A_1111 = K + 4/3 μ."
)
def states_its_moduli(subject: Subject) -> None:
    material: Material = subject.build()
    mu, K = float(material.shear_modulus_pa), float(material.bulk_modulus_pa)
    unit = np.eye(3)
    outer, crossed = np.einsum("ij,kl->ijkl", unit, unit), np.einsum("il,jk->ijkl", unit, unit)
    hooke = (K - 2 / 3 * mu) * outer + mu * (np.einsum("ik,jl->ijkl", unit, unit) + crossed)
    require_close(
        material.evaluate(unit).tangent,
        hooke,
        f"A at rest is not that of μ = {mu:.6g} Pa and K = {K:.6g} Pa, which mixed elements rely on",
        rtol=1e-8,
    )


@suite.check("`remarks` are sentences, none for constants without a doubt.")
def remarks_are_sentences(subject: Subject) -> None:
    for remark in subject.build().remarks():
        require(isinstance(remark, str) and remark.endswith("."), f"a remark is {remark!r}, not a sentence")


@suite.check("`energy` and `evaluate` take F of any shape (..., 3, 3) and agree with each other.")
def takes_points_of_any_shape(subject: Subject) -> None:
    material: Material = subject.build()
    F = sample_gradients(count=6)
    flat = material.evaluate(F)
    for shape in ((), (1,), (2, 3)):
        points = F[0] if shape == () else F[: int(np.prod(shape))].reshape(*shape, 3, 3)
        given = material.evaluate(points)
        count = int(np.prod(shape))
        for name, tail in (("energy", ()), ("stress", (3, 3)), ("tangent", (3, 3, 3, 3))):
            got = np.asarray(getattr(given, name))
            require(got.shape == (*shape, *tail), f"{name} of F {points.shape} has shape {got.shape}")
            wanted = np.reshape(getattr(flat, name)[:count], (*shape, *tail))
            require_close(got, wanted, f"{name} depends on how points are batched", rtol=1e-10)
        energy = np.asarray(material.energy(points))
        require(energy.shape == shape, f"energy(F) of F {points.shape} has shape {energy.shape}")
        require_close(energy, given.energy, "energy(F) differs from evaluate(F).energy", rtol=1e-10)


@suite.check("F is the caller's: it is not written to.")
def leaves_its_input_alone(subject: Subject) -> None:
    material: Material = subject.build()
    F = sample_gradients()
    before = F.copy()
    material.energy(F)
    material.evaluate(F)
    require(np.array_equal(F, before), "F was changed in place")


@suite.check("the density is positive, in kg/m³.")
def has_a_density(subject: Subject) -> None:
    density = subject.build().density_kg_m3
    require(
        50 < density < 25e3, f"the density is {density:g} kg/m³: no solid has that (were units forgotten?)"
    )
