"""What viewers draw: a scene and how it moved."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.records.scene import Scene, SceneFrames


@dataclass(frozen=True, eq=False)
class Motion:
    """A scene with the frames to be drawn, one picture each.

    The shapes of arms and objects are what is to be seen, surfaces rather than collision shapes: halves of modules
    that end at a joint belong together and may be drawn bent. A chain alone is a scene with one arm and no floor.

    Attributes:
        scene: what is drawn.
        frames: its poses, one picture each.
        seen: all poses that the camera must see, where they are more than the frames.
    """

    scene: Scene
    frames: SceneFrames
    seen: SceneFrames | None = None
