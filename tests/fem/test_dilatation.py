"""The mixed element's density: stress and tangent in (F, ϑ, q/K) against differences of its energy."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.registry.discovery import discover
from pliant_plugins.fem.skfem.dilatation import Dilatation, mixed

STEP = 1e-6
LAWS = {
    "neo_hookean": {"shear_modulus": "1 Pa"},
    "mooney_rivlin": {"c10": "0.3 Pa", "c01": "0.2 Pa"},
    "ogden": {"mu": ["0.8 Pa", "0.2 Pa"], "alpha": [1.8, -2.5]},
}


@pytest.mark.parametrize("kind", LAWS)
def test_stress_and_tangent_are_the_energy_slopes(kind: str) -> None:
    """Compare all 11 × 11 entries, ∂²W/∂ϑ² among them, at a state far from rest whose ϑ is not J."""
    component = discover().get("material", kind)
    material: Material = component.build(
        component.config_model()(kind=kind, poisson_ratio=0.45, **LAWS[kind])
    )
    F = np.eye(3) + np.array([[0.3, 0.2, -0.1], [0.05, -0.2, 0.15], [0.1, -0.25, 0.2]])
    here = np.array([*F.ravel(), 0.12, -0.03])

    def at(x: Array) -> Dilatation:
        density = mixed(material, x[:9].reshape(1, 1, 3, 3), x[9:10, None], x[10:, None])
        assert density is not None
        return density

    law = at(here)
    slopes, curvatures = np.empty(11), np.empty((11, 11))
    for k, unit in enumerate(np.eye(11)):
        above, below = at(here + STEP * unit), at(here - STEP * unit)
        slopes[k] = (above.energy - below.energy)[0, 0] / (2 * STEP)
        curvatures[k] = (above.stress - below.stress)[0, 0] / (2 * STEP)
    np.testing.assert_allclose(law.stress[0, 0], slopes, rtol=0, atol=1e-8 * np.abs(slopes).max())
    np.testing.assert_allclose(law.tangent[0, 0], curvatures, rtol=0, atol=1e-8 * np.abs(curvatures).max())
    assert (
        abs(law.tangent[0, 0, 9, 9]) > 1e-3 * np.abs(curvatures).max()
    )  # large enough that its factors matter
