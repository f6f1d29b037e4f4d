"""The translational bellow as an `ActuatorFamily`, and its parameters."""

from __future__ import annotations

from typing import ClassVar, Literal

from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.records.law import JointKind
from pliant_plugins.families.bellow.module import MidSurfaceBellow, MidSurfaceConfig
from pliant_plugins.families.bellow.revolved import RevolvedCounts, sector


class BellowTranslationalConfig(MidSurfaceConfig):
    """A bellow whose wall is the mid-surface of radii r (trough) and 2R − r (crest) ± t/2.

    Which values make a valid design: `BellowProfile.mid_surface_needs`.
    """

    kind: Literal["bellow_translational"] = "bellow_translational"


class BellowTranslational(MidSurfaceBellow):
    """One design of the translational bellow.

    A module runs from mid-trough to mid-trough with its joint at mid-crest, on the tube's axis. The joint slides
    along x: u is the module's extension, τ a force. Both end sections stay plane and are free to breathe, as in
    the middle of a long bellow.
    """

    joint: ClassVar[JointKind] = "prismatic"
    axes: ClassVar[tuple[str, ...]] = ("x",)
    main_axis: ClassVar[str] = "x"

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Return half a module, a quarter of its section: u is twice its extension, the energy eight times its."""
        return self.piece(
            sector(self.geometry, self._counts(refinement), quarters=1),
            energy_scale=8.0,
            fixed={"start": (0,), "end": (0,), "symmetry": (1,), "level": (2,)},
        )

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        return sector(self.geometry, self._counts(refinement), quarters=2)

    def _counts(self, refinement: int) -> RevolvedCounts:
        """Return finer counts than for a bending bellow: stretching strains the whole circumference."""
        return RevolvedCounts.from_profile(self.geometry, refinement, arc=3, quarter=4)
