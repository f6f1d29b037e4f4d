"""The helical bellow as an `ActuatorFamily`, and its parameters.

The inner constraint as a body is the rod that the study's masses contain. Its diameter is R − t and it touches the line
at the distance r below the tube's axis. That gives the published module masses within 0.06 %, if its volume inside the
wall is counted once; as a solid its stiffness does not fit, so that the FEM represents the constraint by its line,
width and stiffness alone. Its mass is that of the part of the rod inside the cavity.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.families import Need
from pliant.meshing.masses import UNIFORM, mirrored
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant.records.fem import Closing, ModuleMesh, ModuleProblem, Ribbon
from pliant.records.law import JointKind
from pliant.units import Force, Length
from pliant_plugins.families.bellow.module import MidSurfaceBellow, MidSurfaceConfig
from pliant_plugins.families.bellow.profile import BellowProfile
from pliant_plugins.families.bellow.revolved import RevolvedCounts, ring, sector

OFFSET = 0.825  # of r
WIDTH = 0.65  # of the rod's chord
ALL = ("x", "y", "z")
# Share of its length that the outermost fibre keeps: with less, stiffness rises a hundredfold within 0.05 rad.
CLOSED = 0.15
ALONG, AROUND, ACROSS = 24, 256, 4  # quadrature points in x (each of two parts), φ and radius
ALONG_RULE, ACROSS_RULE = (np.polynomial.legendre.leggauss(n) for n in (ALONG, ACROSS))


class BellowHelicalConfig(MidSurfaceConfig):
    """A bellow of mid-surface radii r (trough) and 2R − r (crest), wall ± t/2, with a constraint along one side.

    The constraint's shape is not published. Its distance from the tube's axis and its stiffness are fitted to the
    published bending data of one design, on its free curve and its moments at 15 kPa, its width to the bending about
    z at 15 kPa. See `benchmarks/families/helical.py`. Which values make a valid design is the family's own check.
    """

    kind: Literal["bellow_helical"] = "bellow_helical"
    constraint_offset_m: Length | None = Field(
        default=None,
        description=f"distance of the constraint from the tube's axis; {OFFSET} r unless given",
    )
    constraint_width_m: Length | None = Field(
        default=None,
        description=f"width of the constraint along y, which stiffens bending about z; unless given, {WIDTH} of the "
        "study's rod (diameter R − t, touching the line at r) at the constraint's height",
    )
    constraint_stiffness_n: Force = Field(
        default=60.0, description="EA: force per strain of the constraint; 40 to 100 N fit alike"
    )
    crest: Literal["rigid", "free"] = Field(
        default="rigid",
        description="rigid: the crest's section stays plane and keeps its shape, as the troughs' do; free: it may "
        "breathe and warp",
    )
    twist_pivot: Literal["hinge", "free"] = Field(
        default="hinge",
        description="hinge: end sections turn about the constraint's line, as a chain's joint does; free: they may "
        "also shift along y",
    )


class BellowHelical(MidSurfaceBellow):
    """One design of the helical bellow.

    A module runs from mid-trough to mid-trough. Its joint is at mid-crest on the constraint's line, which is the
    module frame's x axis and the reference line of the FEM: there bending leaves the length unchanged. The study's
    chain puts its hinge at r from the tube's axis; the fitted constraint is slightly nearer (0.825 r), and the joint
    follows the FEM. The chain's centre line, the tube's axis, is `offset_m` above.

    Sections at mid-trough and mid-crest stay plane and keep their shape, as between rigid connectors: of the end
    conditions tried this one reproduces the published bending curves (benchmarks/families/helical.py). The constraint
    fixes the troughs to its line; crests shift across it freely.
    """

    joint: ClassVar[JointKind] = "spherical"
    axes: ClassVar[tuple[str, ...]] = ALL
    main_axis: ClassVar[str] = "y"
    config: BellowHelicalConfig

    def needs(self) -> Iterator[Need]:
        """Yield the profile's conditions and those that keep the constraint inside the trough."""
        yield from super().needs()
        outer, offset = self.geometry.inner_radius_m + self.geometry.wall_m / 2, self.offset_m
        yield Need("constraint_offset < inner_radius + wall/2 (it lies within the trough)", offset, outer)
        if (width := self.config.constraint_width_m) is not None:
            chord = 2 * float(np.sqrt(outer**2 - offset**2))
            trough = "constraint_width ≤ the trough's outer circle at the constraint's height"
            yield Need(trough, width, chord)
        yield Need("constraint_stiffness > 0", self.config.constraint_stiffness_n, 0.0, "N")

    @property
    def offset_m(self) -> float:
        """Height of the tube's axis above the joint: the constraint's distance from it."""
        given = self.config.constraint_offset_m
        return OFFSET * self.geometry.inner_radius_m if given is None else given

    @property
    def constraint_width_m(self) -> float:
        """Width of the constraint along y: as given, or a share of the rod at its height (0 outside the rod)."""
        if self.config.constraint_width_m is not None:
            return self.config.constraint_width_m
        return WIDTH * rod_chord(self.geometry, self.offset_m)

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Return the FEM problem: for y alone half a module, half its width; otherwise the whole module from trough to
        trough.

        The half, x ∈ [0, l/2] from mid-crest, y ≥ 0, turns by half the joint's angle and has a quarter of its energy.
        The whole module is meshed from x = 0 at its start, l/2 before the joint. Its end section either turns about the
        joint's line or, with `twist_pivot` free, may also shift along y as one.
        """
        return self._half_module(refinement) if axes == ("y",) else self._whole(refinement, axes or ALL)

    @property
    def _rigid_crest(self) -> bool:
        return self.config.crest == "rigid"

    def _half_module(self, refinement: int) -> ModuleProblem:
        return self.piece(
            self.mesh(refinement),
            axes=("y",),
            fixed={"start": (0, 1) if self._rigid_crest else (0,), "end": (0, 1, 2), "symmetry": (1,)},
            tied={"start": (2,)} if self._rigid_crest else {},
            ribbons=(Ribbon(self.constraint_width_m / 2, self.config.constraint_stiffness_n / 2),),
            contact_range=self._closing.range,
            closing=self._closing,
        )

    def _whole(self, refinement: int, axes: tuple[str, ...]) -> ModuleProblem:
        hinged = self.config.twist_pivot == "hinge"
        fixed: dict[str, tuple[int, ...]] = {"start": (0, 1, 2), "end": (0, 1, 2) if hinged else (0, 2)}
        tied: dict[str, tuple[int, ...]] = {} if hinged else {"end": (1,)}
        if self._rigid_crest:
            fixed, tied = {**fixed, "crest": (0,)}, {**tied, "crest": (1, 2)}
        return self.piece(
            ring(self.geometry, RevolvedCounts.from_profile(self.geometry, refinement), self.offset_m),
            span_m=self.module_length_m,
            deformation_scale=1.0,
            energy_scale=1.0,
            fixed=fixed,
            tied=tied,
            axes=axes,
            ribbons=(Ribbon(self.constraint_width_m, self.config.constraint_stiffness_n),),
            contact_range=self._closing.range,
            closing=self._closing,
        )

    @property
    def _closing(self) -> Closing:
        """Return the limit at which the outermost fibre has the share `CLOSED` of its length; beyond it the module
        locks.
        """
        outer = 2 * self.config.average_radius_m - self.config.inner_radius_m + self.config.wall_m
        return Closing(outer, self.offset_m, (1 - CLOSED) * self.module_length_m)

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        counts = RevolvedCounts.from_profile(self.geometry, refinement)
        return sector(self.geometry, counts, quarters=2, axis_height_m=self.offset_m)

    @property
    def unmeshed_volume_m3(self) -> float:
        """The constraint's part inside the cavity, as the study's masses have it."""
        return float(2 * thread_points(self.geometry)[1].sum())

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Return masses of the two halves: the wall by quadrature over the mesh, and the constraint."""
        wall = super().mass(density_kg_m3, regions)
        thread = thread_mass(self.geometry, density_kg_m3, self.offset_m)
        return ModuleMass(wall.start.joined(thread.start), wall.end.joined(thread.end))


