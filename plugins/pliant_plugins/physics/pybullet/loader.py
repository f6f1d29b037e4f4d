"""Imports pybullet where it is needed, with a sentence where it is missing."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType

from pliant.errors import MissingDependencyError

LAST_PYTHON = (3, 11)


def load_pybullet() -> ModuleType:
    """The pybullet module.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
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
