"""Motion for viewers: a scene and its frames."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.records.scene import Scene, SceneFrames


@dataclass(frozen=True, eq=False)
class Motion:
    """A scene with the frames to draw, one picture each.

    The shapes of arms and objects are visible surfaces rather than collision shapes: halves of modules that end at a
    joint belong together and may be drawn bent. A chain is a scene with one arm and no floor.

    Attributes:
        scene: to be drawn.
        frames: its poses, one picture each.
        seen: all poses that the camera must cover, if more than the frames.
    """

    scene: Scene
    frames: SceneFrames
    seen: SceneFrames | None = None
