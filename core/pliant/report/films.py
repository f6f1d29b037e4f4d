"""Pictures into files: PNG and GIF by Pillow, MP4 by ffmpeg; a file is there whole or not at all."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import tempfile
from abc import ABC, abstractmethod
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pliant.errors import MissingDependencyError, UserError, closest

Picture = NDArray[np.uint8]
ENDINGS = (".png", ".gif", ".mp4")
GIF_TICK_S = 0.01  # the format counts in hundredths of a second


class Film(ABC):
    """A file to which pictures are added in turn. Used in a `with`: an error or Ctrl-C leaves no file behind."""

    def __init__(self, path: Path, fps: float) -> None:
        self.path, self.fps = path, fps
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
        os.close(handle)
        self._partial = Path(name)

    @abstractmethod
    def add(self, picture: Picture) -> None:
        """The next picture, (height, width, 3) like the one before."""

    @abstractmethod
    def _finish(self) -> None:
        """Complete the temporary file."""

    def _drop(self) -> None:
        """Stop what is still writing; nothing does where the file is written at the end."""
        return

    def __enter__(self) -> Film:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._finish()
                os.umask(mask := os.umask(0))
                self._partial.chmod(0o666 & ~mask)
                self._partial.replace(self.path)
            else:
                self._drop()
        finally:
            self._partial.unlink(missing_ok=True)


def film(path: Path, fps: float) -> Film:
    """The writer for a file's ending.

    Raises:
        UserError: the ending is none of `ENDINGS`, or the folder cannot be written.
        MissingDependencyError: MP4 without ffmpeg.
    """
    kinds: dict[str, type[Film]] = {".png": _Png, ".gif": _Gif, ".mp4": _Mp4}
    ending = path.suffix.lower()
    if ending not in kinds:
        raise UserError(
            f"'{path.name}' ends in '{path.suffix}'{closest(ending, ENDINGS)} Pictures are .png, films .gif or .mp4."
        )
    return kinds[ending](path, fps)


class _Png(Film):
    """The last picture that was added."""

    _last: Picture | None = None

    def add(self, picture: Picture) -> None:
        self._last = picture

    def _finish(self) -> None:
        if self._last is not None:
            Image.fromarray(self._last).save(self._partial, "PNG")


class _Gif(Film):
    """One palette of 256 colours per picture."""

    def __init__(self, path: Path, fps: float) -> None:
        super().__init__(path, fps)
        self._pictures: list[Image.Image] = []

    def add(self, picture: Picture) -> None:
        self._pictures.append(Image.fromarray(picture).quantize(256, dither=Image.Dither.NONE))

    def _finish(self) -> None:
        # Ticks are rounded so that the film as a whole keeps its length.
        ends = np.round(np.arange(1, len(self._pictures) + 1) / self.fps / GIF_TICK_S)
        ticks = np.maximum(np.diff(ends, prepend=0.0), 2)  # players slow down shorter ones
        first, *others = self._pictures
        first.save(
            self._partial,
            "GIF",
            save_all=True,
            append_images=others,
            duration=(1e3 * GIF_TICK_S * ticks).astype(int).tolist(),
            loop=0,
            disposal=1,
        )


class _Mp4(Film):
    """H.264 that every browser plays."""

    def __init__(self, path: Path, fps: float) -> None:
        self._program = _ffmpeg()
        super().__init__(path, fps)
        self._encoder: subprocess.Popen[bytes] | None = None

    def add(self, picture: Picture) -> None:
        if self._encoder is None:
            self._encoder = self._start(picture.shape[1], picture.shape[0])
        assert self._encoder.stdin is not None
        try:
            self._encoder.stdin.write(np.ascontiguousarray(picture).tobytes())
        except BrokenPipeError:
            self._fail()

    def _start(self, width: int, height: int) -> subprocess.Popen[bytes]:
        raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{self.fps:g}"]
        coded = ["-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"]
        command = [self._program, "-y", "-loglevel", "error", *raw, "-i", "-", *coded, str(self._partial)]
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for Pliant, which stops the encoder itself
        )

    def _finish(self) -> None:
        if self._encoder is None:
            return
        assert self._encoder.stdin is not None
        self._encoder.stdin.close()
        if self._encoder.wait() != 0:
            self._fail()

    def _fail(self) -> None:
        said = (
            self._encoder.stderr.read().decode(errors="replace")
            if self._encoder and self._encoder.stderr
            else ""
        )
        cause = " ".join(said.split())[:200]
        raise UserError(f"ffmpeg could not write {self.path.name} ({cause}); try .gif.")

    def _drop(self) -> None:
        if self._encoder is not None:
            self._encoder.kill()
            self._encoder.wait()


def _ffmpeg() -> str:
    """The ffmpeg on the PATH, or the one that comes with imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        # An optional package that brings a program; found when it is wanted, as plugins are.
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise MissingDependencyError(
            "MP4 needs ffmpeg: pip install 'pliant[video]', or install ffmpeg; .gif needs nothing."
        ) from None
