"""A correct viewer that marks the joints as dots, and viewers that break one rule each."""

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.errors import UserError
from pliant.interfaces.viewer import Handle, Picture, View, Viewer, ViewerConfig
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.motion import Motion
from pliant.registry.component import Component

PIXELS_PER_M = 1500.0


class DotsConfig(ViewerConfig):
    """The config of a viewer without settings."""

    kind: Literal["small"] = "small"


class Dots(Viewer):
    """A black square of 5 pixels for every marker, seen along world y."""

    shift = 0
    """Pixels that the camera moves from frame to frame."""

    def pictures(self, motion: Motion, size: tuple[int, int], view: View) -> Iterator[Picture]:
        geometry = ChainGeometry.from_chain(motion.scene.arms[0].chain)
        for number, q in enumerate(motion.frames.coordinates[0]):
            picture = np.full((size[1], size[0], 3), 255, np.uint8)
            for x, _, z in (geometry.markers(q) * PIXELS_PER_M).astype(int):
                row, column = -z + 5, x + size[0] // 2 + number * self.shift
                picture[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3] = 0
            yield picture

    def require_display(self) -> None:
        raise UserError("dots have no window")

    def show(self, motion: Motion, handle: Handle | None = None) -> None:
        raise AssertionError("asked to show without a display")


variants = Variants(Component("viewer", "small", f"{__name__}:DotsConfig", f"{__name__}:Dots", "dots"))
broken = variants.row_adder(Dots)


def _first_only(up: Any, self: Any, *given: Any) -> list[Picture]:
    pictures = list(up(*given))
    return pictures[:1] * len(pictures)


broken(
    "gives_a_picture_per_frame", pictures=lambda up, self, motion, size, view: up(motion, size[::-1], view)
)
broken("shows_the_motion", pictures=_first_only)
broken("draws_a_pose_always_alike", shift=4)
