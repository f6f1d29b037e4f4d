"""The optional package meshio, which reads and writes files of meshes."""

from __future__ import annotations

import importlib
from typing import Any

from pliant.errors import MissingDependencyError


def require_meshio() -> Any:
    """Return the meshio package; raises `MissingDependencyError` where it is not installed."""
    try:
        return importlib.import_module("meshio")
    except ImportError:
        raise MissingDependencyError("VTU files need meshio: pip install 'pliant[fields]'.") from None
