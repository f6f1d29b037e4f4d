"""Ends that are kept round: closed forms, energy, and the loop on a body that direct FEM solved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.evidence_structure import run
from tests.effects.bench import chain_with, settled

from pliant import api
from pliant.errors import UserError
from pliant.records.chain import ChainModel
from pliant.testing.samples import linear_law, sample_chain
from pliant_plugins.effects.end_restraint import ShortLaw
from pliant_plugins.effects.scale import rest_stiffness

PLAIN = sample_chain(modules=4, gravity=(0, 0, 0))
STATES = (np.array([0.0, 5e3, 9e3, 15e3]), np.array([[-0.2], [0.1], [0.25], [0.5]]))


def restrained(chain: ChainModel = PLAIN, **values: float) -> ChainModel:
    return chain_with(chain, "end_restraint", **values)


def bent(chain: ChainModel, moment: float = 0.0) -> np.ndarray:
    return settled(chain, moment_n_m=moment).joint_angles[:, 0]


def test_under_pressure_alone_the_ends_turn_by_their_shares_whatever_gives() -> None:
    free = bent(PLAIN)
    changed = bent(restrained(base_share=0.9, cap_share=0.6, base_give=0.3, cap_give=2.0))
    np.testing.assert_allclose(changed, free * [0.9, 1.0, 1.0, 0.6], rtol=1e-8)


def test_under_a_moment_a_give_adds_its_own_turn() -> None:
    moment = 1e-3
    give = moment * 2.0 / rest_stiffness(PLAIN)
    plain, changed = bent(PLAIN, moment), bent(restrained(cap_give=2.0), moment)
    np.testing.assert_allclose(plain - changed, [0.0, 0.0, 0.0, give], atol=1e-9)


def test_a_short_law_has_the_energy_for_its_share() -> None:
    law = PLAIN.laws[0]
    short = ShortLaw(law, 0.6)
    p, u = STATES
    np.testing.assert_allclose(short.potential(p, 0.6 * u), 0.6 * law.potential(p, u), rtol=1e-12)
    np.testing.assert_array_equal(short.evaluate(p, 0.6 * u).tau, law.evaluate(p, 0.6 * u / 0.6).tau)
    np.testing.assert_allclose(short.domain.deformation, 0.6 * law.domain.deformation)


def test_only_the_ends_get_separate_laws() -> None:
    chain = restrained(base_share=0.9, cap_share=0.6)
    assert [chain.laws[joint.law] is PLAIN.laws[0] for joint in chain.joints] == [False, True, True, False]
    assert restrained() is not PLAIN and restrained().laws == PLAIN.laws


def test_two_joints_are_both_ends() -> None:
    pair = sample_chain(linear_law(), modules=2, gravity=(0, 0, 0))
    free = bent(pair)
    np.testing.assert_allclose(bent(restrained(pair, cap_share=0.5)), free * [1.0, 0.5], rtol=1e-8)


# -- the loop on the direct FEM of a body of several modules --------------------------------------

RIVALS = ("stiffness", "actuation_gain", "inter_module_compliance")


@pytest.mark.slow
def test_the_loop_finds_the_ends_and_predicts_bodies_and_forces_it_has_not_seen(tmp_path: Path) -> None:
    opened = api.open_study(run.STUDY, [], store=tmp_path)
    found = api.improve(opened, kinds=("end_restraint", "link_stretch", *RIVALS))
    added = [kind for step in found.steps for kind in step.added]
    assert added[0] == "end_restraint" and not set(added) & set(RIVALS)
    effects = found.steps[-1].effects
    for modules, name in ((6, "six"), (6, "six_unseen"), (3, "three")):
        before, after = (run.errors(run.STUDY, modules, name, tmp_path, e) for e in ((), effects))
        fall = np.sqrt(np.mean(before[0] ** 2) / np.mean(after[0] ** 2))
        assert fall >= 3.0, f"{name}: {fall:.1f}"


def test_a_recording_with_another_module_count_is_refused_in_a_sentence(tmp_path: Path) -> None:
    opened = api.open_study(run.STUDY, ["chain.modules=1"], store=tmp_path)
    with pytest.raises(UserError, match="two joints or more"):
        api.extend(opened, ["end_restraint"])
