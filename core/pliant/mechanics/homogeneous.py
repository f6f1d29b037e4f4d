"""Homogeneous tests of a solid: nominal stress against stretch with free faces.

uniaxial: F = diag(λ, s, s), P₂₂ = P₃₃ = 0. equibiaxial: F = diag(λ, λ, s), planar (pure shear): F = diag(λ, 1, s),
both with P₃₃ = 0. The nominal stress P₁₁ is force over area at rest, Abaqus' "nominal stress" of test data.

For the incompressible solid, J = 1, the free stretch follows from λ, and a pressure without work frees the faces:
P₁₁ = (σ₁₁ − σ₃₃)/λ with σ_aa = λ_a ∂W/∂λ_a (Ogden, Non-linear Elastic Deformations, 1984, §4.3.4).
"""

from __future__ import annotations

from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from pliant.errors import NotReachedError
from pliant.records.design import Array

Mode = Literal["uniaxial", "equibiaxial", "planar"]
MODES: tuple[Mode, ...] = get_args(Mode)
# Range of the stability check: no principal stretch above 2 or below ½.
DOUBT_RANGES: dict[Mode, tuple[float, float]] = {
    "uniaxial": (0.5, 2.0),
    "equibiaxial": (0.5**0.5, 2.0**0.5),
    "planar": (0.5, 2.0),
}
POINTS = 61
# ν of incompressible rubber: the largest that FEM accepts, K = 1000 μ.
INCOMPRESSIBLE_RATIO = 0.4995
# The free stretch is λ to this power for J = 1.
FREE_POWER: dict[str, float] = {"uniaxial": -0.5, "equibiaxial": -2.0, "planar": -1.0}
ITERATIONS = 60
LONGEST = 0.2  # step of ln s
TOLERANCE = 1e-11


class StressResponse(Protocol):
    """Stress P (n, 3, 3) and tangent A (n, 3, 3, 3, 3), Pa."""

    @property
    def stress(self) -> Array: ...

    @property
    def tangent(self) -> Array: ...


class HomogeneousSolid(Protocol):
    """Interface of a material in a homogeneous test."""

    def evaluate(self, F: Array) -> StressResponse:
        """Return P and A at F (n, 3, 3)."""
        ...


def nominal_stress(solid: HomogeneousSolid, stretch: Array, mode: Mode = "uniaxial") -> Array:
    """Return P₁₁ (n,) in Pa of a specimen at stretches λ (n,) > 0, with its free faces at zero stress.

    Raises:
        NotReachedError: a free face has no equilibrium, which unphysical constants may cause.
    """
    stress, _ = stress_and_volume(solid, np.asarray(stretch, float), mode)
    return stress


def stress_and_volume(solid: HomogeneousSolid, stretch: Array, mode: Mode) -> tuple[Array, Array]:
    """Return P₁₁ (n,) in Pa and J (n,) of a specimen; raises as `nominal_stress` does."""
    stress, volume, converged = _solved(solid, stretch, mode)
    if not np.all(converged):
        worst = float(np.asarray(stretch)[~converged][0])
        raise NotReachedError(
            f"at a stretch of {worst:.3g} a {mode} specimen of this material finds no stress-free side; its constants "
            "are unstable there"
        )
    return stress, volume


def incompressible_stress(solid: HomogeneousSolid, stretch: Array, mode: Mode = "uniaxial") -> Array:
    """Return P₁₁ (n,) in Pa at stretches λ (n,) > 0 of the incompressible solid, regardless of its ν."""
    free = stretch ** FREE_POWER[mode]
    stress = solid.evaluate(_gradient(stretch, free, mode)).stress
    return stress[:, 0, 0] - stress[:, 2, 2] * free / stretch


def _solved(solid: HomogeneousSolid, stretch: Array, mode: Mode) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return P₁₁, J (n,) and their validity, by Newton in ln s from the free stretch s of the incompressible solid."""
    free = np.log(stretch) * FREE_POWER[mode]
    for _ in range(ITERATIONS):
        F = _gradient(stretch, np.exp(free), mode)
        state = solid.evaluate(F)
        slope = state.tangent[:, 2, 2, 2, 2]
        if mode == "uniaxial":
            slope = slope + state.tangent[:, 2, 2, 1, 1]
        step = -state.stress[:, 2, 2] / (slope * np.exp(free))
        converged = np.abs(step) < TOLERANCE
        if np.all(converged):
            break
        free = free + np.clip(np.where(np.isfinite(step), step, LONGEST), -LONGEST, LONGEST)
    return state.stress[:, 0, 0], F[:, 0, 0] * F[:, 1, 1] * F[:, 2, 2], converged


def _gradient(stretch: Array, free: Array, mode: Mode) -> Array:
    F = np.zeros((len(stretch), 3, 3))
    F[:, 0, 0], F[:, 2, 2] = stretch, free
    F[:, 1, 1] = {"uniaxial": free, "equibiaxial": stretch, "planar": np.ones_like(stretch)}[mode]
    return F


def falling_stretches(solid: HomogeneousSolid, mode: Mode = "uniaxial") -> tuple[float | None, float | None]:
    """Return the stretches closest to 1 at which the nominal stress stops rising, in compression and in tension.

    None if it rises throughout `DOUBT_RANGES`; a specimen would neck or collapse at such a stretch.
    """
    found: list[float | None] = []
    for end in DOUBT_RANGES[mode]:
        stretch = np.geomspace(1.0, end, POINTS)
        stress, _, converged = _solved(solid, stretch, mode)
        rising = (np.diff(stress) * (end - 1) > 0) & converged[1:]
        found.append(None if np.all(rising) else float(stretch[np.argmin(rising)]))
    return found[0], found[1]


def stability_remarks(solid: HomogeneousSolid) -> tuple[str, ...]:
    """Return a sentence if these constants are unstable in a homogeneous test, else nothing."""
    places = []
    for mode in MODES:
        below, above = falling_stretches(solid, mode)
        if below is not None:
            places.append(f"below {below:.2f} ({mode})")
        if above is not None:
            places.append(f"above {above:.2f} ({mode})")
    if not places:
        return ()
    return (
        f"With the material's constants the nominal stress falls at stretches {', '.join(places)}: it is unstable "
        "there, and FEM states at such stretches fail or are unreliable.",
    )
