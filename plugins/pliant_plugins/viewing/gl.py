"""An OpenGL context without a screen, whatever was imported before.

MuJoCo's own `Renderer` takes what the variable MUJOCO_GL said when mujoco was imported first; a library cannot
know that moment, so the context is made here.
"""

from __future__ import annotations

import ctypes.util
import os
import sys
from typing import Any

from pliant.errors import MissingDependencyError

INSTALL = (
    "install EGL (Debian, Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri) or OSMesa "
    "(apt-get install libosmesa6)"
)


def context(width: int, height: int) -> Any:
    """A context of MuJoCo's kind (`make_current`, `free`), EGL first and OSMesa second on Linux.

    Raises:
        MissingDependencyError: there is no OpenGL here that draws without a screen.
    """
    if not sys.platform.startswith("linux"):
        from mujoco.gl_context import GLContext

        return GLContext(width, height)
    backend = _backend()
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


def _backend() -> str:
    wanted = os.environ.get("MUJOCO_GL", "").strip().lower()
    if wanted in ("egl", "osmesa"):
        return wanted
    for backend, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if ctypes.util.find_library(library):
            return backend
    raise MissingDependencyError(f"no OpenGL that draws without a screen was found: {INSTALL}.")
