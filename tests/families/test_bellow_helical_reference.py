"""The helical bellow's defaults and one modulus against the published bending curves: a few of their states."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.families.published_y import CURVE, make_solver, published, relative_rms

from pliant_plugins.families.bellow_helical.family import BellowHelical, BellowHelicalConfig

MU = 193.4e3  # of the free curve and the 15 kPa moments, see the benchmark
DESIGN = {
    "inner_radius": "3.09 mm",
    "average_radius": "5.66 mm",
    "wall": "1.51 mm",
    "module_length": "4.72 mm",
}


def test_free_curve_and_predicted_moments() -> None:
    data = published()
    if data is None:
        pytest.skip(f"reference data absent: {CURVE}")
    family = BellowHelical(BellowHelicalConfig.model_validate(DESIGN))
    solver = make_solver(family.problem(axes=("y",)), MU)

    pressures = (2.5e3, 5e3, 7.5e3, 10e3, 12.5e3, 15e3)
    state, angles = solver.rest(), []
    for pressure in pressures:
        state = solver.free(pressure, state)
        angles.append(state.angle_rad / 2)
    wanted = np.interp(pressures, data.pressure[data.free], data.half_angle[data.free])
    assert relative_rms(np.array(angles), wanted) < 0.006

    at = ~data.free & (data.pressure == 10e3)
    order = np.argsort(data.half_angle[at])
    known = data.half_angle[at][order], data.moment[at][order]
    moments, given = [], (0.14, 0.07, 0.0, -0.07, -0.14)
    for angle in given:
        state = solver.constrained(10e3, 2 * angle, state)
        moments.append(state.moment_n_m)
    assert relative_rms(np.array(moments), np.interp(given, *known)) < 0.03
