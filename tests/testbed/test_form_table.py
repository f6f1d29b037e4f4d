"""No threshold was set on the forms that it is judged on: derived from the table of forms, kind by kind."""

from __future__ import annotations

from collections import Counter
from itertools import product

import numpy as np
import pytest
from benchmarks.evidence.bench_errors import MISTAKES
from benchmarks.evidence.form_table import FORMS, LAW_SHAPES, MISTAKE_FORMS, PLACES, Form, kind_forms
from benchmarks.evidence.robots import ROBOTS
from benchmarks.evidence.sets import SetSpec, make_set, signal
from benchmarks.evidence.tasks import ENGINES, Plan
from benchmarks.evidence.truths import CHANGES, CLEAN, KINDS, UNKNOWN, draw_part, kind_robots

from pliant.diagnosis.candidates import candidate_kinds
from pliant.diagnosis.diagnosis import is_record_mistake
from pliant.registry.discovery import discover


def apart(one: Form, other: Form) -> bool:
    """Return whether the equations differ, or are the same with numbers from ranges without a common point."""
    if dict(one.switch) != dict(other.switch):
        return True
    numbers = set(one.ranges) & set(other.ranges) - set(PLACES)
    if not numbers:
        return False
    for name in numbers:
        if name in one.either_sign or name in other.either_sign:
            sizes = [sorted(abs(x) for x in form.ranges[name]) for form in (one, other)]
            assert min(*one.ranges[name], *other.ranges[name]) > 0  # a random sign mirrors the range
        else:
            sizes = [form.ranges[name] for form in (one, other)]
        (a, b), (c, d) = sizes
        if not (b < c or d < a):
            return False
    return True


def test_the_forms_in_a_kind_are_disjoint_between_the_splits() -> None:
    shared = [
        (kind, one.name, other.name)
        for kind, (calibration, judged) in {**FORMS, **MISTAKE_FORMS, "law": LAW_SHAPES}.items()
        for one, other in product(calibration, judged)
        if not apart(one, other)
    ]
    assert not shared
    same = Form("a", {}, {"x": (0.0, 1.0)})
    for ranges in ((0.5, 2.0), (0.2, 0.4), (-1.0, 2.0), (1.0, 2.0)):  # overlapping, inside, around, touching
        assert not apart(same, Form("b", {}, {"x": ranges}))
    assert apart(same, Form("b", {}, {"x": (1.1, 2.0)})) and apart(
        same, Form("b", {"y": 1.0}, {"x": (0.0, 1.0)})
    )


# Effects of chains with several inputs that differ; the bed has no such robot yet, so that nothing is judged on them.
WITHOUT_ROBOTS = {"tendon_slack", "unequal_actuators"}


def test_every_shipped_effect_and_every_unknown_one_has_its_forms() -> None:
    registry = discover()
    # mistakes of the record are not physics: they have a separate table
    shipped = {kind for kind in candidate_kinds(registry) if not is_record_mistake(registry, kind)}
    assert set(KINDS) == shipped - WITHOUT_ROBOTS
    assert set(MISTAKES) == set(MISTAKE_FORMS) and not set(MISTAKES) & {*KINDS, *UNKNOWN}
    assert set(FORMS) == {*KINDS, *UNKNOWN} == set(CHANGES) - {CLEAN}
    assert len(UNKNOWN) >= 12 and not set(UNKNOWN) & set(KINDS)
    for kind, splits in FORMS.items():
        for forms in splits:
            assert forms and len({form.name for form in forms}) == len(forms), kind
            assert any(not form.engines and not form.robots for form in forms), kind


@pytest.mark.parametrize("split", ["calibration", "judged"])
def test_every_form_is_drawn_and_another_switch_is_another_truth(split: str) -> None:
    rng = np.random.default_rng(0)
    for kind in FORMS:
        robot = ROBOTS[kind_robots(kind)[0]]
        engines = ("functional", "mujoco")
        parts = [draw_part(kind, engine, robot, split, rng) for engine in engines for _ in range(40)]
        assert {part.form for part in parts} == {form.name for form in kind_forms(kind, split)}, kind
        for part in parts:
            change = part.change(1.0)
            assert all(np.isfinite(value) for value in change.values())
        with pytest.raises(ValueError, match="no truth"):
            draw_part("nonsense", "mujoco", robot, split, rng)


def test_clean_sets_and_unknown_effects_cover_every_robot_and_engine_in_either_split() -> None:
    for split in ("calibration", "judged"):
        tasks = Plan(split=split, clean=48, unknown=8).tasks()
        for kind in (CLEAN, *UNKNOWN):
            specs = [t.spec for t in tasks if t.spec.kind == kind and t.group in ("clean", "unknown")]
            count = Counter(spec.robot for spec in specs)
            assert set(count) == set(ROBOTS) and max(count.values()) - min(count.values()) <= 1, kind
            if kind == CLEAN:
                for robot in ROBOTS:
                    engines = {spec.engine for spec in specs if spec.robot == robot}
                    assert engines == set(ENGINES[split, robot == "joint"]), robot


@pytest.mark.parametrize("kind", ["permanent_set", "viscous_damping"])
def test_forms_in_either_split_change_the_readings_unlike_each_other(kind: str) -> None:
    """At the same size, the change of one form differs from the other's by more than the errors of law and solver."""
    changes = {}
    for split in ("calibration", "judged"):
        made = make_set(SetSpec(kind, 1, protocol="example", split=split, snr=2.0))
        changes[split] = np.concatenate(
            [
                (h["angle_rad"] - c["angle_rad"]) / made.sigma["angle_rad"]
                for h, c in zip(made.hidden, made.clean, strict=True)
            ]
        )
        assert signal(made.clean, made.hidden, made.sigma) == pytest.approx(2.0, rel=0.05)
    one, other = changes.values()
    left = one - other * (one @ other) / (other @ other)
    assert np.sqrt(np.mean(left**2)) > 0.1
