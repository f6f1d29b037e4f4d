"""`pliant render`: pictures and films of what a study simulates; `pliant view`: the interactive window."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, get_args

import numpy as np
import typer
from numpy.typing import NDArray

from pliant.cli.options import Overrides, StudyFile, verb
from pliant.cli.session import Session, check_writable
from pliant.cli.studies import NOT_CONVERGED
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.interfaces.task import SceneTask
from pliant.interfaces.viewer import View, Viewer
from pliant.pipeline.motion import (
    ChainHandle,
    at_times,
    chain_frames,
    chain_scene,
    drawn_chain,
    highest_actuation,
    prepared_chain,
    run_motion,
)
from pliant.pipeline.study import StudyRun, build_study_laws, simulate_study
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.motion import Motion
from pliant.records.rollout import Inputs

SIZE = re.compile(r"(\d{1,5})x(\d{1,5})")
SMALLEST_PX, LARGEST_PX = 32, 4096
FASTEST_FPS = 120
FILMS = (".gif", ".mp4")
PLOTS = (".svg", ".png", ".pdf")

ViewerKind = Annotated[str, typer.Option("--viewer", metavar="KIND", help="Viewer; see 'pliant plugins'.")]


@verb()
def render(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="A .png, .gif or .mp4.")] = Path(
        "frame.png"
    ),
    fps: Annotated[float, typer.Option("--fps", help="Pictures per second of a film.")] = 25.0,
    size: Annotated[
        str, typer.Option("--size", metavar="WxH", help="Width and height in pixels.")
    ] = "1280x720",
    at_s: Annotated[
        float | None, typer.Option("--time", metavar="S", help="The instant of a .png; the end by default.")
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", metavar="S", help="Length of a film; that of the motion by default."),
    ] = None,
    camera: Annotated[str, typer.Option("--camera", help=", ".join(get_args(View)))] = "iso",
    backbone: Annotated[
        bool,
        typer.Option("--backbone", help="Three views of the line through the joints (.svg, .png, .pdf)."),
    ] = False,
    viewer: ViewerKind = "mujoco",
) -> None:
    """Draw what the study simulates: a picture, a film, or the backbone in three views."""
    ending = _ending(out, backbone)
    pixels = _pixels(size, ending)
    view = _view(camera)
    _check_numbers(fps, at_s, seconds, ending)
    loaded = session.study(study, overrides).model_copy(update={"cross_check": ()})
    loaded.need("task", "a picture")
    check_writable(out.parent)
    context = session.context()
    drawer = session.registry.get("viewer", viewer)
    built: Viewer = drawer.build(drawer.config_model()(kind=viewer))
    done = simulate_study(context, loaded)
    started = time.perf_counter()
    if backbone:
        _write_backbone(done, out)
        count = 1
    else:
        motion = run_motion(context, done)
        times = _times(motion, fps, at_s, seconds, ending)
        count = _write_film(context, built, motion, times, pixels, view, fps, out)
    wall_s = time.perf_counter() - started
    session.result.update({"out": out, "pictures": count, "size": pixels, "wall_s": wall_s})
    session.say(f"written  {out}   ({count} picture{'s' * (count > 1)}, {count / wall_s:.1f} per second)")
    _judge(session, done)


def _judge(session: Session, done: StudyRun) -> None:
    result = done.engines[0].result
    if result is not None and (result.not_reached or not result.final.converged):
        why = result.not_reached or "The simulation did not converge."
        session.progress.note(f"{why} The picture shows where it stopped.")
        session.exit_code = NOT_CONVERGED


def _ending(out: Path, backbone: bool) -> str:
    ending, known = out.suffix.lower(), PLOTS if backbone else (".png", *FILMS)
    if ending not in known:
        hint = " A backbone plot as .svg or .pdf needs --backbone." if ending in PLOTS else ""
        raise UserError(
            f"--out {out.name}: '{out.suffix}' is none of {', '.join(known)}{closest(ending, known)}{hint}"
        )
    if out.is_dir():
        raise UserError(f"--out {out} is a folder; give the name of a file in it.")
    return ending


def _pixels(size: str, ending: str) -> tuple[int, int]:
    match = SIZE.fullmatch(size.lower())
    width, height = (int(match[1]), int(match[2])) if match else (0, 0)
    if min(width, height) < SMALLEST_PX or max(width, height) > LARGEST_PX:
        raise UserError(
            f"--size {size}: write width x height in pixels, each from {SMALLEST_PX} to {LARGEST_PX}, like 1280x720."
        )
    if ending == ".mp4" and (width % 2 or height % 2):
        raise UserError(f"--size {size}: MP4 needs even numbers.")
    return width, height


def _view(camera: str) -> View:
    for known in get_args(View):
        if camera == known:
            return known
    raise UserError(
        f"unknown camera '{camera}'{closest(camera, get_args(View))} Cameras: {', '.join(get_args(View))}."
    )


def _check_numbers(fps: float, at_s: float | None, seconds: float | None, ending: str) -> None:
    if not 0 < fps <= FASTEST_FPS:
        raise UserError(
            f"--fps {fps:g}: a film has more than 0 and at most {FASTEST_FPS} pictures per second."
        )
    if seconds is not None and not (np.isfinite(seconds) and 0 < seconds <= 3600):
        raise UserError(f"--seconds {seconds:g}: a film lasts more than 0 and at most 3600 s.")
    if at_s is not None and ending in FILMS:
        raise UserError("--time is the instant of a .png; a film shows all of the motion.")
    if seconds is not None and ending not in FILMS:
        raise UserError("--seconds is the length of a film; --time picks the instant of a picture.")


def _times(motion: Motion, fps: float, at_s: float | None, seconds: float | None, ending: str) -> Array:
    """Return the instants of the pictures, in the motion's own time."""
    first, last = float(motion.frames.time_s[0]), float(motion.frames.time_s[-1])
    if ending not in FILMS:
        # A recording may end up to half a frame before the motion does.
        near = 0.5 * (last - first) / max(1, len(motion.frames.time_s) - 1)
        if at_s is not None and not first - near <= at_s <= last + near:
            raise UserError(f"--time {at_s:g}: the motion goes from {first:g} to {last:g} s.")
        return np.array([last if at_s is None else np.clip(at_s, first, last)])
    if last <= first:
        raise UserError("the task leaves one pose and no motion; draw it as .png.")
    count = max(2, round((seconds or last - first) * fps) + 1)
    return np.linspace(first, last, count)


