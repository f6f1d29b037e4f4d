"""Trusted states of all designs in the common form's scales: what the networks are trained on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.solved import SolvedDesigns
from pliant_plugins.meta_models.common_form import CommonForm
from pliant_plugins.meta_models.common_form_scales import fitted


@dataclass(frozen=True, eq=False)
class ScaledStates:
    """n states of k axes of designs with d parameters.

    Attributes:
        places: (designs, d) scaled parameters.
        design: (n,) the design of each state.
        points: (n, 1 + k) x = p / p_max and v = u / reach.
        tau: (n, k) efforts times reach over energy; gain: (n, k) ∂/∂x; slope: (n, k, k) ∂/∂v. Unknown ones are NaN.
    """

    places: Array
    design: NDArray[np.int64]
    points: Array
    tau: Array
    gain: Array
    slope: Array

    @staticmethod
    def of(designs: SolvedDesigns, form: CommonForm) -> ScaledStates:
        """States of role "fit" whose status is trusted."""
        reaches, energies = form.reach(designs.values), form.energy(designs.values)
        top = form.largest_actuation
        parts: list[tuple[Array, ...]] = []
        for number, data in enumerate(designs.data):
            keep = fitted(data)
            reach, energy = reaches[number], energies[number]
            x, v = data.actuation[keep] / top, data.deformation[keep] / reach
            parts.append(
                (
                    np.full(len(x), number),
                    np.column_stack([x, v]),
                    data.tau[keep] * reach / energy,
                    data.dtau_dp[keep] * reach * top / energy,
                    data.dtau_du[keep] * reach[:, None] * reach / energy,
                )
            )
        design, points, tau, gain, slope = (np.concatenate(column) for column in zip(*parts, strict=True))
        return ScaledStates(form.parameters(designs.values), design, points, tau, gain, slope)
