"""The viewer that ships: MuJoCo's renderer and its interactive window."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.viewer import Handle, Picture, View, Viewer
from pliant.pipeline.motion import at_times
from pliant.records.motion import Motion
from pliant.records.scene import SceneFrames
from pliant_view.mujoco.camera import camera
from pliant_view.mujoco.drawing import SceneDrawing
from pliant_view.mujoco.painter import Painter

STEP_S = 1 / 30
PAUSE_S = 1.0  # between two replays
WINDOW = (1280, 720)
CLOSING_S = 5.0


class MujocoViewer(Viewer):
    """Surfaces bent smoothly across their joints, a floor with a grid of round size, shadows."""

    def pictures(self, motion: Motion, size: tuple[int, int], view: View) -> Iterator[Picture]:
        with Painter(SceneDrawing(motion.scene, motion.seen or motion.frames, size), size, view) as painter:
            for index in range(len(motion.frames.time_s)):
                yield painter.picture(motion.frames, index)

    def require_display(self) -> None:
        if sys.platform.startswith("linux") and not (
            os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        ):
            raise UserError(
                "there is no display here (DISPLAY is not set): log in with 'ssh -X', or make a film with "
                "'pliant render STUDY.yaml --out film.mp4'."
            )

    def show(self, motion: Motion, handle: Handle | None = None) -> None:
        if handle is None:
            replay(motion)
        else:
            drive(motion, handle)


def replay(motion: Motion) -> None:
    """Replay the motion repeatedly in real time until the window is closed."""
    frames = motion.frames
    drawing = SceneDrawing(motion.scene, frames, WINDOW)
    length_s = float(frames.time_s[-1] - frames.time_s[0])
    with _opened(drawing) as viewer:
        while viewer.is_running():
            started = time.monotonic()
            while viewer.is_running() and (passed := time.monotonic() - started) < length_s + PAUSE_S:
                now = at_times(frames, frames.time_s[:1] + min(passed, length_s))
                _show(viewer, drawing, now)
                time.sleep(STEP_S)


def drive(motion: Motion, handle: Handle) -> None:
    """Show sliders under "Control" that set the inputs; the simulation follows in real time if it can."""
    drawing = SceneDrawing(motion.scene, motion.frames, WINDOW, sliders=handle.inputs)
    names = list(handle.inputs)
    with _opened(drawing) as viewer:
        while viewer.is_running():
            started = time.monotonic()
            with viewer.lock():
                values = dict(zip(names, drawing.data.ctrl.tolist(), strict=True))
            _show(viewer, drawing, handle.advance(values, STEP_S))
            time.sleep(max(0.0, STEP_S - (time.monotonic() - started)))


@contextmanager
def _opened(drawing: SceneDrawing) -> Iterator[Any]:
    import mujoco.viewer

    others = set(threading.enumerate())
    try:
        viewer = mujoco.viewer.launch_passive(
            drawing.model, drawing.data, show_left_ui=False, show_right_ui=bool(drawing.model.nu)
        )
    except (RuntimeError, mujoco.FatalError) as error:
        raise UserError(f"the window cannot be opened here ({error}).") from None
    wanted = camera("iso", drawing.extent.points, drawing.model.vis.global_.fovy, WINDOW)
    try:
        with viewer:
            viewer.cam.azimuth, viewer.cam.elevation = wanted.azimuth, wanted.elevation
            viewer.cam.distance = wanted.distance
            viewer.cam.lookat[:] = wanted.lookat
            yield viewer
    finally:
        # GLFW ends with the program: the window's own thread must be done before.
        for thread in set(threading.enumerate()) - others:
            thread.join(CLOSING_S)


def _show(viewer: Any, drawing: SceneDrawing, frame: SceneFrames) -> None:
    with viewer.lock():
        drawing.place(frame, 0)
    viewer.sync()
