"""Viewer: drawing of motions, off screen and on screen."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pliant.interfaces.base import ComponentConfig, Configured
from pliant.records.motion import Motion
from pliant.records.scene import SceneFrames

View = Literal["iso", "front", "side", "top"]
Picture = NDArray[np.uint8]


class ViewerConfig(ComponentConfig):
    """Base of a viewer's config."""


class Handle(ABC):
    """A running simulation that a viewer's user drives: `inputs` become sliders."""

    @property
    @abstractmethod
    def inputs(self) -> Mapping[str, tuple[float, float]]:
        """Return each input's name with its unit, lowest and highest value."""

    @abstractmethod
    def advance(self, values: Mapping[str, float], duration_s: float) -> SceneFrames:
        """Advance by `duration_s` under these inputs; return one frame with the new pose."""


class Viewer(Configured[ViewerConfig]):
    """Base of a viewer of simulated motions; `pliant render` and `pliant view` call it."""

    @abstractmethod
    def pictures(self, motion: Motion, size: tuple[int, int], view: View) -> Iterator[Picture]:
        """Yield one picture (height, width, 3) of 8-bit RGB per frame, drawn on demand.

        The camera is fixed and covers all moving parts: "front" looks along world +y (x to the right, z up), "side"
        along −x, "top" from above, "iso" from a corner.

        Args:
            motion: to be drawn.
            size: (width, height) in pixels.
            view: position of the camera.

        Raises:
            MissingDependencyError: the library for off-screen drawing is not installed.
        """

    @abstractmethod
    def require_display(self) -> None:
        """Raise `UserError` if `show` cannot open a window; called before any computation."""

    @abstractmethod
    def show(self, motion: Motion, handle: Handle | None = None) -> None:
        """Open a window until it is closed: replay the motion in a loop, or let the user drive `handle`."""
