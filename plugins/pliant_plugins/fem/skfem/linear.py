"""Direct solvers for the symmetric matrix over the free displacements.

Both keep the structure: the pattern never changes within a problem, only the values do.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
import weakref
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from scipy import sparse

from pliant.errors import MissingDependencyError
from pliant.records.design import Array
from pliant_plugins.fem.newton import SingularMatrixError
from pliant_plugins.fem.skfem.pattern import Pattern

ACCURATE = 1e-9  # largest residual of a linear solution / its right-hand side


class LinearSolver(Protocol):
    """Solves K Z = B for values of K on the pattern it was made for."""

    name: str

    def solve(self, values: Array, right: Array) -> Array:
        """Factorise K from its upper triangle's `values` (nnz,) and solve for `right` (n, k).

        Raises `SingularMatrixError`.
        """


@cache
def _name_mkl() -> None:
    """Name MKL's library to pypardiso, which walks the whole environment for it in every solver, 0.6 s each time."""
    places = (Path(sys.prefix, *parts) for parts in (("lib",), ("Library", "bin")))
    for path in sorted((str(path) for place in places for path in place.glob("*mkl_rt*")), key=len):
        with suppress(OSError):
            ctypes.CDLL(path)
            os.environ.setdefault("PYPARDISO_MKL_RT", path)
            return


class Pardiso:
    """MKL's LDLᵀ with Bunch–Kaufman pivots (matrix type −2); the symbolic phase is done once."""

    name = "pardiso"
    _ANALYSE, _FACTORISE, _SOLVE, _SYMMETRIC_INDEFINITE = 11, 22, 33, -2
    # MKL's iparm, from 1: own values, METIS, refinements, perturbation 1e-8, scaling, matching, 2 × 2 pivots
    _SCALED = ((1, 1), (2, 2), (8, 2), (10, 8), (11, 1), (13, 1), (21, 1))

    def __init__(self, pattern: Pattern) -> None:
        try:
            from pypardiso import PyPardisoSolver
            from pypardiso.pardiso_wrapper import PyPardisoError
        except ImportError as error:
            raise MissingDependencyError(
                "fem.linear_solver 'pardiso' needs pypardiso: pip install 'pliant[fast]'"
            ) from error
        _name_mkl()
        self._error, self._new = PyPardisoError, lambda: PyPardisoSolver(mtype=self._SYMMETRIC_INDEFINITE)
        self._mkl = self._new()
        self._pattern, self._analysed, self._scaled = pattern, False, False

    def solve(self, values: Array, right: Array) -> Array:
        """As `LinearSolver`; where pivots lose accuracy, as stiff threads make them, rows are scaled and matched first.

        Once that was needed it stays.
        """
        n = self._pattern.size
        matrix = sparse.csr_matrix((values, self._pattern.indices, self._pattern.indptr), shape=(n, n))
        try:
            found = self._solved(matrix, right)
            if self._scaled or _accurate(matrix, found, right):
                return found
            self._mkl.free_memory(everything=True)
            self._mkl, self._analysed, self._scaled = self._new(), False, True
            for place, value in self._SCALED:
                self._mkl.set_iparm(place, value)
            return self._solved(matrix, right)
        except self._error as error:
            raise SingularMatrixError(str(error)) from error

    def _solved(self, matrix: Any, right: Array) -> Array:
        nothing = np.zeros((matrix.shape[0], 1))
        if not self._analysed:
            self._run(self._ANALYSE, matrix, nothing)
            self._analysed = True
            weakref.finalize(self, self._mkl.free_memory, everything=True)
        self._run(self._FACTORISE, matrix, nothing)
        return self._run(self._SOLVE, matrix, np.asfortranarray(right))

    def _run(self, phase: int, matrix: Any, right: Array) -> Array:
        # pypardiso's public methods repeat the symbolic phase for every new matrix
        self._mkl.set_phase(phase)
        return np.asarray(self._mkl._call_pardiso(matrix, right))


def _accurate(upper: Any, found: Array, right: Array) -> bool:
    """Whether what is left of every right-hand side is small; plain problems leave 1e-13."""
    left = right - (upper @ found + upper.T @ found - upper.diagonal()[:, None] * found)
    return bool(np.all(np.abs(left).max(axis=0) <= ACCURATE * np.abs(right).max(axis=0)))


class SuperLU:
    """SciPy's SuperLU in symmetric mode: always there, several times slower.

    Volumes and pressures that belong to cells are eliminated first, since their zero diagonal would spoil the
    symmetric order.
    """

    name = "superlu"

    def __init__(self, pattern: Pattern) -> None:
        self._pattern = pattern

    def solve(self, values: Array, right: Array) -> Array:
        n = self._pattern.size
        upper = sparse.csr_matrix((values, self._pattern.indices, self._pattern.indptr), shape=(n, n))
        matrix = (upper + sparse.triu(upper, 1).T).tocsr()
        if self._pattern.cellwise:
            return _eliminated(matrix, right, self._pattern.cellwise)
        return _factorised(matrix, right)


def _factorised(matrix: Any, right: Array) -> Array:
    from scipy.sparse.linalg import splu

    try:
        factor = splu(
            matrix.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=1e-3,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SingularMatrixError(str(error)) from error
    return np.asarray(factor.solve(right))


def _eliminated(matrix: Any, right: Array, count: int) -> Array:
    """Solve for (v, ϑ, q) by way of v: the rows of q are Cᵀ v − M ϑ, those of ϑ are Bᵀ v + D ϑ − M q, M diagonal."""
    first, middle = len(right) - 2 * count, len(right) - count
    v, volumes, pressures = slice(0, first), slice(first, middle), slice(middle, None)
    B, C, D = matrix[v, volumes], matrix[v, pressures], matrix[volumes, volumes]
    inverse = sparse.diags(-1 / matrix[volumes, pressures].diagonal())
    BM, CM = B @ inverse, C @ inverse
    mixed = BM @ C.T
    reduced = matrix[v, v] + mixed + mixed.T + CM @ D @ CM.T
    volume_side = inverse @ right[pressures]
    pressure_side = inverse @ (right[volumes] + D @ volume_side)
    found = _factorised(reduced, right[v] + B @ volume_side + C @ pressure_side)
    volume = CM.T @ found - volume_side
    pressure = BM.T @ found + inverse @ (D @ volume - right[volumes])
    return np.concatenate([found, volume, pressure])


def linear_solver(kind: Literal["auto", "pardiso", "superlu"], pattern: Pattern) -> LinearSolver:
    """The solver of that name; `auto` takes pardiso where it works. Raises `MissingDependencyError`."""
    if kind == "superlu":
        return SuperLU(pattern)
    if kind == "pardiso":
        return Pardiso(pattern)
    if importlib.util.find_spec("pypardiso") is None:
        return SuperLU(pattern)
    try:
        return Pardiso(pattern)
    except MissingDependencyError:
        return SuperLU(pattern)
