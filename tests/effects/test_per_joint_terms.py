"""Law terms that differ from joint to joint: the compiled loop, plain Python, Newton in all joints and MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.effects.bench import ENGINE, chain_with, engine, followed, stepped

from pliant.errors import ContractError
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.testing.histories import first_joint, follow_joint, triangles
from pliant.testing.samples import sample_chain, softening_law

F = 15e3  # of a sample law without units


def rubbing(modules: int = 3, **chain: object) -> ChainModel:
    law = replace(softening_law(), actuation_name="tendon_force_n")
    plain = sample_chain(law, modules=modules, **chain)
    return chain_with(plain, "tendon_friction", friction=0.3, wrap_at_rest_rad=0.2)


def pull(levels: tuple[float, ...], rate: float, step_s: float) -> History:
    time_s, force = triangles(levels, rate, step_s, holds_s=2.0)
    return History.from_arrays({"tendon_force_n": force}, time_s)


def alone(chain: ChainModel, joint: int) -> ChainModel:
    """Return one joint with its own numbers."""
    terms = tuple(replace(term, per_joint=(term.per_joint[joint],)) for term in chain.terms)
    return first_joint(chain.with_(terms=terms))


def test_weightless_joints_each_equal_plain_python() -> None:
    chain = rubbing(gravity=(0, 0, 0))
    runs = [
        pull((F, 4e3, 9e3, 0.0), 5e3, 0.25),
        History.from_arrays({"tendon_force_n": np.array([0, F, 5e3, 9e3])}),
    ]
    compiled = ENGINE.follow(chain, runs)[0]
    for joint in range(3):
        for there, here in zip(compiled, follow_joint(alone(chain, joint), runs), strict=True):
            np.testing.assert_allclose(there.joint_angles[:, joint, 0], here, atol=1e-6)
    angle = compiled[0].joint_angles[:, :, 0]
    assert np.ptp(angle[np.argmax(angle[:, 0])]) > 0.02  # the joints do differ


def test_a_loaded_chain_walks_the_same_path_by_newton_in_all_joints() -> None:
    chain = rubbing(payload=0.004)
    run = pull((F, 5e3), 5e3, 0.5)
    (path,), _ = ENGINE.follow(chain, [run])
    np.testing.assert_allclose(path.joint_angles, stepped(chain, run, 0.5), atol=2e-5)


def test_mujoco_in_slow_motion_is_the_quasi_static_path() -> None:
    chain = rubbing(payload=0.004)
    run = pull((F, 5e3, 9e3), 1e3, 1.0)
    (slow,) = followed(chain, run, by=engine("quasistatic", longest_step_s=0.1))
    (path,) = followed(chain, run, by=engine("mujoco"))  # steps of 0.1 s would skip its turns
    span = float(np.ptp(slow, axis=0).max())
    np.testing.assert_allclose(path, slow, atol=0.005 * span)


def test_numbers_for_another_chain_are_refused() -> None:
    chain = rubbing(3)
    longer = rubbing(4)
    with pytest.raises(ContractError, match="has numbers for 3 joints; the chain has 4"):
        ENGINE.follow(longer.with_(terms=chain.terms), [pull((F,), 5e3, 0.5)])
