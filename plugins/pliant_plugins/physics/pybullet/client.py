"""PyBullet, imported where it is needed with a sentence where it is missing, and its functions for one client."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pliant.errors import MissingDependencyError
from pliant.mechanics.rotations import quaternion_from_matrix
from pliant.records.design import Array

LAST_PYTHON = (3, 11)


def load_pybullet() -> ModuleType:
    """Import the pybullet module.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
        with _silent_standard_error():
            return importlib.import_module("pybullet")
    except ImportError as error:
        sentence = "physics 'pybullet' needs pybullet: pip install 'pliant[pybullet]'"
        if sys.version_info[:2] > LAST_PYTHON:
            here = ".".join(map(str, sys.version_info[:2]))
            sentence += (
                f" (PyBullet publishes wheels up to Python 3.11 only and this is {here}: "
                "use Python 3.11, or physics 'quasistatic' or 'mujoco')"
            )
        raise MissingDependencyError(sentence) from error


@contextmanager
def _silent_standard_error() -> Iterator[None]:
    """Suppress the build time that PyBullet prints from C on import."""
    sys.stderr.flush()
    saved = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)


class Client:
    """PyBullet's functions, for one client in DIRECT mode, and its constants.

    Raises:
        MissingDependencyError: PyBullet is not installed.
    """

    def __init__(self) -> None:
        self.module = load_pybullet()
        self.number: int = self.module.connect(self.module.DIRECT)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.module, name)
        if callable(value):
            value = partial(value, physicsClientId=self.number)
        setattr(self, name, value)  # so that the next call is as fast as PyBullet's own
        return value

    def set_dynamics(self, body: int, links: Iterable[int], **settings: float) -> None:
        """Set properties of links, one per call: some combinations in one call are lost."""
        for link in links:
            for name, value in settings.items():
                self.changeDynamics(body, link, **{name: value})

    def close(self) -> None:
        """Disconnect; a second call does nothing."""
        if self.number >= 0:
            self.module.disconnect(physicsClientId=self.number)
            self.number = -1

    def load(self, path: Path, urdf: str, place: Array, rotation: Array, fixed: bool) -> int:
        """Load a URDF document, written to the path, as a body at this pose."""
        path.write_text(urdf, encoding="utf-8")
        body: int = self.loadURDF(
            str(path),
            np.asarray(place, float).tolist(),
            quaternion(rotation),
            useFixedBase=fixed,
            flags=self.URDF_USE_INERTIA_FROM_FILE,
        )
        return body


def quaternion(rotation: Array) -> list[float]:
    """Return x, y, z, w of a rotation matrix."""
    numbers: list[float] = np.roll(quaternion_from_matrix(rotation), -1).tolist()
    return numbers
