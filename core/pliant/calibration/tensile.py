"""Nominal stresses of homogeneous tests, as a fit needs them: fast for any number of rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from pliant.errors import NotReachedError
from pliant.interfaces.material import Material, MaterialConfig
from pliant.mechanics.homogeneous import MODES, nominal_stress
from pliant.records.design import Array

NODES = 160  # more rows than this are interpolated between so many computed stretches


@dataclass(frozen=True, eq=False)
class HomogeneousTests:
    """The model of `test: tensile`: constants in, nominal stress of every row out.

    Attributes:
        build: makes the material.
        stretch: (n,) of the rows.
        mode: (n,) uniaxial, equibiaxial or planar.
    """

    build: Callable[[MaterialConfig], Material]
    stretch: Array
    mode: np.ndarray

    def predict(self, config: MaterialConfig) -> Array | None:
        """Nominal stress (n,) in Pa; None where these constants give none."""
        try:
            with np.errstate(all="ignore"):  # constants far off overflow; they are refused below
                stress = self._stress(self.build(config))
        except (NotReachedError, np.linalg.LinAlgError):
            return None
        return stress if np.all(np.isfinite(stress)) else None

    def _stress(self, material: Material) -> Array:
        stress = np.zeros(len(self.stretch))
        for mode in MODES:
            rows = self.mode == mode
            if not rows.any():
                continue
            stretch = self.stretch[rows]
            places, back = np.unique(stretch, return_inverse=True)
            if len(places) <= NODES:
                stress[rows] = nominal_stress(material, places, mode)[back]
            else:
                nodes = np.geomspace(places[0], places[-1], NODES)
                spline = scipy.interpolate.CubicSpline(np.log(nodes), nominal_stress(material, nodes, mode))
                stress[rows] = spline(np.log(stretch))
        return stress
