"""Imports pybullet where it is needed, with a sentence where it is missing."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from pliant.errors import MissingDependencyError

LAST_PYTHON = (3, 11)


def load_pybullet() -> ModuleType:
    """The pybullet module.

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
    """PyBullet prints its build time from C when imported, in the middle of the progress bars."""
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
