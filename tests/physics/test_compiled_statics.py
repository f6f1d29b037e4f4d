"""Compiled statics are those of `pliant.mechanics`: residual, stiffness, potential."""

from __future__ import annotations

import numpy as np
import pytest
from tests.physics.conftest import SCALAR, random_chain

from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import Actuator, ChainModel
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant_plugins.physics.compiled.equilibrium import (
    factorise_chain,
    fill_dense,
    new_factor,
    solve_chain,
)
from pliant_plugins.physics.compiled.laws import CompiledLaws
from pliant_plugins.physics.compiled.statics import balance, new_frame, potential, stiffen
from pliant_plugins.physics.quasistatic.compiled_solver import Body, load_arrays


def loaded(kind: str, seed: int) -> tuple[ChainModel, Inputs, np.ndarray]:
    """A chain turned in all directions under every kind of load, and joint coordinates."""
    random = np.random.default_rng(seed)
    two = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -0.7))
    chain = random_chain(seed, n=7).with_(laws=(SCALAR[kind](),), actuators=two)

    def place() -> np.ndarray:
        return random.normal(size=3) * 0.01

    inputs = Inputs(
        {"pressure_1_pa": 9e3, "pressure_2_pa": 4e3},
        random.normal(size=3) * 0.1,
        0.0 if kind == "prismatic" else 0.01,
        tuple(PointForce(body, place(), random.normal(size=3) * 0.1) for body in (0, 3, 7)),
        tuple(Cord(body, place(), random.normal(size=3), 0.3) for body in (0, 5)),
    )
    # Closed forms and series of rotations, and where one takes over from the other.
    size = 0.003 if kind == "prismatic" else (0.9, 0.2, 0.06, 1e-9)[seed]
    return chain, inputs, random.normal(size=(7, len(chain.axes))) * size


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", SCALAR)
def test_residual_stiffness_and_potential(kind: str, seed: int) -> None:
    chain, inputs, q = loaded(kind, seed)
    loads, statics, laws = Loads.of(chain, inputs), ChainStatics(chain), CompiledLaws.of(chain)
    assert laws is not None
    body = tuple(Body.of(chain))
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
def test_factors_of_a_stiffness_in_parts(n: int, a: int, rank: int) -> None:
    """Solutions are those of the dense matrix; positive is what its eigenvalues say."""
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
