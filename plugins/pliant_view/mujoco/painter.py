"""Pictures of a drawing without a screen, whatever was imported before."""

from __future__ import annotations

import ctypes.util
import os
import sys
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.errors import MissingDependencyError
from pliant.records.scene import SceneFrames
from pliant_view.mujoco.camera import camera
from pliant_view.mujoco.drawing import SceneDrawing

Picture = NDArray[np.uint8]
MOST_GEOMS = 5000
CAPTION_FROM_PX = 240  # smaller pictures have no room for it


class Painter:
    """Renderer of the frames of one scene; keeps an OpenGL context until `close`.

    Raises:
        UserError: no OpenGL for offscreen rendering.
    """

    def __init__(self, drawing: SceneDrawing, size: tuple[int, int], view: str, caption: bool = True) -> None:
        self.drawing, self.size, self._caption = drawing, size, caption and size[1] >= CAPTION_FROM_PX
        self._gl: Any = context(*size)
        self._gl.make_current()
        model = drawing.model
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=MOST_GEOMS)
        self._option = mujoco.MjvOption()
        self._camera = camera(view, drawing.extent.points, model.vis.global_.fovy, size)

    def picture(self, frames: SceneFrames, index: int) -> Picture:
        """Return (height, width, 3) of a frame."""
        self.drawing.place(frames, index)
        self._gl.make_current()
        shown = (self.drawing.model, self.drawing.data, self._option, None, self._camera)
        mujoco.mjv_updateScene(*shown, mujoco.mjtCatBit.mjCAT_ALL, self._scene)
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
        """Free the context; nothing remains to be freed after MuJoCo has closed OpenGL at exit."""
        if self._gl is not None and not sys.is_finalizing():
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


INSTALL = (
    "install EGL (Debian, Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri) or OSMesa "
    "(apt-get install libosmesa6)"
)


def context(width: int, height: int) -> Any:
    """Return a context of MuJoCo's kind (`make_current`, `free`), EGL first and OSMesa second on Linux.

    MuJoCo's own `Renderer` takes what the variable MUJOCO_GL said when mujoco was imported first; a library cannot
    know that moment, so the context is made here.

    Raises:
        MissingDependencyError: there is no OpenGL here that draws without a screen.
    """
    if not sys.platform.startswith("linux"):
        from mujoco.gl_context import GLContext

        return GLContext(width, height)
    wanted = os.environ.get("MUJOCO_GL", "").strip().lower()
    known = {"egl": "EGL", "osmesa": "OSMesa"}
    found = [backend for backend, library in known.items() if ctypes.util.find_library(library)]
    backend = wanted if wanted in known else next(iter(found), "")
    if not backend:
        raise MissingDependencyError(f"no OpenGL that draws without a screen was found: {INSTALL}.")
    try:
        if backend == "egl":
            from mujoco.egl import GLContext
        else:
            from mujoco.osmesa import GLContext
        made = GLContext(width, height)
        made.make_current()
    except Exception as error:  # PyOpenGL raises whatever its loader raises
        cause = " ".join(str(error).split())[:120]
        raise MissingDependencyError(
            f"OpenGL ({backend}) cannot be started here ({cause}): {INSTALL}, or set MUJOCO_GL to the other."
        ) from None
    return made
