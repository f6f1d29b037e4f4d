"""Fixed obstacles as a task states them: boxes, spheres and parts from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from pliant.config.chain import Count
from pliant.errors import UserError
from pliant.interfaces.base import FrozenModel
from pliant.mechanics.contact_statics import with_capsules
from pliant.mechanics.rotations import matrix_from_quaternion
from pliant.mechanics.signed_distance import Solid, solid_from_shape
from pliant.meshing.surfaces import support
from pliant.records.chain import ChainModel
from pliant.records.scene import Obstacle
from pliant.records.shape import Shape
from pliant.units import Length, Ratio
from pliant_plugins.solids import convex_parts, read_solid


class ObstacleConfig(FrozenModel):
    """A fixed body: ``{box: [20 mm, 40 mm, 10 mm], position: [30 mm, 0 mm, -50 mm]}``, a `sphere` or a `mesh`."""

    box_m: tuple[Length, Length, Length] | None = Field(
        default=None, description="its three edges; this, `sphere` or `mesh`"
    )
    sphere_m: Length | None = Field(default=None, gt=0, description="its radius")
    mesh: Path | None = Field(default=None, description="a closed surface: STL, OBJ, PLY or OFF")
    scale: Ratio = Field(
        default=1.0, gt=0, description="metres per unit of the file: 0.001 where it is in millimetres"
    )
    convex_parts: Count = Field(
        default=1,
        ge=1,
        le=64,
        description="of a mesh: most convex parts that collide in its place; 1: its hull",
    )
    position_m: tuple[Length, Length, Length] = Field(
        default=(0.0, 0.0, 0.0), description="of its centre, or of the mesh's origin, in the world"
    )
    quaternion: tuple[Ratio, Ratio, Ratio, Ratio] = Field(
        default=(1.0, 0.0, 0.0, 0.0), description="w, x, y, z"
    )

    @model_validator(mode="after")
    def _one_shape(self) -> ObstacleConfig:
        given = [name for name in ("box_m", "sphere_m", "mesh") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError("give one of 'box', 'sphere' and 'mesh'")
        if self.box_m is not None and min(self.box_m) <= 0.0:
            raise ValueError("the edges of a 'box' are above 0")
        if self.mesh is None and (self.scale != 1.0 or self.convex_parts != 1):
            raise ValueError("'scale' and 'convex_parts' are for a 'mesh'")
        if np.linalg.norm(self.quaternion) < 1e-9:
            raise ValueError("'quaternion' has no length")
        return self

    def record(self, name: str, friction: float) -> Obstacle:
        """Return the obstacle at its place.

        Raises:
            UserError: a mesh that cannot be used.
        """
        place = np.array(self.position_m, float)
        turn = matrix_from_quaternion(np.array(self.quaternion, float) / np.linalg.norm(self.quaternion))
        if self.sphere_m is not None:
            shapes = [Shape("sphere", (self.sphere_m,), np.zeros(3), np.eye(3))]
        elif self.box_m is not None:
            half = tuple(0.5 * edge for edge in self.box_m)
            shapes = [Shape("box", half, np.zeros(3), np.eye(3))]
        else:
            assert self.mesh is not None
            hulls = convex_parts(read_solid(self.mesh, self.scale), self.convex_parts)
            shapes = [Shape("mesh", (), np.zeros(3), np.eye(3), hull.surface) for hull in hulls]
        return Obstacle(name, tuple(shape.placed(turn, place) for shape in shapes), friction)


def solids(obstacles: tuple[Obstacle, ...]) -> tuple[Solid, ...]:
    """Return all shapes of the obstacles as solids with a signed distance."""
    return tuple(solid_from_shape(shape) for obstacle in obstacles for shape in obstacle.shapes)


def capsule_radius_m(chain: ChainModel, given: float | None, task: str) -> float:
    """Return the radius of the capsules that collide: the given one, else the chain's largest half width.

    Raises:
        UserError: no radius is given and the chain has no shapes.
    """
    if given is not None:
        return given
    across = [sign * axis for axis in np.eye(3)[1:] for sign in (1.0, -1.0)]
    widths = [support(shape, way) for shapes in chain.shapes[1:] for shape in shapes for way in across]
    if not widths:
        raise UserError(
            f"task '{task}': the chain has no collision shapes; give the task a 'radius', the study a 'family' block, "
            "or the chain a 'module_radius'."
        )
    return max(widths)


def rounded(chain: ChainModel, given: float | None, task: str) -> ChainModel:
    """Return the chain with capsules as collision shapes; see `capsule_radius_m`."""
    return with_capsules(chain, capsule_radius_m(chain, given, task))
