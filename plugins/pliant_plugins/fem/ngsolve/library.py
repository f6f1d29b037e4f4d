"""ngsolve and netgen.meshing, loaded after torch (see `pliant_plugins.native`)."""

from __future__ import annotations

from pliant_plugins.native import torch_first

torch_first()

import netgen.meshing as netgen  # noqa: E402
import ngsolve as ngs  # noqa: E402
from ngsolve.la import SparseMatrixd  # noqa: E402

__all__ = ["SparseMatrixd", "netgen", "ngs"]