def _write_film(
    context: RunContext,
    viewer: Viewer,
    motion: Motion,
    times: Array,
    size: tuple[int, int],
    view: View,
    fps: float,
    out: Path,
) -> int:
    from pliant_view.films import write_film  # Pillow

    # The camera shows the whole motion, even if one instant of it is drawn.
    shown = Motion(motion.scene, at_times(motion.frames, times), motion.frames)
    work = context.progress.begin(f"drawing {out.name}", len(times))

    def counted() -> Iterator[NDArray[np.uint8]]:
        for picture in viewer.pictures(shown, size, view):
            yield picture
            work.advance()

    try:
        write_film(out, fps, counted())
    finally:
        work.finish()
    return len(times)


def _write_backbone(done: StudyRun, out: Path) -> None:
    from pliant.report.pose_charts import three_views
    from pliant.report.still import write_still  # matplotlib takes a second to import

    write_still(three_views(done), out)


@verb(json=False)
def view(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    replay: Annotated[
        bool, typer.Option("--replay", help="Replay the task; else sliders drive the chain.")
    ] = False,
    viewer: ViewerKind = "mujoco",
) -> None:
    """Open a window: move the pressure by a slider, or replay what the task did (scenes always)."""
    drawer = session.registry.get("viewer", viewer)
    built: Viewer = drawer.build(drawer.config_model()(kind=viewer))
    built.require_display()
    loaded = session.study(study, overrides).model_copy(update={"cross_check": ()})
    context = session.context()
    scene = loaded.task is not None and isinstance(context.build("task", loaded.task), SceneTask)
    if replay or scene:
        built.show(run_motion(context, simulate_study(context, loaded)))
    else:
        _drive(context, loaded, built)


def _drive(context: RunContext, study: Study, viewer: Viewer) -> None:
    chain, backend, _ = prepared_chain(context, study)
    highest = highest_actuation(study, chain)
    looks = drawn_chain(context, StudyRun(study, build_study_laws(context, study)))
    with backend.build(chain) as simulation:
        rest = simulation.snapshot()
        names = dict.fromkeys(actuator.input for actuator in chain.actuators)
        poses = [rest.position]
        for share in (0.5, 1.0):
            simulation.apply(Inputs(dict.fromkeys(names, share * highest)))
            poses.append(simulation.settle().joint_angles)
        simulation.restore(rest)
        frames = chain_frames(np.arange(3.0), np.array(poses))
        worn = chain.with_(shapes=looks.shapes)
        viewer.show(Motion(chain_scene(worn), frames), ChainHandle(simulation, highest))
