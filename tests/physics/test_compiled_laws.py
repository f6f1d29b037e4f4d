"""Laws as function pointers: the same efforts as the laws themselves, and errors in sentences."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from tests.physics.conftest import SCALAR, ScalarStudy, StudyLaw, finger, study

from pliant.errors import UserError
from pliant.mechanics.efforts import JointEfforts
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.law import ScalarLaw
from pliant_plugins.physics.compiled import cache_folder, discard_stale
from pliant_plugins.physics.compiled.efforts import efforts, law_potential
from pliant_plugins.physics.compiled.laws import CompiledLaws

TWO = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -0.5))
PRESSURES = {"pressure_1_pa": 12e3, "pressure_2_pa": 5e3}


def two_laws(kind: str, n: int = 5) -> ChainModel:
    """Opposed actuators on a chain whose joints have two laws in turn."""
    chain = finger(SCALAR[kind](), n, actuators=TWO)
    joints = tuple(type(j)(k % 2, j.offset_m, j.rest_rotation) for k, j in enumerate(chain.joints))
    other = ScalarStudy(b_e=0.04) if kind == "revolute" else SCALAR[kind]()
    return chain.with_(laws=(*chain.laws, other), joints=joints)


@pytest.mark.parametrize("kind", SCALAR)
def test_efforts_are_those_of_the_laws(kind: str) -> None:
    chain = two_laws(kind)
    laws = CompiledLaws.of(chain)
    assert laws is not None
    n, a = chain.n_joints, len(chain.axes)
    q = np.random.default_rng(1).normal(size=(n, a)) * (0.003 if kind == "prismatic" else 0.6)
    tau, by_actuator, by_q = np.empty((n, a)), np.empty((2, n, a)), np.empty((n, a, a))
    efforts(laws.arrays, q, np.array([*PRESSURES.values()]), tau, by_actuator, by_q)
    wanted = JointEfforts(chain).evaluate(q, PRESSURES)
    np.testing.assert_allclose(tau, wanted.tau, rtol=1e-13, atol=1e-16)
    np.testing.assert_allclose(by_q, wanted.dtau_du, rtol=1e-13, atol=1e-16)
    for row, name in enumerate(PRESSURES):
        np.testing.assert_allclose(by_actuator[row], wanted.dtau_dp[name], rtol=1e-13, atol=1e-20)
    potential = law_potential(laws.arrays, q, np.array([*PRESSURES.values()]))
    assert potential == pytest.approx(JointEfforts(chain).potential(q, PRESSURES), rel=1e-12)


def test_a_law_without_scalar_form_has_no_compiled_one() -> None:
    assert CompiledLaws.of(finger(StudyLaw())) is None


def not_scalar(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    tau[0] = open("x").read()  # type: ignore[assignment]  # noqa: SIM115, PTH123


def test_a_law_that_cannot_be_compiled_is_a_sentence() -> None:
    broken = ScalarStudy()
    broken.form = ScalarLaw(not_scalar, np.zeros(1))
    with pytest.raises(UserError, match=r"the law 'not_scalar' cannot be compiled"):
        CompiledLaws.of(finger(broken))


def test_machine_code_older_than_the_room_is_discarded() -> None:
    old, new = cache_folder() / "test-old.nbi", cache_folder() / "test-new.nbi"
    for file in (old, new):
        file.touch()
    os.utime(old, (1.0, 1.0))
    discard_stale()
    kept = [file.exists() for file in (old, new)]
    Path(new).unlink()
    assert kept == [False, True]


def test_joints_of_one_law_share_its_parameters() -> None:
    law = ScalarStudy()
    laws = CompiledLaws.of(finger(law, 30))
    assert laws is not None
    np.testing.assert_array_equal(laws.parameters, law.form.parameters)
    assert (laws.spans == [0, 5]).all()
    assert len(set(laws.addresses)) == 1
    assert law.form.function is study
