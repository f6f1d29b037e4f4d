"""What of a chain does not move, and the loads on it, as arrays that compiled loops read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array

KINDS = ("revolute", "spherical", "prismatic")


@dataclass(frozen=True, eq=False)
class Body:
    """Kind of joint, its axes (a,), position, base rotation, offsets, rest rotations, arms, masses.

    `arms` and `masses` have n + 1 entries: the moving bodies' centres of mass, then the tip without a mass.
    """

    kind: int
    axes: Any
    main: int
    position: Array
    rotation: Array
    offsets: Array
    rests: Array
    arms: Array
    masses: Array

    @staticmethod
    def of(chain: ChainModel) -> Body:
        geometry = ChainGeometry.of(chain)
        moving = chain.bodies[1:]
        return Body(
            kind=KINDS.index(geometry.kind),
            axes=np.argmax(geometry.basis, axis=0).astype(np.int64),
            main=geometry.main,
            position=_plain(geometry.base_position),
            rotation=_plain(geometry.base_rotation),
            offsets=_plain(geometry.offsets),
            rests=_plain(geometry.rest_rotations),
            arms=np.array([*(b.com_m for b in moving), chain.tip_offset_m], float),
            masses=np.array([*(b.mass_kg for b in moving), 0.0], float),
        )

    @property
    def arrays(self) -> tuple[Any, ...]:
        """What the compiled statics take, in the order of the fields."""
        return (
            self.kind,
            self.axes,
            self.main,
            self.position,
            self.rotation,
            self.offsets,
            self.rests,
            self.arms,
            self.masses,
        )


def load_arrays(loads: Loads, pressures: Array, payload_kg: float) -> tuple[Any, ...]:
    """What the compiled statics take: pressures (k,), gravity, tip force, moment, payload, forces, cords.

    Forces are bodies (m,), points (m, 3) and forces (m, 3); cords bodies, points, pulleys and tensions (c,).
    """
    return (
        pressures,
        _plain(loads.gravity_m_s2),
        _plain(loads.tip_force_n),
        float(loads.moment_n_m),
        float(payload_kg),
        _bodies(loads.forces),
        _rows([f.point_m for f in loads.forces]),
        _rows([f.force_n for f in loads.forces]),
        _bodies(loads.cords),
        _rows([c.point_m for c in loads.cords]),
        _rows([c.pulley_m for c in loads.cords]),
        np.array([c.tension_n for c in loads.cords], float),
    )


def _plain(values: Array) -> Array:
    """A copy: contiguous and writable, because numba compiles anew for arrays that are not."""
    return np.array(values, float, order="C")


_NO_ROWS, _NO_BODIES = np.zeros((0, 3)), np.zeros(0, np.int64)


def _rows(vectors: list[Array]) -> Array:
    return np.array(vectors, float) if vectors else _NO_ROWS


def _bodies(loads: Any) -> Any:
    return np.array([load.body for load in loads], np.int64) if loads else _NO_BODIES
