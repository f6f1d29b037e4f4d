"""Config of the MuJoCo viewer."""

from __future__ import annotations

from typing import Literal

from pliant.interfaces.viewer import ViewerConfig


class MujocoViewerConfig(ViewerConfig):
    """``--viewer mujoco``, the default of `pliant render` and `pliant view`."""

    kind: Literal["mujoco"] = "mujoco"
