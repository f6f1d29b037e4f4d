"""The inner constraint as a body: the rod that the study's masses hold.

Its diameter is R − t and it touches the line at the distance r below the tube's axis. That gives the published
module masses within 0.06 %, counting what lies in the wall once; as a solid its stiffness does not fit, so that the
FEM knows the constraint by its line, width and stiffness alone. Here: the part of the rod inside the cavity.
"""

from __future__ import annotations

import numpy as np

from pliant.meshing.masses import mirrored
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant_plugins.families.bellow.profile import BellowProfile

ALONG, AROUND, ACROSS = 24, 256, 4  # quadrature points in x (each of two parts), φ and radius
ALONG_RULE, ACROSS_RULE = (np.polynomial.legendre.leggauss(n) for n in (ALONG, ACROSS))


def rod_chord(profile: BellowProfile, depth_m: float) -> float:
    """Width (m) of the rod along y at a distance below the tube's axis, 0 outside it."""
    radius = (profile.average_radius_m - profile.wall_m) / 2
    above = depth_m - (profile.inner_radius_m - radius)
    return float(2 * np.sqrt(max(radius**2 - above**2, 0.0)))


def thread_points(profile: BellowProfile) -> tuple[Array, Array]:
    """Quadrature of the rod's part inside the cavity, x ∈ [0, l/2]: points (n, 3) from its axis, volumes (n,)."""
    x, dx, phi, low, high = _rays(profile)
    node, weight = ACROSS_RULE
    thick = (high - low)[..., None]
    rho = low[:, None] + thick * (node + 1) / 2
    volume = dx[:, None, None] * (2 * np.pi / AROUND) * rho * thick * weight / 2
    places = np.broadcast_arrays(x[:, None, None], rho * np.sin(phi)[:, None], -rho * np.cos(phi)[:, None])
    points = np.stack(places, axis=-1)
    return points.reshape(-1, 3), volume.ravel()


def thread_mass(profile: BellowProfile, density_kg_m3: float, axis_height_m: float) -> ModuleMass:
    """Masses of the rod's part inside the cavity, by halves, in the module frame.

    The moments along each ray are in closed form: those of `thread_points`, whose rule is exact for them.
    """
    x, dx, phi, low, high = _rays(profile)
    weight = density_kg_m3 * 2 * np.pi / AROUND * dx
    # ∫ ρ dρ, ∫ ρ² dρ and ∫ ρ³ dρ of each ray, (x, φ); y = ρ sin φ, z = −ρ cos φ
    whole, first, square = ((high**n - low**n) / n for n in (2, 3, 4))
    along, sine, cosine = whole.sum(axis=1), np.sin(phi), -np.cos(phi)
    mass = float(weight @ along)
    com = np.array([(weight * x) @ along, weight @ (first @ sine), weight @ (first @ cosine)]) / mass
    second = np.zeros((3, 3))
    second[0, 0] = (weight * (x - com[0]) ** 2) @ along
    second[1, 1] = weight @ (square @ sine**2)
    second[2, 2] = weight @ (square @ cosine**2)
    second[0, 1] = (weight * (x - com[0])) @ (first @ sine)
    second[0, 2] = (weight * (x - com[0])) @ (first @ cosine)
    second[1, 2] = weight @ (square @ (sine * cosine))
    second += np.triu(second, 1).T
    second[1:, 1:] -= mass * np.outer(com[1:], com[1:])
    com = com + np.array([0.0, 0.0, axis_height_m])
    end = MassProperties(mass, com, np.trace(second) * np.eye(3) - second)
    return ModuleMass(start=mirrored(end, 0), end=end)


def _rays(profile: BellowProfile) -> tuple[Array, Array, Array, Array, Array]:
    """x (i,) with its weights dx (i,), φ (j,), and where the rod begins (j,) and ends (i, j) on each ray.

    On the ray at the angle φ from the axis' lower side the rod lies between the roots of
    ρ² − 2 ρ c cos φ + c² = q², c the depth of its centre and q its radius; the wall's inner radius cuts it off.
    """
    radius = (profile.average_radius_m - profile.wall_m) / 2
    depth = profile.inner_radius_m - radius
    node, weight = ALONG_RULE
    # the profile's slope is infinite where the crest's arc meets the flank: parts end there
    bend = profile.arc_radius_m - profile.wall_m / 2
    ends = np.array([[0.0, bend], [bend, profile.half_length_m]])
    lengths = np.diff(ends, axis=1)
    x, dx = (ends[:, :1] + lengths * (node + 1) / 2).ravel(), (lengths * weight / 2).ravel()
    phi = 2 * np.pi * (np.arange(AROUND) + 0.5) / AROUND
    middle = depth * np.cos(phi)
    reach = np.sqrt(np.maximum(radius**2 - (depth * np.sin(phi)) ** 2, 0.0))
    low = np.maximum(middle - reach, 0.0)
    inner = profile.radius_at(x, -profile.wall_m / 2)
    high = np.maximum(np.minimum(inner[:, None], middle + reach), low)
    return x, dx, phi, low, high
