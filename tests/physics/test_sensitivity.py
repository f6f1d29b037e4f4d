"""Derivatives of equilibria against differences of equilibria."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.physics.conftest import SCALAR, ScalarSpatial, ScalarStudy, StudyLaw, finger, random_chain, settle

from pliant.errors import UserError
from pliant.records.chain import ChainModel, default_base_rotation
from pliant.records.rollout import Cord, Equilibrium, Inputs, PointForce, Sensitivity
from pliant.records.term import LawTerm
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

BACKEND = Quasistatic(QuasistaticConfig(tolerance=1e-13, max_iterations=100))
LOADS: dict[str, Any] = {
    "forces": (PointForce(2, np.array([0.0, 0.0, 0.004]), np.array([0.0, 0.05, 0.02])),),
    "cords": (Cord(4, np.array([0.002, 0.0, 0.003]), np.array([0.3, 0.1, -0.2]), 0.1),),
}
FORCE = np.array([0.02, 0.01, -0.05])


def make_chain(kind: str) -> ChainModel:
    if kind == "random":
        return random_chain().with_(laws=(ScalarSpatial(),))
    return finger(SCALAR[kind](), 6, 0.0016, 0.01, payload_kg=0.02)


def solve(chain: ChainModel, pressure: float = 9e3, force: Any = FORCE, moment: float = 0.0) -> Equilibrium:
    return settle(BACKEND, chain, Inputs({"pressure_pa": pressure}, force, moment, **LOADS))


def derivatives(chain: ChainModel) -> Sensitivity:
    simulation = BACKEND.build(chain)
    simulation.apply(Inputs({"pressure_pa": 9e3}, FORCE, **LOADS))
    assert simulation.settle().converged
    return simulation.sensitivity()


def difference(at: Callable[[float], Equilibrium], step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the central difference of fourth order of joint angles and markers."""
    ends = {k: at(k * step) for k in (-2, -1, 1, 2)}
    assert all(end.converged for end in ends.values())

    def combine(name: str) -> np.ndarray:
        value = {k: getattr(end, name) for k, end in ends.items()}
        return np.asarray((8 * (value[1] - value[-1]) - (value[2] - value[-2])) / (12 * step))

    return combine("joint_angles"), combine("markers_m")


def agree(found: Sensitivity, name: str, place: Any, wanted: tuple[np.ndarray, np.ndarray]) -> None:
    for ours, theirs in zip((found.joint_angles, found.markers_m), wanted, strict=True):
        scale = np.abs(theirs).max()
        np.testing.assert_allclose(ours[name][place], theirs, rtol=0, atol=1e-6 * scale + 1e-15)


@pytest.mark.parametrize("kind", [*SCALAR, "random"])
def test_inputs_and_loads(kind: str) -> None:
    chain = make_chain(kind)
    found = derivatives(chain)
    agree(found, "pressure_pa", ..., difference(lambda h: solve(chain, 9e3 + h), 20.0))
    along, gravity = np.eye(3), np.array([0.0, 0.0, -9.81])
    for c in range(3):
        at = (..., c)
        agree(
            found,
            "tip_force_n",
            at,
            difference(lambda h, c=c: solve(chain, force=FORCE + h * along[c]), 1e-3),
        )
        agree(
            found,
            "gravity_m_s2",
            at,
            difference(lambda h, c=c: solve(chain.with_(gravity_m_s2=gravity + h * along[c])), 2e-2),
        )
    payload = chain.payload_kg
    agree(found, "payload_kg", ..., difference(lambda h: solve(chain.with_(payload_kg=payload + h)), 1e-4))
    if kind == "prismatic":
        assert "moment_n_m" not in found.joint_angles
    else:
        agree(found, "moment_n_m", ..., difference(lambda h: solve(chain, moment=h), 1e-4))


def test_parameters_in_each_law() -> None:
    """Two laws in turn; a parameter that is 0 has a derivative too."""
    values = {"k_n": 1.637e-6, "m_a": -1.704e-6, "b_a": 0.0, "m_e": 0.1012, "b_e": 0.03}

    def chain(**changes: float) -> ChainModel:
        made = finger(ScalarStudy(), 6, 0.0016, 0.01, payload_kg=0.02)
        joints = tuple(type(j)(k % 2, j.offset_m, j.rest_rotation) for k, j in enumerate(made.joints))
        return made.with_(joints=joints, laws=(ScalarStudy(), ScalarStudy(**{**values, **changes})))

    found = derivatives(chain())
    assert found.joint_angles["law_0"].shape == found.joint_angles["law_1"].shape == (6, 1, 5)
    for index, (name, value) in enumerate(values.items()):
        step = 1e-3 * (abs(value) or 0.02)
        wanted = difference(lambda h, name=name, value=value: solve(chain(**{name: value + h})), step)
        agree(found, "law_1", (..., index), wanted)


def _stiffer(angle: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    return 1.0 + c[0] * angle * angle + 1e-5 * p


def test_law_terms_take_part() -> None:
    """A factor on the elastic effort depends on angle and pressure."""
    term = LawTerm("elastic", _stiffer, (0.3,))
    chain = make_chain("revolute").with_(terms=(term,))
    found = derivatives(chain)
    agree(found, "pressure_pa", ..., difference(lambda h: solve(chain, 9e3 + h), 20.0))
    agree(found, "payload_kg", ..., difference(lambda h: solve(chain.with_(payload_kg=0.02 + h)), 1e-4))


def test_a_law_without_scalar_form_is_left_out() -> None:
    found = derivatives(finger(StudyLaw(), 6, 0.0016, 0.01))
    assert "law_0" not in found.joint_angles and "pressure_pa" in found.joint_angles


def test_no_derivatives_where_nothing_has_settled() -> None:
    simulation = BACKEND.build(finger(ScalarStudy()))
    with pytest.raises(UserError, match="settle"):
        simulation.sensitivity()
    runaway = Quasistatic(QuasistaticConfig(max_iterations=15, smallest_step=0.25)).build(
        finger(ScalarStudy(m_e=0.0, b_e=-0.02))
    )
    runaway.apply(Inputs({"pressure_pa": 1e3}))
    assert not runaway.settle().converged
    with pytest.raises(UserError, match="converged"):
        runaway.sensitivity()


def test_no_derivatives_where_the_stiffness_is_singular() -> None:
    """A joint without stiffness in balance is neutral, so it counts as stable, but nothing restores it."""
    free = finger(ScalarStudy(k_n=0.0, m_a=0.0, m_e=0.0, b_e=0.0), 1, base_rotation=default_base_rotation())
    simulation = BACKEND.build(free.with_(gravity_m_s2=np.zeros(3)))
    simulation.apply(Inputs({"pressure_pa": 0.0}))
    assert simulation.settle().converged
    with pytest.raises(UserError, match="singular"):
        simulation.sensitivity()
