"""Histories under several pressures in the compiled loop: those of plain stepping to 1e-9 rad, correct derivatives."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.diagnosis.quick import BENCH, effect
from tests.mechanics.test_several_actuations import several_law

from pliant.config.chain import ChainConfig
from pliant.interfaces.effect import Model
from pliant.interfaces.physics import Variation
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import Actuator, ChainModel
from pliant.records.history import History
from pliant.testing.samples import linear_law
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.histories import Follower
from pliant_plugins.physics.stepping import step_through

ENGINE = Quasistatic(QuasistaticConfig(tolerance=1e-13))
FIRST, SECOND = ("pressure_1_pa", "pressure_2_pa"), ("pressure_3_pa", "pressure_4_pa")
# None; a factor of the elastic part with memory; a moved rest; springs behind the laws, and shortened ends.
EFFECTS = ((), ("viscoelastic",), ("permanent_set",), ("inter_module_compliance", "end_restraint"))


def arm(second: str = "both") -> ChainModel:
    """Return two segments of two modules, the first under two pressures, the second under both or a separate one."""
    laws = (several_law(), several_law(seed=1) if second == "both" else linear_law(2e-6))
    names = (FIRST, SECOND if second == "both" else SECOND[:1])
    pieces = [
        Segment(rod_module(law, 0.02, 0.002), 2, 0.3, actuators=tuple(map(Actuator, own)))
        for law, own in zip(laws, names, strict=True)
    ]
    return build_chain(ChainConfig(modules=2), pieces)


def history(run: str = "a", scale: float = 1.0) -> History:
    """Return a history from rest: the two methods reach a first sample off rest differently, which affects damage."""
    t = np.linspace(0.0, 8.0, 17)
    levels = {
        name: scale * 6e3 * (1.0 - np.cos((0.7 + 0.2 * k) * t)) for k, name in enumerate((*FIRST, *SECOND))
    }
    force = 0.002 * np.stack([np.sin(t), np.sin(0.5 * t), 0.04 * t], axis=1)
    return History.from_arrays(levels, t, run=run, specimen="A", tip_force_n=force)


def with_effects(chain: ChainModel, *kinds: str) -> ChainModel:
    model = Model(chain)
    for kind in kinds:
        model = BENCH.build("effect", effect(kind)).apply(model)
    return model.chain


@pytest.mark.parametrize("kinds", EFFECTS, ids=lambda kinds: "+".join(kinds) or "none")
def test_they_equal_plain_stepping(kinds: tuple[str, ...]) -> None:
    chain, runs = with_effects(arm(), *kinds), [history(), history("again", 0.7)]
    assert Follower(ENGINE.config).takes(chain)
    compiled, _ = ENGINE.follow(chain, runs)
    plain, _ = step_through(ENGINE.build, chain, runs, [], ENGINE.config.longest_step_s)
    for a, b in zip(compiled, plain, strict=True):
        assert a.converged.all()
        assert b.converged.all()
        np.testing.assert_allclose(a.joint_angles, b.joint_angles, atol=1e-9, rtol=0)


def test_a_segment_under_two_pressures_beside_one_under_a_single_one() -> None:
    chain, runs = arm("one"), [history()]
    (compiled,), _ = ENGINE.follow(chain, runs)
    (plain,), _ = step_through(ENGINE.build, chain, runs, [], ENGINE.config.longest_step_s)
    np.testing.assert_allclose(
        compiled.joint_angles, plain.joint_angles, atol=1e-7, rtol=0
    )  # a table's error


def test_derivatives_by_one_pressure_are_differences_between_whole_runs() -> None:
    chain = with_effects(arm(), "viscoelastic")

    def pressed(x: float) -> History:
        return history().with_actuation(pressure_4_pa=x * history().actuation["pressure_4_pa"])

    _, (change,) = ENGINE.follow(chain, [pressed(1.0)], [Variation(chain, (pressed(1.0 + 1e-6),))])
    (up,), _ = ENGINE.follow(chain, [pressed(1.01)])
    (down,), _ = ENGINE.follow(chain, [pressed(0.99)])
    wanted = (up.joint_angles - down.joint_angles) / 0.02
    assert np.abs(wanted).max() > 5e-4
    np.testing.assert_allclose(change[0].joint_angles / 1e-6, wanted, atol=1e-3 * np.abs(wanted).max())


def test_a_law_without_a_scalar_form_is_followed_step_by_step() -> None:
    class Plain(type(several_law())):  # type: ignore[misc]
        def scalar(self) -> None:
            return None

    law = several_law()
    plain = Plain(**{field.name: getattr(law, field.name) for field in dataclasses.fields(law)})
    chain = arm()
    slow = chain.with_(laws=(plain, *chain.laws[1:]))
    assert not Follower(ENGINE.config).takes(slow)
    short = [history()]
    (a,), _ = ENGINE.follow(slow, short)
    (b,), _ = ENGINE.follow(chain, short)
    np.testing.assert_allclose(a.joint_angles, b.joint_angles, atol=1e-9, rtol=0)
