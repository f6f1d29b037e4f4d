"""ActuatorFamily: a parameterised actuator module."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.interfaces.material import Material
from pliant.meshing.masses import UNIFORM
from pliant.meshing.surfaces import half_boxes, half_skins
from pliant.records.design import Design, ModuleMass
from pliant.records.fem import ModuleProblem
from pliant.records.law import JointKind, JointLaw
from pliant.records.shape import HalfShapes, HalfSurfaces
from pliant.records.structure import StructureProblem
from pliant.units import Ratio


class FamilyConfig(ComponentConfig):
    """Base of a family's config: design parameters, SI, unit in the name, and the drawing of a module."""

    visual: Path | None = Field(
        default=None,
        description="STL of one module, drawn and exported instead of the family's surface; results are the same",
    )
    visual_scale: Ratio = Field(
        default=1.0, gt=0, description="the file's lengths times this are metres; 0.001 for millimetres"
    )

    @model_validator(mode="after")
    def _check_visual_scale(self) -> Self:
        if self.visual is None and self.visual_scale != 1.0:
            raise ValueError(
                "'visual_scale' is of the file that 'visual' names: give 'visual', or leave it out"
            )
        return self

    def canonical(self) -> dict[str, Any]:
        """Return the design without keys of the drawing, so that pictures affect neither results nor keys."""
        return self.model_dump(mode="json", exclude={"visual", "visual_scale"})


class ActuatorFamily(Configured[FamilyConfig]):
    """One design of a family: geometry, validity, masses, and a mesh or a law in closed form.

    Called by the pipeline: `__init__` when a study is read (it must be cheap and must raise
    `pliant.errors.InvalidDesignError` with the inequality and its violation), `problem` by the FEM
    stage, `mass` by the chain stage. Module frame: x along the chain toward the tip, bending about y, origin
    at the joint's line; positive actuation turns the tip toward −z.
    """

    joint: ClassVar[JointKind] = "revolute"
    axes: ClassVar[tuple[str, ...]] = ("y",)
    main_axis: ClassVar[str] = "y"
    actuation: ClassVar[str] = "pressure_pa"  # or "tendon_force_n"
    refines: ClassVar[bool] = True  # False: `problem` refuses any refinement other than 1
    # Names of the mesh's regions, each with its own material; a family whose config determines them overrides this.
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
        """Distance of the chain's centre line from the joint, along module z; 0 if the joint is on it."""
        return 0.0

    @property
    def unmeshed_volume_m3(self) -> float:
        """Volume of the module's material that the solved piece omits, such as a thread inside; included in `mass`."""
        return 0.0

    def closed_form(self, material: Material | None) -> JointLaw | None:
        """Return the joint law in closed form; None if there is no closed form and the law is fitted to FEM.

        A study without `fem` and `surrogate` blocks uses it.

        Args:
            material: of the study; None without a `material` block.

        Raises:
            UserError: a material for which the form is not valid, or a missing material.
        """
        return None

    @property
    def has_mesh(self) -> bool:
        """Return whether the family has a `problem` to solve; a family with a closed form need not have one."""
        return type(self).problem is not ActuatorFamily.problem

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Return the boundary-value problem of one module; a family whose law is a closed form need not have one.

        Args:
            refinement: multiplies the elements along each edge; a family without refinement (`refines = False`) raises
                `UserError` for values other than 1.
            axes: the axes that move, including the main one; all others stay at zero, so that a family of several
                axes may solve a smaller piece. By default all axes.

        Raises:
            UserError: a family without a mesh.
        """
        raise UserError(
            f"family '{self.design.family}' has no mesh: its law is a closed form; leave the 'fem' block out."
        )

    def remarks(self) -> tuple[str, ...]:
        """Return sentences that the user should know about the design; shown once, with its FEM data."""
        return ()

    def structure(self, modules: int, refinement: int = 1) -> StructureProblem:
        """Return several modules as one body, clamped at the base, closed at the tip, for direct FEM of a chain.

        Raises `UserError` for a family without such a body.
        """
        raise UserError(f"family '{self.design.family}' builds no bodies of several modules.")

    def shapes(self) -> HalfShapes:
        """Return convex collision shapes of the two halves; by default bounding boxes, none without a mesh."""
        if not self.has_mesh:
            return HalfShapes((), ())
        return half_boxes(self.problem().mesh)

    def surface(self) -> HalfSurfaces:
        """Return the outer surface of the two halves at rest, for pictures and STL; by default the skin of the mesh."""
        return half_skins(self.problem().mesh)

    @abstractmethod
    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Return the masses of the two halves about the joint at mid-module, in the module frame.

        `regions` are the densities of the family's regions, given if it has regions.
        """
