"""Pieces that pressure lengthens: what it moves, what it leaves alone."""

from __future__ import annotations

import numpy as np
from tests.effects.bench import model_with

from pliant.mechanics.kinematics import ChainGeometry
from pliant.testing.samples import sample_chain

ANGLES = np.array([[0.3], [-0.1], [0.2]])
BASE = np.array([0.1, -0.2, 0.4])
CHAIN = sample_chain(modules=3).with_(base_position_m=BASE)


def reported(per_mpa: float, pressure_pa: float) -> dict[str, float]:
    tip = ChainGeometry.of(CHAIN).markers(ANGLES)[-1]
    readings = {f"tip_{axis}_m": float(tip[k]) for k, axis in enumerate("xyz")}
    readings |= {"angle_rad": 0.4, "actuation": pressure_pa}
    return dict(model_with(CHAIN, "link_stretch", strain_per_mpa=per_mpa).reported(readings))


def test_positions_are_those_of_a_chain_with_longer_pieces() -> None:
    strain = 2.0 * 15e3 / 1e6
    longer = CHAIN.with_(
        joints=tuple(
            type(joint)(joint.law, (1 + strain) * joint.offset_m, joint.rest_rotation)
            for joint in CHAIN.joints
        ),
        tip_offset_m=(1 + strain) * CHAIN.tip_offset_m,
    )
    tip = ChainGeometry.of(longer).markers(ANGLES)[-1]
    found = reported(2.0, 15e3)
    np.testing.assert_allclose([found[f"tip_{axis}_m"] for axis in "xyz"], tip, rtol=1e-12)
    assert found["angle_rad"] == 0.4


def test_without_pressure_or_without_knowing_it_nothing_moves() -> None:
    assert reported(2.0, 0.0) == reported(0.0, 15e3) | {"actuation": 0.0}
    model = model_with(CHAIN, "link_stretch", strain_per_mpa=2.0)
    assert model.reported({"tip_x_m": 0.05}) == {"tip_x_m": 0.05}