def rod_chord(profile: BellowProfile, depth_m: float) -> float:
    """Return width (m) of the rod along y at a distance below the tube's axis, 0 outside it."""
    radius = (profile.average_radius_m - profile.wall_m) / 2
    above = depth_m - (profile.inner_radius_m - radius)
    return float(2 * np.sqrt(max(radius**2 - above**2, 0.0)))


def thread_points(profile: BellowProfile) -> tuple[Array, Array]:
    """Return the quadrature of the rod inside the cavity, x ∈ [0, l/2]: points (n, 3) from its axis, volumes (n,)."""
    x, dx, phi, low, high = _rays(profile)
    node, weight = ACROSS_RULE
    thick = (high - low)[..., None]
    rho = low[:, None] + thick * (node + 1) / 2
    volume = dx[:, None, None] * (2 * np.pi / AROUND) * rho * thick * weight / 2
    places = np.broadcast_arrays(x[:, None, None], rho * np.sin(phi)[:, None], -rho * np.cos(phi)[:, None])
    points = np.stack(places, axis=-1)
    return points.reshape(-1, 3), volume.ravel()


def thread_mass(profile: BellowProfile, density_kg_m3: float, axis_height_m: float) -> ModuleMass:
    """Return masses of the rod's part inside the cavity, by halves, in the module frame.

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
    """Return x (i,) with its weights dx (i,), φ (j,), and the start (j,) and end (i, j) of the rod on each ray.

    On the ray at the angle φ from the axis' lower side the rod is between the roots of
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
