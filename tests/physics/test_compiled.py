"""Compiled laws and statics equal those of `pliant.mechanics`: efforts, residual, stiffness, potential; errors."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.physics.conftest import SCALAR, ScalarStudy, StudyLaw, finger, random_chain, study

from pliant.errors import UserError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.law import ScalarLaw
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant_plugins.physics.compiled import cache_folder, discard_stale
from pliant_plugins.physics.compiled.efforts import efforts, law_potential
from pliant_plugins.physics.compiled.equilibrium import (
    factorise_chain,
    fill_dense,
    new_factor,
    solve_chain,
)
from pliant_plugins.physics.compiled.laws import CompiledLaws
from pliant_plugins.physics.compiled.statics import balance, new_frame, potential, stiffen
from pliant_plugins.physics.quasistatic.compiled_solver import Body, load_arrays

TWO = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -0.5))
PRESSURES = {"pressure_1_pa": 12e3, "pressure_2_pa": 5e3}


def acting(actuators: tuple[Actuator, ...], kind: str) -> tuple[Actuator, ...]:
    """Return the actuators with signs that a compiled chain of this kind takes."""
    return tuple(replace(a, sign=1.0) for a in actuators) if kind == "extensible" else actuators


def two_laws(kind: str, n: int = 5) -> ChainModel:
    """Return opposed actuators on a chain whose joints have two laws in turn; with the same sign on extensible ones."""
    chain = finger(SCALAR[kind](), n, actuators=acting(TWO, kind))
    joints = tuple(type(j)(k % 2, j.offset_m, j.rest_rotation) for k, j in enumerate(chain.joints))
    other = ScalarStudy(b_e=0.04) if kind == "revolute" else SCALAR[kind]()
    return chain.with_(laws=(*chain.laws, other), joints=joints)


@pytest.mark.parametrize("kind", SCALAR)
def test_efforts_equal_the_laws(kind: str) -> None:
    chain = two_laws(kind)
    laws = CompiledLaws.from_chain(chain)
    assert laws is not None
    n, a = chain.n_joints, len(chain.axes)
    q = np.random.default_rng(1).normal(size=(n, a)) * (0.003 if kind == "prismatic" else 0.6)
    if kind == "extensible":
        q[:, 3] *= 0.005
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
    assert CompiledLaws.from_chain(finger(StudyLaw())) is None


def not_scalar(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    tau[0] = open("x").read()  # type: ignore[assignment]  # noqa: SIM115, PTH123


def test_a_law_that_cannot_be_compiled_is_a_sentence() -> None:
    broken = ScalarStudy()
    broken.form = ScalarLaw(not_scalar, np.zeros(1))
    with pytest.raises(UserError, match=r"the law 'not_scalar' cannot be compiled"):
        CompiledLaws.from_chain(finger(broken))


def test_machine_code_older_than_the_room_is_discarded() -> None:
    old, new = cache_folder() / "test-old.nbi", cache_folder() / "test-new.nbi"
    for file in (old, new):
        file.touch()
    os.utime(old, (1.0, 1.0))
    discard_stale()
    kept = [file.exists() for file in (old, new)]
    Path(new).unlink()
    assert kept == [False, True]


def test_joints_with_one_law_share_its_parameters() -> None:
    law = ScalarStudy()
    laws = CompiledLaws.from_chain(finger(law, 30))
    assert laws is not None
    np.testing.assert_array_equal(laws.parameters, law.form.parameters)
    assert (laws.spans == [0, 5]).all()
    assert len(set(laws.addresses)) == 1
    assert law.form.function is study


def loaded(kind: str, seed: int) -> tuple[ChainModel, Inputs, np.ndarray]:
    """Return a chain turned in all directions under every kind of load, and joint coordinates."""
    random = np.random.default_rng(seed)
    two = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -0.7))
    chain = random_chain(seed, n=7).with_(laws=(SCALAR[kind](),), actuators=acting(two, kind))

    def place() -> np.ndarray:
        return random.normal(size=3) * 0.01

    inputs = Inputs(
        {"pressure_1_pa": 9e3, "pressure_2_pa": 4e3},
        random.normal(size=3) * 0.1,
        0.0 if kind == "prismatic" else 0.01,
        tuple(PointForce(body, place(), random.normal(size=3) * 0.1) for body in (0, 3, 7)),
        tuple(Cord(body, place(), random.normal(size=3), 0.3) for body in (0, 5)),
    )
    # Closed forms and series of rotations, and the transition between both.
    size = 0.003 if kind == "prismatic" else (0.9, 0.2, 0.06, 1e-9)[seed]
    q = random.normal(size=(7, len(chain.axes))) * size
    if kind == "extensible":
        q[:, 3] *= 0.01
    return chain, inputs, q


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", SCALAR)
def test_residual_stiffness_and_potential(kind: str, seed: int) -> None:
    chain, inputs, q = loaded(kind, seed)
    loads, statics, laws = (
        Loads.from_inputs(chain, inputs),
        ChainStatics(chain),
        CompiledLaws.from_chain(chain),
    )
    assert laws is not None
    body = tuple(Body.from_chain(chain))
    arrays = load_arrays(loads, np.array([9e3, 4e3]), chain.payload_kg)
    frame = new_frame(*q.shape, 2)
    size, norm = balance(body, laws.arrays, arrays, q, frame)
    parts, stiffness = new_factor(*q.shape, 3 + 3 * len(loads.cords)), np.zeros((q.size, q.size))
    skewness = stiffen(body, arrays, q, frame, parts)
    fill_dense(parts, stiffness)
    wanted = statics.balance(q, loads)
    largest = np.abs(wanted.residual).max()
    np.testing.assert_allclose(frame[9], wanted.residual, rtol=0, atol=1e-12 * largest)
    np.testing.assert_allclose(
        stiffness, wanted.stiffness, rtol=0, atol=1e-12 * np.abs(wanted.stiffness).max()
    )
    assert size == pytest.approx(largest) and norm == pytest.approx(np.linalg.norm(wanted.residual))
    assert skewness < 1e-15
    energy = potential(body, laws.arrays, arrays, q, frame)
    assert energy == pytest.approx(statics.potential(q, loads), rel=1e-12)


@pytest.mark.parametrize("n, a, rank", [(1, 1, 3), (9, 1, 3), (40, 1, 6), (1, 3, 3), (22, 3, 3), (22, 3, 9)])
def test_stiffness_factors_in_parts(n: int, a: int, rank: int) -> None:
    """Solutions are those of the dense matrix; positive agrees with its eigenvalues."""
    random = np.random.default_rng(n)
    parts, stiffness = new_factor(n, a, rank), np.zeros((n * a, n * a))
    parts[0][:], parts[1][:] = random.normal(size=(2, n, a, rank))
    own = random.normal(size=(n, a, a))
    parts[3][:] = own + own.transpose(0, 2, 1)
    fill_dense(parts, stiffness)
    np.testing.assert_array_equal(stiffness, stiffness.T)
    lowest = np.linalg.eigvalsh(stiffness)[0]
    right = random.normal(size=n * a)
    x = right.copy()
    shift = 1.0 - lowest
    assert factorise_chain(parts, shift)
    solve_chain(parts, x)
    np.testing.assert_allclose((stiffness + shift * np.eye(n * a)) @ x, right, atol=1e-10)
    assert factorise_chain(parts, 1e-9 - lowest)
    assert not factorise_chain(parts, -1e-9 - lowest)
    assert not factorise_chain(parts, np.nan)
