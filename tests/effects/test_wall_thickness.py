"""`wall_thickness`: one number scales both parts of a law; its exponents against the FEM to which they were fitted."""

from __future__ import annotations

import numpy as np
import pytest
from tests.effects.bench import chain_with, followed, model_with

from pliant.interfaces.effect import Model
from pliant.records.history import History
from pliant.testing.histories import HeldMotion, drive
from pliant.testing.samples import linear_law, sample_chain, softening_law
from pliant_plugins.effects.wall_thickness import WallThicknessConfig

P = 12e3


def test_both_parts_scale_by_their_powers() -> None:
    plain = Model(sample_chain(softening_law(), modules=1))
    angle = np.linspace(-0.3, 0.4, 15)

    def effort(model: Model, pressure: float) -> np.ndarray:
        return drive(model.chain, HeldMotion.from_angles(np.arange(15.0), angle, pressure)).effort

    thick = model_with(plain, "wall_thickness", ratio=1.1, elastic_exponent=3.0, actuation_exponent=-1.0)
    elastic, whole = effort(plain, 0.0), effort(plain, P)
    np.testing.assert_allclose(effort(thick, 0.0), 1.1**3 * elastic, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(effort(thick, P), 1.1**3 * elastic + (whole - elastic) / 1.1, rtol=1e-12)


def test_free_and_blocked_joints_tell_it_from_a_stiffness() -> None:
    """For a linear law the free angle scales with s^(b − a) and the moment that blocks the joint with s^b."""
    gain, stiffness, s = 8e-7, 0.04, 0.9
    chain = sample_chain(linear_law(gain, stiffness), modules=1, gravity=(0, 0, 0))
    blocked = s**0.33 * gain * P
    run = History.from_arrays({"pressure_pa": P}, moment_n_m=np.array([0.0, blocked]))
    (angles,) = followed(chain_with(chain, "wall_thickness", ratio=s), run)
    wanted = [gain * P / stiffness * s ** (0.33 - 2.15), 0.0]
    np.testing.assert_allclose(angles[:, 0], wanted, atol=1e-7)


@pytest.mark.parametrize("wall_m", [1.35e-3, 1.65e-3])
def test_the_exponents_equal_the_fem(wall_m: float, fem_states: list[dict[str, float]]) -> None:
    """At one bent state of walls outside the fit of the exponents: 3 % of E, 2 % of A."""
    moments = {(row["wall_m"], row["pressure_pa"]): row["moment_n_m"] for row in fem_states}
    config, nominal_m, pressure = WallThicknessConfig(), 1.5e-3, 9e3
    elastic = moments[wall_m, 0.0] / moments[nominal_m, 0.0]
    driven = [moments[wall, pressure] - moments[wall, 0.0] for wall in (wall_m, nominal_m)]
    ratio = wall_m / nominal_m
    assert elastic == pytest.approx(ratio**config.elastic_exponent, rel=0.03)
    assert driven[0] / driven[1] == pytest.approx(ratio**config.actuation_exponent, rel=0.02)
    assert abs(np.log(elastic)) > 0.15
