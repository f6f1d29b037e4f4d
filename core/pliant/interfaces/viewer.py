"""Viewer: draws motions, without a screen and on it."""

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
        """Each input's name with its unit, lowest and highest value."""

    @abstractmethod
    def advance(self, values: Mapping[str, float], duration_s: float) -> SceneFrames:
        """Go on for `duration_s` under these inputs; one frame, the new pose."""


class Viewer(Configured[ViewerConfig]):
    """Draws what any engine simulated; `pliant render` and `pliant view` call it."""

    @abstractmethod
    def pictures(self, motion: Motion, size: tuple[int, int], view: View) -> Iterator[Picture]:
        """One picture (height, width, 3) of 8-bit RGB per frame, drawn as they are asked for.

        The camera stands still and sees all that moves: "front" looks along world +y (x to the right, z up), "side"
        along −x, "top" from above, "iso" from a corner.

        Args:
            motion: what is drawn.
            size: (width, height) in pixels.
            view: where the camera stands.

        Raises:
            MissingDependencyError: what draws without a screen is not installed.
        """

    @abstractmethod
    def require_display(self) -> None:
        """Raise `UserError` where `show` could open no window; asked before anything is computed."""

    @abstractmethod
    def show(self, motion: Motion, handle: Handle | None = None) -> None:
        """Open a window until it is closed: replay the motion over and over, or let the user drive `handle`."""
