"""A scalar of x = (v, q) to second order, as the assembly hands it on."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class Terms:
    """A scalar of x to second order, G globals.

    Attributes:
        value: the scalar.
        gradient: (n + G,) over all dofs, fixed ones too.
        matrix: (nnz,) Hessian over the unknowns, upper triangle on the `Pattern`.
        border: (n + G, G) Hessian's columns of the globals.
    """

    value: float
    gradient: Array
    matrix: Array
    border: Array

    def plus(self, factor: float, other: Terms) -> Terms:
        """self + factor · other."""
        return Terms(
            self.value + factor * other.value,
            self.gradient + factor * other.gradient,
            self.matrix + factor * other.matrix,
            self.border + factor * other.border,
        )
