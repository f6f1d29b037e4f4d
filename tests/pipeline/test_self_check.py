"""The self-check of a study: its doubts, and studies that it accepts."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from pydantic import ValidationError

from pliant import api
from pliant.config.loading import load_study
from pliant.execution.progress import Silent
from pliant.pipeline.checks import NOT_SETTLED
from pliant.pipeline.self_check import checked_run, self_check
from pliant.pipeline.sensitivities import Budget, OwnResult, changed, default_numbers, sensitivities
from pliant.pipeline.study import simulate_study
from pliant.records.rollout import TaskResult
from pliant.registry.discovery import discover
from pliant.report.self_check import defaults_json, defaults_lines, defaults_section

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
# Defaults that other keys of their block exclude.
UNCHANGED = ("task.object.scale", "family.visual_scale", "task.force_max", "task.turn.period")

STUDY = """pliant: 1
name: s
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 1.6e-6, m_a: 0, m_e: 0, b_e: 0.02}}
chain: {modules: 4, module_length: 10 mm, module_mass: 2 g, module_radius: 6 mm, base: {direction: [1, 0, 0]}}
physics: quasistatic
cross_check: [mujoco]
task: {kind: tip_load, pressure: 5 kPa}
"""


def checked(folder, *changes):
    text = STUDY
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    opened = api.open_study(path, store=folder / "store")
    return self_check(opened.context, opened.study)


def status(found, subject):
    return [check.status for check in found.checks if check.subject == subject]


def test_a_sound_study_raises_no_doubt(tmp_path):
    found = checked(tmp_path)
    assert found.doubts == ()
    assert status(found, "engines") == ["fine"] and status(found, "rest pose") == ["fine"]


@pytest.mark.parametrize(
    ("change", "subject", "word"),
    [
        (("5 kPa", "5 Pa"), "magnitude", "task.pressure is 0.005 kPa"),
        (("module_mass: 2 g", "module_mass: 60 g"), "rest pose", "turn the tip by"),
        (("base: {direction: [1, 0, 0]}", "gravity: [0, 0, 0]"), "gravity", "no gravity"),
    ],
)
def test_what_is_odd_is_doubted(tmp_path, change, subject, word):
    found = checked(tmp_path, change)
    assert any(check.subject == subject and word in check.sentence for check in found.doubts)


def test_the_sag_at_rest_equals_the_linear_chain(tmp_path):
    """For small masses joint i carries Σ m g x of the masses beyond it, and turns by that over b_e."""
    found = checked(tmp_path, ("module_mass: 2 g", "module_mass: 0.5 g"))
    (said,) = [check.sentence for check in found.checks if check.subject == "rest pose"]
    masses, places = [0.5e-3] * 4, [0.01 * (k + 0.5) for k in range(4)]
    joints = [0.01 * (k + 0.5) for k in range(4)]
    moments = [sum(m * 9.81 * max(x - j, 0.0) for m, x in zip(masses, places, strict=True)) for j in joints]
    turn = math.degrees(sum(moments) / 0.02)
    assert float(said.split("by ")[1].split("°")[0]) == pytest.approx(turn, abs=0.3)


def test_the_engine_s_damping_is_a_default_that_matters(tmp_path):
    release = "{kind: follow_pressure, pressure: 5 kPa, waveform: release, duration: 1 s, record: 5 ms}"
    found = checked(
        tmp_path,
        ("physics: quasistatic\ncross_check: [mujoco]", "physics: mujoco"),
        ("{kind: tip_load, pressure: 5 kPa}", release),
    )
    assert {"physics.drag_1", "physics.joint_damping"} & {one.key for one in found.defaults}


def ran(folder, *changes):
    """Return the run of the changed study, with its checks, and the study and bench."""
    text = STUDY
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    opened = api.open_study(path, store=folder / "store")
    return opened, checked_run(opened.context, simulate_study(opened.context, opened.study))


def test_a_run_says_which_defaults_move_its_answer(tmp_path):
    """Gravity is not stated; without it the horizontal chain would not sag."""
    opened, done = ran(tmp_path, ("module_mass: 2 g", "module_mass: 12 g"))
    by_doctor = self_check(opened.context, opened.study)
    assert done.checked is not None
    assert done.checked.defaults == by_doctor.defaults
    (gravity,) = done.checked.defaults
    assert gravity.key == "chain.gravity" and gravity.unit == "m/s^2" and gravity.value == 9.81
    told = defaults_json(done.checked)
    assert told["defaults_that_matter"][0]["key"] == "chain.gravity"
    section = defaults_section(told)
    assert section is not None and section.tables[0].rows[0][0] == "chain.gravity"
    assert "chain.gravity 9.81 m/s²" in defaults_lines(done.checked)[0]


def test_the_stated_law_sensitivity_equals_its_equilibrium(tmp_path):
    """One joint without pressure: b_e u = m g l cos u, so that a tenth more gravity turns it by a known angle."""
    one = "modules: 1, module_length: 10 mm, module_mass: 20 g"
    _, done = ran(tmp_path, ("modules: 4, module_length: 10 mm, module_mass: 2 g", one), ("5 kPa", "5 Pa"))

    def angle(gravity):
        low, high = 0.0, 1.0
        for _ in range(60):
            u = (low + high) / 2
            moment = gravity * 20e-3 * 0.5 * 2.5e-3 * math.cos(u)
            low, high = (u, high) if 0.02 * u < moment else (low, u)
        return low

    assert done.checked is not None
    (found,) = [one for one in done.checked.defaults if one.key == "chain.gravity"]
    assert found.metric == "bend_angle_rad"
    assert found.change == pytest.approx(angle(1.1 * 9.81) / angle(9.81) - 1.0, rel=0.2)


def test_what_the_time_does_not_allow_is_named(tmp_path):
    opened, done = ran(tmp_path)
    answer = OwnResult(done.engines[0].result.metrics, 0.04, {})

    def never(study):
        raise AssertionError("simulated beyond the budget")

    found, left = sensitivities(opened.study, answer, never, Budget(0.0, 1.0, 0.0, "too long"), Silent())
    assert found == [] and {one.key for one in left} == {name for *_, name in default_numbers(opened.study)}
    assert all(one.too_long for one in left)
    checked = replace(done.checked, checks=(NOT_SETTLED,), not_checked=tuple(left))
    assert "rest pose" in defaults_lines(checked)[-1] and "pliant doctor" in defaults_lines(checked)[-1]


def test_a_change_within_the_error_bar_does_not_matter(tmp_path):
    opened, done = ran(tmp_path)
    result = done.engines[0].result
    budget = Budget(60.0, 0.0, 0.0, "")

    def a_little_more(study) -> TaskResult:
        return replace(
            result, metrics={**result.metrics, "bend_angle_rad": 1.05 * result.metrics["bend_angle_rad"]}
        )

    for half, matters in ((0.02, True), (0.2, False)):
        spread = {"bend_angle_rad": half * result.metrics["bend_angle_rad"]}
        found, _ = sensitivities(
            opened.study, OwnResult(result.metrics, 0.04, spread), a_little_more, budget, Silent()
        )
        assert bool(found) is matters


def test_a_run_shows_the_doubts_that_cost_little(tmp_path):
    _, done = ran(tmp_path, ("module_mass: 2 g", "module_mass: 60 g"))
    assert any("turn the tip by" in remark for remark in done.remarks)
    _, weightless = ran(tmp_path, ("base: {direction: [1, 0, 0]}", "gravity: [0, 0, 0]"))
    assert any("no gravity" in remark for remark in weightless.remarks)


@pytest.mark.parametrize("path", sorted(EXAMPLES.rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_default_in_the_examples_can_be_changed(path):
    study = load_study(path, discover(), (), lambda text: None)
    for place, value, name in default_numbers(study):
        for factor in (1.1, 1.0 / 1.1):
            other = tuple(factor * one for one in value) if isinstance(value, tuple) else factor * value
            try:
                there = changed(study, place, other)
            except ValidationError:
                continue
            block = there
            for key in place:
                block = block[key] if isinstance(key, int) else getattr(block, key)
            assert block == pytest.approx(other)
            break
        else:
            assert name in UNCHANGED, f"{name}: neither a tenth more nor a tenth less is allowed"
