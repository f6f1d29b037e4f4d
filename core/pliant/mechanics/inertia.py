"""Inertia of a chain in joint coordinates, and the fastest rates that an explicit engine must resolve."""

from __future__ import annotations

import numpy as np

from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties


def regular(piece: MassProperties, mass_floor_kg: float, inertia_floor_kg_m2: float) -> MassProperties:
    """Return a piece with mass and inertia raised to small floors for a dynamics engine.

    A share of the inertia's trace ensures the triangle inequality for slender pieces.
    """
    inertia = np.asarray(piece.inertia_kg_m2, float)
    floor = inertia_floor_kg_m2 + 1e-9 * float(np.trace(inertia))
    return MassProperties(max(piece.mass_kg, mass_floor_kg), piece.com_m, inertia + floor * np.eye(3))


def mass_matrix(chain: ChainModel, q: Array) -> Array:
    """Return (n·a, n·a) mass matrix at joint coordinates q (n, a), payload included."""
    geometry = ChainGeometry.from_chain(chain)
    pose = geometry.forward(q)
    n, a = q.shape
    pieces = [*chain.bodies[1:], MassProperties(chain.payload_kg, chain.tip_offset_m, np.zeros((3, 3)))]
    body = np.minimum(np.arange(1, n + 2), n)
    rotations = pose.rotations[body]
    points = pose.origins[body] + np.einsum("kij,kj->ki", rotations, np.array([p.com_m for p in pieces]))
    moves = np.arange(n)[None, :] < body[:, None]
    spin = np.where(moves[:, :, None, None], pose.directions[None], 0.0)
    if geometry.turns:
        arms = points[:, None, :] - pose.pivots[None]
        velocity = np.cross(spin, arms[..., None], axisa=2, axisb=2, axisc=2)
        if geometry.slide is not None:
            velocity[..., geometry.slide] = spin[..., geometry.slide]
            spin[..., geometry.slide] = 0.0
    else:
        velocity, spin = spin, np.zeros_like(spin)
    inertia = rotations @ np.array([p.inertia_kg_m2 for p in pieces]) @ rotations.transpose(0, 2, 1)
    mass = np.array([p.mass_kg for p in pieces])
    matrix = np.einsum("k,kixa,kjxb->iajb", mass, velocity, velocity, optimize=True)
    matrix += np.einsum("kixa,kxy,kjyb->iajb", spin, inertia, spin, optimize=True)
    return matrix.reshape(n * a, n * a)


def longest_explicit_step(mass: Array, stiffness: Array, damping: float, courant: float = 0.5) -> float:
    """Return the step (s) that resolves the fastest oscillation and the fastest decay: courant / max(ω, rate)."""
    inverse = np.linalg.inv(mass)
    fastest = float(np.abs(np.linalg.eigvals(inverse @ stiffness)).max()) ** 0.5
    decay = damping * float(np.linalg.eigvalsh(0.5 * (inverse + inverse.T))[-1])
    return courant / max(fastest, decay, 1e-12)
