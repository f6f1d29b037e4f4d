"""Writing of picture files: PNG and GIF by Pillow, MP4 by ffmpeg; a file is written completely or not at all."""

from __future__ import annotations

import importlib
import itertools
import shutil
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pliant.errors import MissingDependencyError, UserError, closest
from pliant.store.store import whole_file

Frame = NDArray[np.uint8]
GIF_TICK_S = 0.01  # the format counts in hundredths of a second


def write_film(path: Path, fps: float, frames: Iterable[Frame]) -> None:
    """Write frames (height, width, 3), all of one size, into a file of the format of its ending.

    Raises:
        UserError: the ending is not in `ENDINGS`, or the encoder fails.
        MissingDependencyError: MP4 without ffmpeg; raised before the first frame is computed.
    """
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise UserError(
            f"'{path.name}' ends in '{path.suffix}'{closest(ending, ENDINGS)} Pictures are .png, films .gif or .mp4."
        )
    with whole_file(path) as partial:
        try:
            WRITERS[ending](partial, fps, frames)
        except _EncoderError as error:
            raise UserError(f"ffmpeg could not write {path.name} ({error}); try .gif.") from None


def _write_png(path: Path, fps: float, frames: Iterable[Frame]) -> None:
    """Write the last frame."""
    *_, last = frames
    Image.fromarray(last).save(path, "PNG")


def _write_gif(path: Path, fps: float, frames: Iterable[Frame]) -> None:
    """Write a GIF with one palette of 256 colours per frame."""
    first, *others = (Image.fromarray(one).quantize(256, dither=Image.Dither.NONE) for one in frames)
    # Ticks are rounded so that the whole film keeps its length.
    ends = np.round(np.arange(1, len(others) + 2) / fps / GIF_TICK_S)
    ticks = np.maximum(np.diff(ends, prepend=0.0), 2)  # players slow down shorter ones
    duration = (1e3 * GIF_TICK_S * ticks).astype(int).tolist()
    first.save(path, "GIF", save_all=True, append_images=others, duration=duration, loop=0, disposal=1)


class _EncoderError(Exception):
    """Error of ffmpeg, with its message."""


def _write_mp4(path: Path, fps: float, frames: Iterable[Frame]) -> None:
    """Write H.264 that every browser plays."""
    program, rest = _ffmpeg(), iter(frames)
    first = next(rest)
    raw = [
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        f"{first.shape[1]}x{first.shape[0]}",
        "-r",
        f"{fps:g}",
    ]
    coded = ["-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"]
    encoder = subprocess.Popen(
        [program, "-y", "-loglevel", "error", *raw, "-i", "-", *coded, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,  # Ctrl-C is handled by Pliant, which stops the encoder
    )
    assert encoder.stdin is not None and encoder.stderr is not None
    try:
        for frame in itertools.chain([first], rest):
            encoder.stdin.write(np.ascontiguousarray(frame).tobytes())
        encoder.stdin.close()
        failed = encoder.wait() != 0
    except BrokenPipeError:
        failed = True
    except BaseException:
        encoder.kill()
        encoder.wait()
        raise
    if failed:
        raise _EncoderError(" ".join(encoder.stderr.read().decode(errors="replace").split())[:200])


WRITERS: dict[str, Callable[[Path, float, Iterable[Frame]], None]] = {
    ".png": _write_png, ".gif": _write_gif, ".mp4": _write_mp4,
}  # fmt: skip
ENDINGS = tuple(WRITERS)


def _ffmpeg() -> str:
    """Return the ffmpeg on the PATH, or that of imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        # An optional package with a program; imported on use, as plugins are.
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise MissingDependencyError(
            "MP4 needs ffmpeg: pip install 'pliant[video]', or install ffmpeg; .gif needs nothing."
        ) from None
