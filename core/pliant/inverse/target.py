"""Targets of a robot as residuals of an equilibrium, with their slopes by the actuations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.inverse.clearance import Clearance
from pliant.records.design import Array
from pliant.records.rollout import Response


@dataclass(frozen=True, eq=False)
class Target:
    """A tip position, a direction of the tip, a whole backbone, or several of them; a force that the tip exerts.

    Attributes:
        tip_m: (3,) in the world.
        direction: (3,) of the tip's x axis in the world; only its direction counts.
        backbone_m: (n + 2, 3) base, joints and tip.
        push_n: (3,) force that the robot exerts on what it touches: it settles under the reaction, −push.
        turn_m: length that one radian of direction counts as; None: the chain's length.
        clearance: the distance to keep from obstacles; a missing metre counts as `Clearance.weight` metres.
    """

    tip_m: Array | None = None
    direction: Array | None = None
    backbone_m: Array | None = None
    push_n: Array | None = None
    turn_m: float | None = None
    clearance: Clearance | None = None

    def checked(self, n_joints: int) -> Target:
        """Return the target with a unit direction and arrays.

        Raises:
            UserError: an empty target, a wrong shape, or values that are not finite numbers.
        """
        shapes = {"tip_m": (3,), "direction": (3,), "push_n": (3,), "backbone_m": (n_joints + 2, 3)}
        found: dict[str, Array] = {}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is None:
                continue
            array = np.array(value, float)
            if array.shape != shape or not np.isfinite(array).all():
                raise UserError(
                    f"a target's {name} needs {' x '.join(map(str, shape))} finite numbers, not {value}."
                )
            found[name] = array
        if not found.keys() - {"push_n"}:
            raise UserError(
                "a target needs 'tip_m', 'direction' or 'backbone_m': a force alone is given anywhere."
            )
        if "direction" in found:
            length = float(np.linalg.norm(found["direction"]))
            if length == 0.0:
                raise UserError("a target's direction is zero; give three numbers such as [1, 0, 0].")
            found["direction"] = found["direction"] / length
        return Target(**found, turn_m=self.turn_m, clearance=self.clearance)

    def residual(self, response: Response, turn_m: float) -> tuple[Array, Array]:
        """Return r (m,) in m, whose length is the distance, and ∂r/∂p (m, k)."""
        parts, slopes = [], []
        if self.tip_m is not None:
            parts.append(response.markers_m[-1] - self.tip_m)
            slopes.append(response.by_input[:, -1].T)
        if self.direction is not None:
            axis = response.tip_rotation[:, 0]
            parts.append(turn_m * (axis - self.direction))
            slopes.append(turn_m * np.cross(response.tip_spin, axis).T)
        if self.backbone_m is not None:
            share = 1.0 / np.sqrt(len(self.backbone_m) - 1)  # the base does not move: RMS over the others
            parts.append(share * (response.markers_m - self.backbone_m).ravel())
            slopes.append(share * response.by_input.reshape(len(response.by_input), -1).T)
        if self.clearance is not None:
            missing, slope = self.clearance.residual(response.markers_m, response.by_input)
            parts.append(missing)
            slopes.append(slope)
        if len(parts) == 1:
            return parts[0], slopes[0]
        return np.concatenate(parts), np.concatenate(slopes)
