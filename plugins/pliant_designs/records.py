"""FEM data of many designs of one family, to which a meta-model is fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import ModuleData

Parameter = float | int | str | bool


@dataclass(frozen=True, eq=False)
class SolvedDesigns:
    """n designs with their data.

    Attributes:
        family: kind of the family.
        names: the d parameters in which the designs differ, SI (`average_radius_m`, `material.shear_modulus_pa`).
        values: (n, d) of these parameters.
        fixed: parameters that all designs share.
        data: the FEM data of each; all have the same joint, axes and actuation.
    """

    family: str
    names: tuple[str, ...]
    values: Array
    fixed: Mapping[str, Parameter]
    data: tuple[ModuleData, ...]

    def __len__(self) -> int:
        return len(self.data)

    def rows(self, keep: NDArray[np.bool_]) -> SolvedDesigns:
        """Return the designs selected by a mask (n,)."""
        chosen = tuple(one for one, kept in zip(self.data, keep, strict=True) if kept)
        return SolvedDesigns(self.family, self.names, self.values[keep], self.fixed, chosen)

    @property
    def box(self) -> Array:
        """(d, 2) lowest and highest value of each parameter."""
        return np.stack([self.values.min(axis=0), self.values.max(axis=0)], axis=1)

    def corners(self) -> NDArray[np.bool_]:
        """Return (n,) whether a design is on the border of the box, so that it is extrapolated when left out."""
        on_border = np.isclose(
            self.values[:, :, None], self.box[None], rtol=0.0, atol=1e-9 * self.scale[:, None]
        )
        return np.asarray(on_border.any(axis=(1, 2)), dtype=np.bool_)

    @property
    def scale(self) -> Array:
        """(d,) width of the box."""
        return np.asarray(np.ptp(self.values, axis=0))
