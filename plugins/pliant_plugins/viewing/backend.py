"""The viewer that ships: MuJoCo's renderer and its interactive window."""

from __future__ import annotations

from collections.abc import Iterator

from pliant.interfaces.viewer import Handle, Picture, View, Viewer
from pliant.records.motion import Motion
from pliant_plugins.viewing import window
from pliant_plugins.viewing.drawing import Drawing
from pliant_plugins.viewing.painter import Painter


class MujocoViewer(Viewer):
    """Surfaces bent smoothly across their joints, a floor with a grid of round size, shadows."""

    def pictures(self, motion: Motion, size: tuple[int, int], view: View) -> Iterator[Picture]:
        with Painter(Drawing(motion.scene, motion.seen or motion.frames, size), size, view) as painter:
            for index in range(len(motion.frames.time_s)):
                yield painter.picture(motion.frames, index)

    def require_display(self) -> None:
        window.require_display()

    def show(self, motion: Motion, handle: Handle | None = None) -> None:
        if handle is None:
            window.replay(motion)
        else:
            window.drive(motion, handle)
