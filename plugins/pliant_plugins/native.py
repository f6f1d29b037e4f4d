"""The loading order of native libraries: torch before ngsolve.

ngsolve opens its MKL for the whole process; if torch is loaded after it, torch calls that MKL instead of its bundled
one and crashes in the first matrix product. With torch loaded first, both work.
"""

from __future__ import annotations

import contextlib
import sys
from typing import Any

from pliant.errors import MissingDependencyError, UserError


def torch_first() -> None:
    """Load torch, if it is installed, before what must come after it."""
    with contextlib.suppress(ImportError, OSError):
        import torch  # noqa: F401


def load_torch(what: str) -> Any:
    """Import torch, for `what` ("surrogate 'neural' needs torch to fit a law").

    Raises:
        MissingDependencyError: it is not installed.
        UserError: ngsolve is loaded without it, so that it would crash.
    """
    if "ngsolve" in sys.modules and "torch" not in sys.modules:
        raise UserError(f"{what}, and this process has loaded ngsolve before it: write 'import torch' first.")
    try:
        import torch
    except ImportError:
        raise MissingDependencyError(f"{what}: pip install 'pliant[neural]'.") from None
    return torch
