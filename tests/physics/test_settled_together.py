"""Chains that are packed and settled together have the equilibria of each alone, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.physics.helix import random_cases

from pliant.errors import ContractError, UserError
from pliant.interfaces.physics import Case
from pliant.records.rollout import PointForce
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.batch import packing_form
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig


@pytest.fixture(scope="module")
def cases():
    return random_cases(24, seed=3, modules=(6, 12))


def alone(backend, case):
    with backend.build(case.chain) as simulation:
        simulation.apply(case.inputs)
        return simulation.settle()


def same(one, other):
    numbers = ("residual", "converged", "stable", "iterations", "outside_domain")
    bits = all(np.array_equal(getattr(one, k), getattr(other, k)) for k in ("joint_angles", "markers_m"))
    return bits and all(getattr(one, name) == getattr(other, name) for name in numbers)


def test_together_as_alone(cases):
    backend = Quasistatic(QuasistaticConfig())
    assert all(packing_form(case) for case in cases)
    found = backend.settle_batch(cases)
    assert all(same(one, alone(backend, case)) for one, case in zip(found, cases, strict=True))
    assert any(one.outside_domain for one in found) and any(not one.outside_domain for one in found)


def test_a_load_at_a_point_stands_among_them(cases):
    force = PointForce(2, np.zeros(3), np.array([0.0, 0.01, 0.0]))
    mixed = [cases[0], replace(cases[1], inputs=replace(cases[1].inputs, forces=(force,))), cases[2]]
    assert [packing_form(case) is None for case in mixed] == [False, True, False]
    backend = Quasistatic(QuasistaticConfig())
    found = backend.settle_batch(mixed)
    assert all(same(one, alone(backend, case)) for one, case in zip(found, mixed, strict=True))
    assert not same(found[1], alone(backend, cases[1]))


def test_what_the_direct_way_cannot_do_is_gone_to_step_by_step(cases):
    hasty = Quasistatic(QuasistaticConfig(max_iterations=3))
    case = max(cases, key=lambda one: one.inputs.actuation["pressure_pa"])
    (found,) = hasty.settle_batch([case])
    assert found.converged and found.iterations > 3 and same(found, alone(hasty, case))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_input_that_is_no_number_has_its_sentence(cases, value):
    bad = Case(cases[1].chain, replace(cases[1].inputs, actuation={"pressure_pa": value}))
    with pytest.raises(UserError, match="pressure_pa"):
        Quasistatic(QuasistaticConfig()).settle_batch([cases[0], bad])


def test_a_law_that_is_not_there_is_no_crash(cases):
    joints = cases[0].chain.joints
    broken = cases[0].chain.with_(joints=(replace(joints[0], law=7), *joints[1:]))
    with pytest.raises(ContractError, match="law"):
        Quasistatic(QuasistaticConfig()).settle_batch([Case(broken, cases[0].inputs), cases[1]])
