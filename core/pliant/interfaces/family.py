"""ActuatorFamily: a parameterised actuator module."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.meshing.masses import UNIFORM
from pliant.meshing.surfaces import half_boxes, half_skins
from pliant.records.design import Design, ModuleMass
from pliant.records.fem import ModuleProblem
from pliant.records.law import JointKind
from pliant.records.shape import HalfShapes, HalfSurfaces
from pliant.records.structure import StructureProblem
from pliant.units import Ratio


class FamilyConfig(ComponentConfig):
    """Base of a family's config: its design parameters, SI, unit in the name, and how a module is drawn."""

    visual: Path | None = Field(
        default=None,
        description="STL of one module, drawn and exported instead of the family's surface; results are the same",
    )
    visual_scale: Ratio = Field(
        default=1.0, gt=0, description="the file's lengths times this are metres; 0.001 for millimetres"
    )

    def canonical(self) -> dict[str, Any]:
        """The design: without what is only drawn, so that a picture changes no result and no key."""
        return self.model_dump(mode="json", exclude={"visual", "visual_scale"})


class ActuatorFamily(Configured[FamilyConfig]):
    """One design of a family: geometry, validity, mesh, masses.

    Called by the pipeline: `__init__` when a study is read (it must be cheap and must raise
    `pliant.errors.InvalidDesignError` with the inequality and by how much it is broken), `problem` by the FEM
    stage, `mass` by the chain stage. Module frame: x along the chain toward the tip, bending about y, origin
    at the joint's line; positive actuation turns the tip toward −z.
    """

    joint: ClassVar[JointKind] = "revolute"
    axes: ClassVar[tuple[str, ...]] = ("y",)
    main_axis: ClassVar[str] = "y"
    actuation: ClassVar[str] = "pressure_pa"  # or "tendon_force_n"
    refines: ClassVar[bool] = True  # False: `problem` refuses any other refinement than 1
    # Names of the mesh's regions, each of a material of its own; a family that knows them by its config overrides this.
    regions: tuple[str, ...] = ()

    @property
    def design(self) -> Design:
        """The design's parameters as a record."""
        parameters = self.config.canonical()
        return Design(family=parameters.pop("kind"), parameters=parameters)

    @property
    @abstractmethod
    def module_length_m(self) -> float:
        """Length l of one module along the chain."""

    @property
    def offset_m(self) -> float:
        """How far the chain's centre line lies from the joint, along module z; 0 where the joint is on it."""
        return 0.0

    @property
    def unmeshed_volume_m3(self) -> float:
        """Volume of the module's own material that the solved piece leaves out, such as a thread inside; in `mass`."""
        return 0.0

    @abstractmethod
    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """The boundary-value problem of one module.

        Args:
            refinement: multiplies the elements along each edge; a family that cannot (`refines = False`) raises
                `UserError` for any other than 1.
            axes: the axes that shall move, the main one among them, all others staying at zero: a family of
                several axes may then solve a smaller piece. By default all of them.
        """

    def remarks(self) -> tuple[str, ...]:
        """What the user should know of the design, a sentence each; said once, where its FEM data are made."""
        return ()

    def structure(self, modules: int, refinement: int = 1) -> StructureProblem:
        """Several modules as one body, clamped at the base, closed at the tip, for direct FEM of a chain.

        Raises `UserError` for a family that builds none.
        """
        raise UserError(f"family '{self.design.family}' builds no bodies of several modules.")

    def shapes(self) -> HalfShapes:
        """Convex collision shapes of the two halves; the boxes around them unless the family knows better."""
        return half_boxes(self.problem().mesh)

    def surface(self) -> HalfSurfaces:
        """Outer surface of the two halves at rest, for pictures and STL; the skin of the mesh by default."""
        return half_skins(self.problem().mesh)

    @abstractmethod
    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Masses of the two halves about the joint at mid-module, in the module frame.

        `regions` are the densities of the family's regions; it is given where there are any.
        """
