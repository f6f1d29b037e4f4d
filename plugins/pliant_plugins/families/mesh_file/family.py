"""A module from a mesh file as an `ActuatorFamily`, and its parameters."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from pliant.errors import InvalidDesignError, UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.meshing.masses import UNIFORM, half_masses, split_masses
from pliant.meshing.surfaces import half_boxes, half_skins, split_boxes, split_skins
from pliant.records.actuation import joined
from pliant.records.design import Design, ModuleMass
from pliant.records.fem import ModuleProblem
from pliant.records.shape import HalfShapes, HalfSurfaces
from pliant.units import Length
from pliant_plugins.families.mesh_file.building import FilePiece, Wanted, read_piece
from pliant_plugins.families.mesh_file.placing import rotation
from pliant_plugins.families.mesh_file.reading import require_file

Direction = Literal["x", "y", "z", "-x", "-y", "-z"]
DIGITS = 16  # of the file's digest


class MeshFileConfig(FamilyConfig):
    """A module, or the half of it toward the tip, as a volume mesh with named surfaces.

    `base` and `tip` are planes across the chain, `cavity` is the chamber's whole wall, `symmetry` the plane in which
    the other half of the width is the mirror image. The reference line runs along the chain through (`line_across`,
    `line_height`) in the file's frame; joint angles are about it.
    """

    kind: Literal["mesh_file"] = "mesh_file"
    file: Path = Field(description="volume mesh: gmsh .msh, VTK .vtu or .vtk (as SOFA has them), Abaqus .inp")
    unit: Literal["m", "cm", "mm", "in"] = Field(default="m", description="unit of the file's lengths")
    along: Direction = Field(default="x", description="the file's direction from base to tip")
    up: Direction = Field(
        default="z", description="the file's direction away from which pressure bends the tip (module z)"
    )
    part: Literal["whole", "half"] = Field(
        default="whole",
        description="whole: the mesh is a module from end to end; half: it is the half from the module's mid-plane, "
        "its base, to the tip, and the other half is its mirror image",
    )
    base: str = Field(default="base", description="name of the surface toward the chain's base")
    tip: str = Field(default="tip", description="name of the surface toward the chain's tip")
    cavity: str | tuple[str, ...] = Field(
        default="cavity",
        description="name of the chamber's wall; of several chambers a list, driven by pressure_1_pa, pressure_2_pa, …",
    )
    symmetry: str | None = Field(
        default=None,
        description="name of the mirror plane that holds the chain's direction and `up`, if the mesh is cut there",
    )
    regions: tuple[str, ...] = Field(
        default=(),
        description="names of the file's volumes that are of another material than the rest, each given under "
        "`material.regions`",
    )
    line_height_m: Length = Field(
        default=0.0, description="height of the reference line: the file's coordinate along `up`"
    )
    line_across_m: Length = Field(
        default=0.0,
        description="the same across the chain, along up × along; with `symmetry` the line lies in that plane",
    )

    @property
    def cavities(self) -> tuple[str, ...]:
        """Names of the chambers' walls."""
        return (self.cavity,) if isinstance(self.cavity, str) else self.cavity


class MeshFile(ActuatorFamily):
    """One file, solved as a module that bends about y under pressure.

    End sections stay plane, as they do where a module meets its mirror image. Across the width a module is symmetric: a
    mesh of the whole width is one that has not been cut. The file is read when the mesh is first asked for.
    """

    refines: ClassVar[bool] = False
    config: MeshFileConfig

    def __init__(self, config: MeshFileConfig) -> None:
        super().__init__(config)
        require_file(config.file)
        if not config.cavities or len(set(config.cavities)) < len(config.cavities):
            raise InvalidDesignError(
                f"family.cavity names {list(config.cavities)}; each chamber's wall has its own name."
            )
        if config.symmetry is not None and config.line_across_m:
            raise InvalidDesignError(
                f"family.line_across is {config.line_across_m:g} m, and with 'symmetry' the line lies in that plane; "
                "leave line_across out."
            )
        rotation(config.along, config.up)

    @property
    def design(self) -> Design:
        """The parameters, the file by its name and content."""
        known = super().design
        own: dict[str, Any] = {"file": self.config.file.name, "file_sha256": self._digest[:DIGITS]}
        own["regions"] = ",".join(self.config.regions) or None
        own["cavity"] = ",".join(self.config.cavities)
        return Design(known.family, {k: v for k, v in {**known.parameters, **own}.items() if v is not None})

    @cached_property
    def _digest(self) -> str:
        with self.config.file.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    @property
    def actuation(self) -> str:  # type: ignore[override]
        """One pressure, or one for each chamber."""
        count = len(self.config.cavities)
        return "pressure_pa" if count == 1 else joined(f"pressure_{k}_pa" for k in range(1, count + 1))

    @property
    def regions(self) -> tuple[str, ...]:  # type: ignore[override]
        """The file's volumes that the study names."""
        return self.config.regions

    @cached_property
    def piece(self) -> FilePiece:
        """The mesh, read and checked. Raises `UserError` and `InvalidDesignError`."""
        config = self.config
        wanted = Wanted(
            config.unit,
            config.along,
            config.up,
            config.base,
            config.tip,
            config.cavities,
            config.symmetry,
            config.regions,
            config.line_height_m,
            config.line_across_m,
        )
        return read_piece(config.file, wanted)

    @property
    def _half(self) -> bool:
        return self.config.part == "half"

    @property
    def module_length_m(self) -> float:
        return (2.0 if self._half else 1.0) * self.piece.span_m

    def remarks(self) -> tuple[str, ...]:
        """Return sentences on changes made to the mesh and on its defects."""
        return self.piece.remarks

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Return the piece between plane end sections, pinned on its start section against rigid motions."""
        if refinement != 1:
            raise UserError(
                f"family 'mesh_file' cannot refine: fem.refinement is {refinement}, the mesh is the file's; make a "
                "finer one."
            )
        piece = self.piece
        along, across = (2.0 if self._half else 1.0), (2.0 if piece.symmetric else 1.0)
        supports = {"symmetry": (1,), "pin": (2,)} if piece.symmetric else {"pin": (1, 2), "level": (1,)}
        return ModuleProblem(
            mesh=piece.mesh,
            span_m=piece.span_m,
            reference_z_m=0.0,
            deformation_scale=along,
            energy_scale=along * across,
            fixed={"start": (0,), "end": (0,), **supports},
            actuation=self.actuation,
        )

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Return masses of the two halves, by quadrature over the mesh and its mirror images."""
        piece = self.piece
        if self._half:
            return half_masses(piece.mesh, density_kg_m3, piece.symmetric, regions)
        return split_masses(piece.mesh, piece.span_m, density_kg_m3, piece.symmetric, regions)

    def surface(self) -> HalfSurfaces:
        """Return the skin of the mesh and its mirror images."""
        piece = self.piece
        if self._half:
            return half_skins(piece.mesh, piece.symmetric)
        return split_skins(piece.mesh, piece.span_m, piece.symmetric)

    def shapes(self) -> HalfShapes:
        """Return the boxes around the two halves."""
        piece = self.piece
        return half_boxes(piece.mesh, piece.symmetric) if self._half else split_boxes(self.surface())
