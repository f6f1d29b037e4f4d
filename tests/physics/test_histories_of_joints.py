"""Histories of ball, prismatic and extensible joints, compiled: those of plain stepping, with correct derivatives."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from tests.diagnosis.quick import BENCH, effect
from tests.mechanics.test_several_actuations import several_law

from pliant.config.chain import ChainConfig
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.interfaces.physics import Variation
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import Actuator, ChainModel
from pliant.records.history import Followed, History
from pliant.records.law import Domain, JointLaw
from pliant.testing.samples import linear_spherical_law, sample_chain
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.histories import Follower
from pliant_plugins.physics.stepping import step_through
from pliant_plugins.surrogates.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.axes import axes_law
from pliant_plugins.surrogates.polynomial.law import study_law

ENGINE = Quasistatic(QuasistaticConfig(tolerance=1e-13))
NAMES = tuple(f"pressure_{k}_pa" for k in range(1, 5))
BALL, GROWING = ("x", "y", "z"), ("x", "y", "z", "e")
KINDS = ("ball", "segments", "turned", "prismatic", "extensible")
# A factor of the elastic part with memory; a moved rest; a moment with damage; springs behind the laws and short ends.
EFFECTS = (
    (),
    ("viscoelastic",),
    ("permanent_set",),
    ("mullins", "friction_hysteresis"),
    ("inter_module_compliance", "end_restraint"),
)
# A chain of tubes that only extend has none of these.
BENDING = {"inter_module_compliance", "end_restraint"}


def stated(gain: float, stiffness: float, axis: str = "y", joint: str = "revolute") -> JointLaw:
    numbers = StudyCoefficients(k_n=gain, m_a=-0.2 * gain, m_e=0.3 * stiffness, b_e=stiffness)
    return study_law(numbers, axis != "x", Domain.unbounded(1), "pressure_pa", axis, joint)  # type: ignore[arg-type]


@cache
def arm(kind: str) -> ChainModel:
    """Return modules of a kind under two or more pressures; tubes that extend under one."""
    if kind == "turned":
        axes = {"x": stated(0.0, 0.08, "x"), "y": stated(8e-7, 0.04), "z": stated(1e-7, 0.05, "z")}
        ring = [Actuator(name, 1.0, 2 * np.pi * k / 3) for k, name in enumerate(NAMES[:3])]
        pieces = [(axes_law(axes), ring)]
    elif kind == "prismatic":
        pieces = [(stated(2e-5, 150.0, "x", "prismatic"), [Actuator(NAMES[0])])]
    else:
        axes_of = GROWING if kind == "extensible" else BALL
        pieces = [(several_law(axes=axes_of), [Actuator(name) for name in NAMES[:2]])]
        if kind == "segments":
            pieces += [(several_law(axes=axes_of, seed=1), [Actuator(name) for name in NAMES[2:]])]
    segments = [
        Segment(rod_module(law, 0.02, 0.002), 2, 0.3 * k, actuators=tuple(own))
        for k, (law, own) in enumerate(pieces)
    ]
    return build_chain(ChainConfig(modules=2, payload="5 g"), segments)  # type: ignore[arg-type]


def history(run: str = "a", scale: float = 1.0, **changes: object) -> History:
    """Return a history from rest: the two methods reach a first sample off rest differently, which affects damage."""
    t = np.linspace(0.0, 6.0, 13)
    levels = {name: scale * 6e3 * (1.0 - np.cos((0.7 + 0.2 * k) * t)) for k, name in enumerate(NAMES)}
    force = 0.002 * np.stack([np.sin(t), np.sin(0.5 * t), 0.04 * t], axis=1)
    return History.from_arrays(levels, t, run=run, specimen="A", tip_force_n=force).with_(**changes)


def with_effects(chain: ChainModel, *kinds: str, **values: float) -> ChainModel:
    model = Model(chain)
    for kind in kinds:
        model = BENCH.build("effect", effect(kind, **values)).apply(model)
    return model.chain


def agree(chain: ChainModel, runs: list[History]) -> tuple[Followed, ...]:
    assert Follower(ENGINE.config).takes(chain)
    compiled, _ = ENGINE.follow(chain, runs)
    plain, _ = step_through(ENGINE.build, chain, runs, [], ENGINE.config.longest_step_s)
    for a, b in zip(compiled, plain, strict=True):
        assert a.converged.all()
        assert b.converged.all()
        assert np.ptp(a.joint_angles, axis=0).max() > 1e-4
        np.testing.assert_allclose(a.joint_angles, b.joint_angles, atol=2e-9, rtol=0)
    return compiled


@pytest.mark.parametrize("kinds", EFFECTS, ids=lambda kinds: "+".join(kinds) or "none")
@pytest.mark.parametrize("kind", KINDS)
def test_they_equal_plain_stepping(kind: str, kinds: tuple[str, ...]) -> None:
    if kind == "prismatic" and BENDING & set(kinds):
        pytest.skip("tubes that extend have no such effect")
    agree(with_effects(arm(kind), *kinds), [history(), history("again", 0.7)])


@pytest.mark.parametrize("kind", KINDS)
def test_loads_pose_and_payload_equal_plain_stepping(kind: str) -> None:
    still = np.tile([0.3, -0.5, 0.8], (13, 1))
    moment = np.zeros(13) if kind == "prismatic" else 1e-3 * np.sin(np.linspace(0.0, 6.0, 13))
    tilted = history("tilted", base_angles_rad=still, moment_n_m=moment)
    agree(arm(kind), [tilted, history("hung", payload_kg=np.full(13, 0.01)), history("slow", time_s=None)])


@pytest.mark.parametrize("kind", KINDS)
def test_input_derivatives_are_differences_between_whole_runs(kind: str) -> None:
    # Travels of micrometres are as small as the differences by which a kinked term's slope is taken.
    kinds = ("viscoelastic",) if kind == "extensible" else ("viscoelastic", "permanent_set")
    chain = with_effects(arm(kind), *kinds)

    def pressed(x: float) -> History:
        return history().with_actuation(pressure_1_pa=x * history().actuation["pressure_1_pa"])

    _, (change,) = ENGINE.follow(chain, [pressed(1.0)], [Variation(chain, (pressed(1.0 + 1e-6),))])
    (up,), _ = ENGINE.follow(chain, [pressed(1.005)])
    (down,), _ = ENGINE.follow(chain, [pressed(0.995)])
    close(change[0].joint_angles / 1e-6, (up.joint_angles - down.joint_angles) / 0.01)


@pytest.mark.parametrize("name", ["share", "time_s"])
@pytest.mark.parametrize("kind", KINDS)
def test_parameter_derivatives_are_differences_between_whole_runs(kind: str, name: str) -> None:
    values = {"share": 0.3, "time_s": 5.0}

    def varied(x: float) -> ChainModel:
        chain = with_effects(arm(kind), "viscoelastic", **{**values, name: x * values[name]})
        return with_effects(chain, "mullins")

    runs = [history(), history("again", 0.7)]
    _, (change,) = ENGINE.follow(varied(1.0), runs, [Variation(varied(1.0 + 1e-6), tuple(runs))])
    up, _ = ENGINE.follow(varied(1.005), runs)
    down, _ = ENGINE.follow(varied(0.995), runs)
    for a, b, c in zip(change, up, down, strict=True):
        close(a.joint_angles / 1e-6, (b.joint_angles - c.joint_angles) / 0.01)


def close(found: np.ndarray, wanted: np.ndarray) -> None:
    """Check each kind of coordinate relative to its own size: turns and travels."""
    size = np.abs(wanted).max(axis=(0, 1))
    assert size.max() > 1e-6
    np.testing.assert_array_less(np.abs(found - wanted).max(axis=(0, 1)), 3e-3 * size + 1e-9)


def test_a_variation_that_moves_no_joint_changes_nothing() -> None:
    chain = with_effects(arm("ball"), "viscoelastic")
    alike = with_effects(arm("ball"), "viscoelastic")
    _, (change,) = ENGINE.follow(chain, [history()], [Variation(alike, (history(),))])
    assert not change[0].joint_angles.any()


def test_a_base_that_turns_is_followed_sample_by_sample() -> None:
    chain, angles = arm("ball"), np.linspace([0, 0, 0], [0.3, 0.9, -0.4], 13)
    free = history(tip_force_n=np.zeros((13, 3)))
    (path,), _ = ENGINE.follow(chain, [free.with_(base_angles_rad=angles)])
    for k in (4, 12):
        (there,), _ = ENGINE.follow(chain, [free.with_(base_angles_rad=np.tile(angles[k], (13, 1)))])
        np.testing.assert_allclose(path.joint_angles[k], there.joint_angles[k], atol=1e-9)


def test_a_chain_that_stands_on_its_head_buckles_as_in_plain_stepping() -> None:
    """It buckles out of the plane in which it is loaded, where Newton's method alone stays on a saddle."""
    inside = arm("turned").laws[0].law  # type: ignore[attr-defined]
    module, ring = rod_module(inside, 0.011, 0.0016), arm("turned").actuators
    config = ChainConfig(modules=16, payload="60 g")  # type: ignore[call-arg, arg-type]
    chain = build_chain(config, [Segment(module, 16, 0.0, actuators=ring)])
    upside_down = np.tile([0.2, 2.9, 0.1], (13, 1))
    (path,) = agree(chain, [history(base_angles_rad=upside_down, tip_force_n=np.zeros((13, 3)))])
    assert np.abs(path.joint_angles).max() > 0.5


def test_tubes_that_only_extend_take_no_moment() -> None:
    with pytest.raises(UserError, match="takes no end moment"):
        ENGINE.follow(arm("prismatic"), [history(moment_n_m=np.full(13, 1e-3))])


def test_a_law_that_cannot_be_compiled_is_followed_step_by_step() -> None:
    chain = sample_chain(linear_spherical_law(), modules=2)
    assert not Follower(ENGINE.config).takes(chain)
    run = History.from_arrays({"pressure_pa": np.linspace(0.0, 1e4, 4)}, np.arange(4.0))
    (path,), _ = ENGINE.follow(chain, [run])
    assert path.converged.all() and np.ptp(path.joint_angles) > 0.01
