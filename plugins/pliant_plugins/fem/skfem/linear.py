"""Direct solvers for the symmetric matrix over the free displacements.

Both keep the structure: the pattern never changes within a problem, only the values do.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import importlib.util
import os
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from scipy import sparse

from pliant.errors import MissingDependencyError
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_plugins.fem.iteration import SingularMatrixError
from pliant_plugins.fem.skfem.pattern import Coupling, Pattern, distinct

ACCURATE = 1e-9  # largest residual of a linear solution / its right-hand side


class LinearSolver(Protocol):
    """A solver of K Z = B for values of K on a fixed pattern."""

    name: str

    def solve(self, values: Array, right: Array) -> Array:
        """Factorise K from its upper triangle's `values` (nnz,) and solve for `right` (n, k).

        Raises `SingularMatrixError`.
        """

    def again(self, right: Array) -> Array:
        """Solve for `right` (n, k) with the matrix that was factorised last."""


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

        def made() -> Any:
            with _library_found():
                return PyPardisoSolver(mtype=self._SYMMETRIC_INDEFINITE)

        self._error, self._new = PyPardisoError, made
        self._mkl = self._new()
        self._pattern, self._analysed, self._scaled = pattern, False, False

    def solve(self, values: Array, right: Array) -> Array:
        """Solve as `LinearSolver`; if pivots lose accuracy, as with stiff threads, scale and match the rows first.

        Scaling stays on once it was needed.
        """
        n = self._pattern.size
        matrix = sparse.csr_matrix((values, self._pattern.indices, self._pattern.indptr), shape=(n, n))
        self._matrix = matrix
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

    def again(self, right: Array) -> Array:
        try:
            return self._run(self._SOLVE, self._matrix, np.asfortranarray(right))
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


@functools.cache
def _mkl_library() -> str | None:
    """Return the path of the library of the distribution `mkl`; None if it is not installed."""
    try:
        files = importlib.metadata.files("mkl") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    places = (str(file.locate()) for file in files if "mkl_rt" in file.name)
    return next((place for place in places if Path(place).exists()), None)


@contextlib.contextmanager
def _library_found() -> Iterator[None]:
    """Pass the path of MKL to pypardiso, which otherwise searches the whole installation, a second each time."""
    place, name = _mkl_library(), "PYPARDISO_MKL_RT"
    if place is None or name in os.environ:
        yield
        return
    os.environ[name] = place
    try:
        yield
    finally:
        os.environ.pop(name, None)


def _accurate(upper: Any, found: Array, right: Array) -> bool:
    """Return whether the residual of the right-hand sides, each scaled to 1, is small; it is 1e-13 in ordinary
    problems.

    Only their sum is checked: products with the matrix cost a quarter of a factorisation.
    """
    largest = np.abs(right).max(axis=0)
    scale = np.divide(1.0, largest, out=np.zeros_like(largest), where=largest > 0)
    one = found @ scale
    left = right @ scale - (upper @ one + upper.T @ one - upper.diagonal() * one)
    return bool(np.abs(left).max() <= ACCURATE)


class SuperLU:
    """SciPy's SuperLU in symmetric mode: always there, several times slower.

    Volumes and pressures that belong to cells are eliminated first, since their zero diagonal would spoil the
    symmetric order.
    """

    name = "superlu"

    def __init__(self, pattern: Pattern) -> None:
        self._pattern = pattern

    def again(self, right: Array) -> Array:
        return self._factor(right)

    def solve(self, values: Array, right: Array) -> Array:
        n = self._pattern.size
        upper = sparse.csr_matrix((values, self._pattern.indices, self._pattern.indptr), shape=(n, n))
        matrix = (upper + sparse.triu(upper, 1).T).tocsr()
        count = self._pattern.cellwise
        self._factor = _eliminated(matrix, count) if count else _factorised(matrix)
        return self._factor(right)


Factor = Callable[[Array], Array]  # from right-hand sides (n, k) to solutions


def _factorised(matrix: Any) -> Factor:
    from scipy.sparse.linalg import splu

    try:
        found = splu(
            matrix.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=1e-3,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SingularMatrixError(str(error)) from error
    return lambda right: np.asarray(found.solve(right))


def _eliminated(matrix: Any, count: int) -> Factor:
    """Solve for (v, ϑ, q) by way of v: the rows of q are Cᵀ v − M ϑ, those of ϑ are Bᵀ v + D ϑ − M q, M diagonal."""
    size = matrix.shape[0]
    first, middle = size - 2 * count, size - count
    v, volumes, pressures = slice(0, first), slice(first, middle), slice(middle, None)
    B, C, D = matrix[v, volumes], matrix[v, pressures], matrix[volumes, volumes]
    inverse = sparse.diags(-1 / matrix[volumes, pressures].diagonal())
    BM, CM = B @ inverse, C @ inverse
    mixed = BM @ C.T
    factor = _factorised(matrix[v, v] + mixed + mixed.T + CM @ D @ CM.T)

    def solved(right: Array) -> Array:
        volume_side = inverse @ right[pressures]
        pressure_side = inverse @ (right[volumes] + D @ volume_side)
        found = factor(right[v] + B @ volume_side + C @ pressure_side)
        volume = CM.T @ found - volume_side
        pressure = BM.T @ found + inverse @ (D @ volume - right[volumes])
        return np.concatenate([found, volume, pressure])

    return solved


def linear_solver(kind: Literal["auto", "pardiso", "superlu"], pattern: Pattern) -> LinearSolver:
    """Return the solver of that name; `auto` uses pardiso if it works. Raises `MissingDependencyError`."""
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


class WideningSolver:
    """Solver with couplings by contact: a second solver has a pattern that grows by them, the first is unchanged."""

    def __init__(self, kind: Literal["auto", "pardiso", "superlu"], pattern: Pattern) -> None:
        self._kind: Literal["auto", "pardiso", "superlu"] = kind
        self._pattern = pattern
        self._first = self._last = linear_solver(kind, pattern)
        self._keys: IntArray = np.zeros(0, np.int64)

    @property
    def name(self) -> str:
        """Return the name of the solving code."""
        return self._first.name

    def solve(self, values: Array, right: Array, coupling: Coupling | None = None) -> Array:
        """Solve as `LinearSolver`, with the coupling added to the matrix."""
        if coupling is None:
            self._last = self._first
            return self._first.solve(values, right)
        more = coupling.pattern.keys
        places = np.searchsorted(self._keys, more)
        if not len(self._keys) or np.any(self._keys[np.minimum(places, len(self._keys) - 1)] != more):
            own = self._pattern.keys
            self._keys = distinct(np.concatenate([own, self._keys, more]))
            self._own, places = np.searchsorted(self._keys, own), np.searchsorted(self._keys, more)
            self._wide = linear_solver(self._kind, self._pattern.with_keys(self._keys))
        full = np.zeros(len(self._keys))
        full[self._own] = values
        full[places] += coupling.values
        self._last = self._wide
        return self._wide.solve(full, right)

    def again(self, right: Array) -> Array:
        """Solve for another right-hand side, as `LinearSolver`."""
        return self._last.again(right)
