"""Pictures of a drawing without a screen."""

from __future__ import annotations

import sys
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.records.scene import SceneFrames
from pliant_plugins.viewing import gl
from pliant_plugins.viewing.camera import camera
from pliant_plugins.viewing.drawing import Drawing

Picture = NDArray[np.uint8]
MOST_GEOMS = 5000
CAPTION_FROM_PX = 240  # smaller pictures have no room for it


class Painter:
    """Draws frames of one scene; holds an OpenGL context until `close`.

    Raises:
        UserError: no OpenGL that draws without a screen.
    """

    def __init__(self, drawing: Drawing, size: tuple[int, int], view: str, caption: bool = True) -> None:
        self.drawing, self.size, self._caption = drawing, size, caption and size[1] >= CAPTION_FROM_PX
        self._gl: Any = gl.context(*size)
        self._gl.make_current()
        model = drawing.model
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=MOST_GEOMS)
        self._option = mujoco.MjvOption()
        self._camera = camera(view, drawing.extent.points, model.vis.global_.fovy, size)

    def picture(self, frames: SceneFrames, index: int) -> Picture:
        """(height, width, 3) of a frame."""
        self.drawing.place(frames, index)
        self._gl.make_current()
        mujoco.mjv_updateScene(
            self.drawing.model,
            self.drawing.data,
            self._option,
            None,
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        width, height = self.size
        view = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(view, self._scene, self._context)
        if self._caption:
            words = f"t = {frames.time_s[index]:.2f}, squares {1e3 * self.drawing.square_m:g} mm"
            corner = mujoco.mjtGridPos.mjGRID_BOTTOMLEFT
            mujoco.mjr_overlay(mujoco.mjtFont.mjFONT_NORMAL, corner, view, words, "", self._context)
        pixels: Picture = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, view, self._context)
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Free the context; at the end of Python, when MuJoCo has ended OpenGL, nothing is left to free."""
        if self._gl is not None and not sys.is_finalizing():
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
