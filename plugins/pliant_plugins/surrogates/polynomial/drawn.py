"""Drawn polynomial laws: errors of `pliant.mechanics.law_draws` as further coefficients, which engines compile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev

from pliant.mechanics.law_draws import error_tables
from pliant.records.design import Array
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis
from pliant_plugins.surrogates.polynomial.energy_law import EnergyLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw


def drawn_polynomials(law: PolynomialLaw, count: int, seed: int) -> tuple[PolynomialLaw, ...]:
    """One-axis laws whose τ is that of `law` plus drawn errors; empty where it states none."""
    if law.error is None:
        return ()
    limits = np.vstack([law.domain.actuation, law.domain.deformation])
    maps = np.vstack([law.actuation_map, law.deformation_map])
    drawn = []
    for tables in error_tables(law, count, seed):
        added = _monomials(tables[0], limits, maps)
        shape = np.maximum(law.coefficients.shape, added.shape)
        drawn.append(replace(law, coefficients=_padded(law.coefficients, shape) + _padded(added, shape)))
    return tuple(drawn)


def drawn_energies(law: EnergyLaw, count: int, seed: int) -> tuple[EnergyLaw, ...]:
    """Laws of one to three axes whose energy is that of `law` minus the work of drawn errors."""
    if law.error is None:
        return ()
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    old = law.basis
    drawn = []
    for tables in error_tables(law, count, seed):
        exponents, coefficients = [old.exponents], [law.coefficients]
        for a, table in enumerate(tables):
            limits, maps = box[[0, 1 + a]], np.vstack([old.actuation_map, old.deformation_map[a]])
            work = _monomials(table, limits, maps)
            i, j = (grid.ravel() for grid in np.indices(work.shape))
            powers = np.zeros((work.size, 1 + len(law.axes)), np.int64)
            powers[:, 0], powers[:, 1 + a] = i, j + 1
            exponents.append(powers)
            coefficients.append(-work.ravel() * old.deformation_map[a, 1] / (j + 1))
        basis = EnergyBasis(np.concatenate(exponents), old.actuation_map, old.deformation_map)
        drawn.append(replace(law, basis=basis, coefficients=np.concatenate(coefficients)))
    return tuple(drawn)


def _monomials(table: Array, limits: Array, maps: Array) -> Array:
    """(I, J) coefficients of x^i v^j, scaled by `maps` (2, 2), of a Chebyshev table in coordinates of `limits`."""
    out = table
    for axis, ((low, high), (centre, scale)) in enumerate(zip(limits, maps, strict=True)):
        size = table.shape[axis]
        # Columns: monomials of the map's coordinate as Chebyshev series of the box's, t = (x·scale + centre − m)/h.
        nodes = chebyshev.chebpts1(size)
        x = ((low + high) / 2 + nodes * (high - low) / 2 - centre) / scale
        change = np.linalg.solve(np.vander(x, size, increasing=True), chebyshev.chebvander(nodes, size - 1))
        out = np.moveaxis(np.tensordot(change, out, axes=(1, axis)), 0, axis)
    return out


def _padded(table: Array, shape: Array) -> Array:
    return np.pad(table, [(0, int(n) - m) for n, m in zip(shape, table.shape, strict=True)])
