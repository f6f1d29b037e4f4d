"""Effects at joints and tendons of MuJoCo models, each by a physical law."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco")

from tests.pliant_mjcf.stepping import (
    REGISTRY,
    changes,
    compiled,
    effect,
    exported,
    moved,
    pendula,
    rotor,
)

from pliant.errors import UserError
from pliant_mjcf.effects_manifest import effect_components

INERTIA = 0.01
SERVO = '<actuator><position name="servo" joint="hinge" kp="4" kv="0.4"/></actuator>'
CORD = """<mujoco><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/><worldbody>
<site name="anchor" pos="1 0 0"/><body name="sledge"><joint name="slide" type="slide" axis="1 0 0" damping="2"/>
<geom size="0.1" mass="1"/><site name="eye"/></body></worldbody>
<tendon><spatial name="cord" {tendon}><site site="anchor"/><site site="eye"/></spatial></tendon>{more}</mujoco>"""


def crossings(values: Any, step: float = 0.001) -> float:
    """Return the period, from the first to the last upward crossing of zero."""
    up = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    return float((up[-1] - up[0]) / (len(up) - 1) * step)


@pytest.mark.parametrize("component", effect_components(), ids=lambda c: c.kind)
def test_each_effect_is_declared_with_words(component: Any) -> None:
    config = component.config_model()
    built = component.build(config(kind=component.kind, **component.smallest_block()))
    notes = built.notes
    assert built.models == component.models == ("mjcf",) and component.problem() is None
    assert notes.confounder in REGISTRY.kinds("effect") and notes.where and notes.excitation
    assert 40 <= len(notes.inspection) <= 170 and ". " not in notes.inspection
    assert (
        len(component.summary) <= 60
        and "pressure" not in notes.signature + notes.inspection + notes.excitation
    )
    assert built.config.fit_parameters() and config(kind=component.kind).kind == component.kind


def test_stiffness_gives_the_period_of_a_spring() -> None:
    run = moved(
        rotor('stiffness="1"'), effect("stiffness", stiffness_n_m_per_rad=3.0), q=[[0.3]], seconds=3.0
    )
    assert crossings(run.q[:, 0, 0]) == pytest.approx(2 * np.pi * np.sqrt(INERTIA / 4.0), rel=0.01)


def test_stiffness_is_taken_away_down_to_none() -> None:
    assert (
        compiled(rotor('stiffness="1"'), effect("stiffness", stiffness_n_m_per_rad=-3.0)).jnt_stiffness[0]
        == 0.0
    )
    assert compiled(rotor('damping="1"'), effect("viscous_damping", damping_n_m_s=-3.0)).dof_damping[0] == 0.0
    model = compiled(rotor('frictionloss="1"'), effect("coulomb_friction", moment_n_m=-0.4))
    assert model.dof_frictionloss[0] == pytest.approx(0.6)


def test_a_rest_angle_is_where_the_joint_comes_to_rest() -> None:
    run = moved(rotor('stiffness="2" damping="0.3"'), effect("rest_angle", shift_rad=0.2), seconds=3.0)
    assert run.q[-1, 0, 0] == pytest.approx(0.2, abs=1e-3)
    with pytest.raises(UserError, match="no joint of it has one"):
        compiled(rotor(), effect("rest_angle", shift_rad=0.2))


def test_damping_decays_at_its_rate() -> None:
    run = moved(rotor(), effect("viscous_damping", damping_n_m_s=0.05), v=[[2.0]], seconds=0.3)
    rate = -np.log(run.v[-1, 0, 0] / 2.0) / 0.299
    assert rate == pytest.approx(0.05 / INERTIA, rel=0.01)


def test_quadratic_damping_decays_hyperbolically() -> None:
    """I dv/dt = −c v²/ω̂, so that 1/v grows by c / (I ω̂) per second."""
    run = moved(
        rotor(), effect("viscous_damping", damping_n_m_s=0.01, rate_power=2.0), v=[[2.0]], seconds=0.5
    )
    slope = (1.0 / run.v[-1, 0, 0] - 0.5) / 0.499
    assert slope == pytest.approx(0.01 / (INERTIA * 0.1), rel=0.02)


def test_a_power_of_the_rate_is_stable_and_gives_no_energy() -> None:
    stiff = moved(
        rotor(), effect("viscous_damping", damping_n_m_s=1e3, rate_power=0.5), v=[[2.0]], seconds=0.1
    )
    assert np.all(np.abs(np.diff(stiff.v[:, 0, 0])) <= 2.0) and abs(stiff.v[-1, 0, 0]) < 1e-3
    less = effect("viscous_damping", damping_n_m_s=-5.0, rate_power=0.5)
    assert np.all(
        np.diff(np.abs(moved(rotor('damping="0.1"'), less, v=[[2.0]], seconds=0.2).v[:, 0, 0])) < 1e-9
    )


def test_coulomb_friction_holds_below_its_level_only() -> None:
    more = '<actuator><motor joint="hinge"/></actuator>'
    friction = effect("coulomb_friction", moment_n_m=0.5)
    assert abs(moved(rotor(more=more), friction, u=lambda t: [0.4]).q[-1, 0, 0]) < 0.05  # of 20 without
    run = moved(rotor(more=more), friction, u=lambda t: [0.7], seconds=0.5)
    assert run.v[-1, 0, 0] == pytest.approx(0.2 / INERTIA * 0.5, rel=0.05)


def test_stribeck_friction_is_lower_in_motion_than_at_rest() -> None:
    more = '<actuator><motor joint="hinge"/></actuator>'
    friction = (
        effect("coulomb_friction", moment_n_m=0.3),
        effect("stribeck_friction", moment_n_m=0.4, sliding_ratio=0.0, speed_rad_s=0.2),
    )
    assert abs(moved(rotor(more=more), *friction, u=lambda t: [0.6]).v[-1, 0, 0]) < 0.1
    run = moved(rotor(more=more), *friction, u=lambda t: [0.6], v=[[3.0]], seconds=0.3)
    assert run.v[-1, 0, 0] == pytest.approx(3.0 + 0.3 / INERTIA * 0.3, rel=0.05)
    slow = moved(rotor(more=more), *friction, v=[[1.0]], seconds=0.5)
    assert abs(slow.v[-1, 0, 0]) < 1e-3


def test_the_loop_of_hysteresis_has_the_area_of_an_elastoplastic_element() -> None:
    """4 M_y (A − δ) per cycle between ±A, at any rate."""
    amplitude, moment, delta = 0.5, 0.2, 0.05
    slip = effect("friction_hysteresis", yield_n_m=moment, break_away_rad=delta)
    for period in (0.5, 2.0):
        run = moved(
            rotor(),
            slip,
            seconds=2 * period,
            prescribed=lambda t, p=period: amplitude * np.sin(2 * np.pi * t / p),
        )
        half = len(run.q) // 2
        area = -np.sum(run.force[half:-1, 0, 0] * np.diff(run.q[half:, 0, 0]))
        assert area == pytest.approx(4 * moment * (amplitude - delta), rel=0.02)
        assert np.abs(run.force).max() == pytest.approx(moment, rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("friction_hysteresis", {"yield_n_m": 50.0, "break_away_rad": 1e-5}),
        ("viscoelastic", {"stiffness_n_m_per_rad": 1e6, "time_s": 0.01}),
        ("viscous_damping", {"damping_n_m_s": 1e4, "rate_power": 1.4}),
    ],
)
def test_forces_far_too_stiff_for_the_step_stay_bounded(kind: str, values: dict[str, float]) -> None:
    """Four links in a row, whose inertias are strongly coupled."""
    link = '<body pos="0 0 -0.2"><joint axis="0 1 0"/><geom size="0.02" mass="0.1" pos="0 0 -0.1"/>'
    mjcf = f"<mujoco><worldbody>{4 * link}{4 * '</body>'}</worldbody></mujoco>"
    run = moved(mjcf, effect(kind, **values), q=[[0.5, -0.3, 0.2, 0.4]], v=[[1.0, -2.0, 3.0, 1.0]])
    assert np.abs(run.v).max() < 10.0 and np.abs(run.q).max() < 1.5


def test_a_relaxing_branch_forgets_a_step_within_its_time() -> None:
    branch = effect("viscoelastic", stiffness_n_m_per_rad=2.0, time_s=0.3)
    run = moved(rotor(), branch, seconds=1.0, prescribed=lambda t: 0.1 if t > 0.0005 else 0.0)
    force = -run.force[:, 0, 0]
    assert force[1] == pytest.approx(0.2, rel=0.01)
    assert force[301] / force[1] == pytest.approx(np.exp(-1.0), rel=0.01)


def test_surfaces_that_slip_one_after_another_and_several_times_of_relaxation() -> None:
    """Three elements with a third of the moment each; a spread of none is the plain law."""

    def push(t: float) -> float:
        return 0.06 * t

    def force(kind: str, **values: float) -> Any:
        return moved(rotor(), effect(kind, **values), seconds=1.0, prescribed=push).force[:, 0, 0]

    slips = {"yield_n_m": 0.3, "break_away_rad": 0.05}
    found, at = force("friction_hysteresis", **slips, spread=0.5), 0.06 * np.linspace(0.0, 1.0, 1001)
    parts = [np.minimum(at / (0.05 * ratio), 1.0) for ratio in (1.0, 0.5, 2.5)]
    assert -found[:1000] == pytest.approx(0.1 * np.sum(parts, axis=0)[:1000], abs=2e-3)
    branch = {"stiffness_n_m_per_rad": 3.0}
    several = force("viscoelastic", **branch, time_s=0.3, spread=3.0)
    alone = [force("viscoelastic", **branch, time_s=t) for t in (0.3, 0.9, 0.1)]
    assert several == pytest.approx(np.mean(alone, axis=0), abs=1e-9)


def test_slow_motion_of_a_relaxing_branch_is_that_of_a_dashpot() -> None:
    branch = effect("viscoelastic", stiffness_n_m_per_rad=2.0, time_s=0.02)
    run = moved(rotor(), branch, seconds=0.5, prescribed=lambda t: 0.5 * t)
    assert run.force[-1, 0, 0] == pytest.approx(-2.0 * 0.02 * 0.5, rel=1e-3)


def test_within_the_play_the_drive_transmits_nothing() -> None:
    play = effect("joint_play", play_rad=0.2)
    still = moved(rotor(more=SERVO), play, u=lambda t: [0.09], seconds=1.0)
    assert np.all(still.q == 0.0)
    run = moved(rotor(more=SERVO), play, u=lambda t: [0.5 if t < 2.0 else 0.35], seconds=4.0)
    assert run.q[1999, 0, 0] == pytest.approx(0.4, abs=1e-3)  # half the clearance behind the command
    assert run.q[-1, 0, 0] == pytest.approx(run.q[1999, 0, 0], abs=1e-3)  # back within the clearance


def test_play_needs_a_drive_that_knows_its_position() -> None:
    motor = '<actuator><motor joint="hinge"/></actuator>'
    with pytest.raises(UserError, match="needs a position drive"):
        moved(rotor(more=motor), effect("joint_play", play_rad=0.2))


def test_friction_of_a_tendon_holds_the_sledge() -> None:
    mjcf = CORD.format(tendon="", more='<actuator><motor joint="slide"/></actuator>')
    friction = effect("tendon_friction", force_n=3.0)
    assert abs(moved(mjcf, friction, u=lambda t: [2.0]).q[-1, 0, 0]) < 0.01
    run = moved(mjcf, friction, u=lambda t: [-7.0], seconds=6.0)
    assert run.v[-1, 0, 0] == pytest.approx(-4.0 / 2.0, rel=0.02)


def test_stiffness_of_a_tendon_holds_about_its_length_at_rest() -> None:
    mjcf = CORD.format(tendon="", more='<actuator><motor joint="slide"/></actuator>')
    run = moved(mjcf, effect("tendon_stiffness", stiffness_n_per_m=50.0), u=lambda t: [5.0], seconds=8.0)
    assert run.q[-1, 0, 0] == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize("gear", [1.0, -2.0])
def test_slack_is_taken_up_before_the_tendon_pulls(gear: float) -> None:
    more = f'<actuator><position tendon="cord" kp="40" gear="{gear}"/></actuator>'
    mjcf = CORD.format(tendon="", more=more).replace('damping="2"', 'damping="60"')
    slack = effect("tendon_slack", slack_m=0.05)
    assert np.all(np.abs(moved(mjcf, slack, u=lambda t: [gear * 0.96]).q) < 1e-12)
    run = moved(mjcf, slack, u=lambda t: [gear * 0.8], seconds=9.0)
    assert run.q[-1, 0, 0] == pytest.approx(0.15, abs=1e-3)
    pushed = moved(mjcf, slack, u=lambda t: [gear * 1.1], seconds=9.0)  # this model's drive also pushes
    assert pushed.q[-1, 0, 0] == pytest.approx(-0.1, abs=1e-3)


KINDS = [component.kind for component in effect_components()]


@pytest.mark.parametrize("kind", KINDS)
def test_a_neutral_effect_changes_nothing(kind: str) -> None:
    mjcf = CORD.format(
        tendon='stiffness="3" frictionloss="0.1"',
        more='<actuator><position tendon="cord" kp="40"/><position joint="slide" kp="3"/></actuator>',
    ).replace('damping="2"', 'damping="2" stiffness="1" frictionloss="0.2"')
    mjcf = mjcf.replace("<worldbody>", '<worldbody><geom type="plane" pos="0 0 -0.0999" size="1 1 1"/>')
    plain, same = (moved(mjcf, *e, u=lambda t: [0.9, 0.2], seconds=0.3) for e in ((), (effect(kind),)))
    assert np.abs(plain.q).max() > 1e-3 and np.abs(plain.q - same.q).max() < 1e-12


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("stiffness", {"stiffness_n_m_per_rad": 3.0}),
        ("viscous_damping", {"damping_n_m_s": 0.5}),
        ("viscous_damping", {"damping_n_m_s": 0.5, "rate_power": 1.5}),
        ("coulomb_friction", {"moment_n_m": 0.5}),
        ("stribeck_friction", {"moment_n_m": 0.5}),
        ("friction_hysteresis", {"yield_n_m": 0.5}),
        ("viscoelastic", {"stiffness_n_m_per_rad": 5.0}),
        ("body_mass", {"factor": 3.0}),
        ("centre_of_mass", {"x_m": 0.1}),
        ("body_inertia", {"factor": 30.0}),
        ("payload", {"mass_kg": 3.0}),
    ],
)
def test_a_pattern_acts_on_what_it_names_and_each_run_for_itself(kind: str, values: dict[str, float]) -> None:
    start = [[0.5, 0.5], [0.2, 0.3]]
    plain = moved(pendula('stiffness="1"'), q=start, seconds=0.5)
    run = moved(pendula('stiffness="1"'), effect(f"{kind}@le*", **values), q=start, seconds=0.5)
    alone = moved(pendula('stiffness="1"'), effect(f"{kind}@le*", **values), q=start[1:], seconds=0.5)
    if kind != "payload":  # at the joint's axis it changes nothing
        assert np.abs(run.q - plain.q)[-1, :, 0].max() > 1e-3
    assert np.abs(run.q - plain.q)[..., 1].max() < 1e-12
    assert np.array_equal(run.q[:, 1], alone.q[:, 0])
    place = "body" if kind in ("body_mass", "centre_of_mass", "body_inertia", "payload") else "joint"
    with pytest.raises(UserError, match=f"acts on no {place}: the model has left") as caught:
        moved(pendula('stiffness="1"'), effect(f"{kind}@lef", **values), q=start)
    assert str(caught.value).count(". ") == 0


EXPORTED = [
    ("stiffness", {"stiffness_n_m_per_rad": 3.0}, "jnt_stiffness"),
    ("rest_angle", {"shift_rad": 0.2}, "qpos_spring"),
    ("viscous_damping", {"damping_n_m_s": 0.5}, "dof_damping"),
    ("coulomb_friction", {"moment_n_m": 0.5}, "dof_frictionloss"),
    ("tendon_friction", {"force_n": 0.5}, "tendon_frictionloss"),
    ("tendon_stiffness", {"stiffness_n_per_m": 0.5}, "tendon_stiffness"),
]
WHOLE = """<mujoco><compiler angle="{angle}"/><worldbody><body name="a"><joint name="j" axis="0 1 0" {spring}
damping="0.2" springref="10"/><geom size="0.1" pos="0.2 0 0"/><body name="b" pos="0.5 0 0"><joint axis="0 1 0"/>
<geom size="0.1"/></body></body></worldbody><tendon><fixed name="t" stiffness="1"><joint joint="j" coef="2"/></fixed>
</tendon></mujoco>"""


@pytest.mark.parametrize("angle", ["degree", "radian"])
@pytest.mark.parametrize("spring", ['stiffness="2"', 'springdamper="0.1 1"'])
@pytest.mark.parametrize(("kind", "values", "number"), EXPORTED)
def test_an_improved_file_has_the_numbers(
    kind: str, values: dict[str, float], number: str, angle: str, spring: str
) -> None:
    mjcf = WHOLE.format(angle=angle, spring=spring)
    found, wanted, before = (
        f(mjcf, effect(kind, **values)) for f in (exported, compiled, lambda m, e: compiled(m))
    )
    assert np.allclose(getattr(found, number), getattr(wanted, number), rtol=1e-5)
    assert not np.allclose(getattr(found, number), getattr(before, number))
    for other in ("jnt_stiffness", "dof_damping", "qpos_spring"):
        if other != number:
            assert np.allclose(getattr(found, other), getattr(before, other), rtol=1e-4), other


def test_what_mjcf_cannot_say_is_no_part_of_a_file() -> None:
    (first, second) = changes(effect("stribeck_friction", moment_n_m=0.5))
    with pytest.raises(NotImplementedError):
        exported(rotor(), effect("stribeck_friction", moment_n_m=0.5))
    assert not hasattr(second, "edit") and hasattr(first, "edit")
