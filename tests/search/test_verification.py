"""The check of a found design: laws by direct FEM of it, the task in every engine, notes where this is impossible."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pliant_designs import meta_bench
from tests.search.found_stand_ins import found

from pliant import api
from pliant.errors import UserError
from pliant_search.config import VerifyConfig
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.problem.study_setter import changed
from pliant_search.verify import verification
from pliant_search.verify.direct_fem import check_verifiable, default_fem, direct_studies, solvable
from pliant_search.verify.verification import law_errors, verify

SPRINGS = (
    "fem: {kind: springs_fem, pressure_max: 15 kPa, sampling: grid, pressures: 3, angles: 5, check_states: 2}"
)
RADIUS = {"family.radius": 4.7e-3}
SEARCH = "search: {variables: {family.radius: {low: 4 mm, high: 5.5 mm}}, objective: tip_x, verify: VERIFY}\n"


class StudyProblem:
    """A problem that applies values of dotted keys, and conditions, to a study."""

    def __init__(self, opened, conditions=None):
        self.study, self.registry = opened.study, opened.context.registry
        self.config = opened.study.search
        self.changes = conditions or {"": {}}
        self.conditions = tuple(SimpleNamespace(name=name) for name in self.changes)

    def metric_violations(self, values, metrics):
        return {}

    def names_metric(self, name):
        return False

    def apply(self, values, condition):
        change = list(self.changes.values())[condition]
        return changed(self.registry, self.study, {**change, **values})


def springs(folder, *changes, verify_block="{}", fem=SPRINGS):
    """Return springs with the stand-in meta-model, a search block, and FEM without cost."""
    old = "physics: quasistatic"
    more = SEARCH.replace("VERIFY", verify_block) + (f"{fem}\n" if fem else "")
    return meta_bench.opened(folder, (old, f"{more}{old}"), *changes)


def checked(folder, *changes, values=RADIUS, **how):
    """Return the check of a design of these springs."""
    opened = springs(folder, *changes, **how)
    return verify(opened.context, StudyProblem(opened), found(values))


def test_the_verified_metrics_equal_the_design_s_own_fem(tmp_path):
    check = checked(tmp_path)
    truth = meta_bench.free_angle(4.7e-3, 8.6e-3, 10e3)
    verified, predicted = check.verified["quasistatic"], check.predicted["quasistatic"]
    assert verified["max_joint_angle_rad"] == pytest.approx(truth, rel=1e-6)
    assert predicted["max_joint_angle_rad"] == pytest.approx(truth, rel=1e-2)
    assert predicted["max_joint_angle_rad"] != verified["max_joint_angle_rad"]
    assert check.conditions["quasistatic"][""] == verified
    assert check.fem_wall_s > 0
    assert check.notes == ()
    (law,) = check.laws
    assert law["name"] == "radius 4.7 mm"
    assert law["n_states"] == 3 + 3 * 5 + 2
    assert 0 < law["rmse_of_largest"] < law["worst_of_largest"] < 0.02
    assert law["fit_worst_of_range"] < law["worst_of_range"]


def test_the_second_check_solves_nothing(tmp_path, monkeypatch):
    from tests.pliant_designs.sweep_bench import solved

    monkeypatch.setenv("SPRINGS_LOG", str(tmp_path / "log"))
    opened = springs(tmp_path)
    first = verify(opened.context, StudyProblem(opened), found(RADIUS))
    once = sum(solved(tmp_path / "log").values())
    again = verify(opened.context, StudyProblem(opened), found(RADIUS))
    assert once > 0
    assert sum(solved(tmp_path / "log").values()) == once
    assert again.verified == first.verified
    assert again.fem_wall_s == first.fem_wall_s


@pytest.mark.slow
def test_metrics_are_means_over_the_conditions(tmp_path):
    conditions = "conditions: {soft: {task.pressure: 5 kPa}, hard: {task.pressure: 10 kPa}}"
    opened = springs(tmp_path, ("objective: tip_x,", f"objective: tip_x, {conditions},"))
    problem = SearchProblem.from_study(opened.study, opened.context.registry)
    check = verify(opened.context, problem, found({"family.radius": 5.1e-3}))
    each = check.conditions["quasistatic"]
    truth = {name: meta_bench.free_angle(5.1e-3, 8.6e-3, p) for name, p in (("soft", 5e3), ("hard", 10e3))}
    assert {name: each[name]["max_joint_angle_rad"] for name in each} == pytest.approx(truth, rel=1e-6)
    mean = np.mean(list(truth.values()))
    assert check.verified["quasistatic"]["max_joint_angle_rad"] == pytest.approx(mean, rel=1e-6)
    assert [law["name"] for law in check.laws] == ["radius 5.1 mm"]
    own = verify(opened.context, problem, found({"family.radius": 5.1e-3}, context=1))
    assert list(own.conditions["quasistatic"]) == ["hard"]


def test_a_change_is_on_top_from_the_design(tmp_path):
    check = checked(tmp_path, verify_block="{change: {task.pressure: 5 kPa}}")
    truth = meta_bench.free_angle(4.7e-3, 8.6e-3, 5e3)
    assert check.verified["quasistatic"]["max_joint_angle_rad"] == pytest.approx(truth, rel=1e-6)
    assert check.predicted["quasistatic"]["max_joint_angle_rad"] == pytest.approx(truth, rel=1e-2)


def test_every_distinct_design_is_solved_and_named_by_what_differs(tmp_path):
    segments = "[{modules: 1}, {modules: 1, family: {radius: 5.2 mm}}, {modules: 1}]"
    chain = f"chain: {{segments: {segments}, gravity: [0, 0, 0]}}"
    change = ("chain: {modules: 2, gravity: [0, 0, 0]}", chain)
    check = checked(tmp_path, change, values={"family.length": 8.7e-3})
    assert [law["name"] for law in check.laws] == ["radius 4.7 mm", "radius 5.2 mm"]
    assert check.fem_wall_s == pytest.approx(sum(law["fem_wall_s"] for law in check.laws))


def test_an_engine_that_cannot_is_a_note_and_the_others_answer(tmp_path):
    opened = springs(tmp_path, ("physics: quasistatic", "physics: quasistatic\ncross_check: [mujoco]"))
    bench, problem = opened.context, StudyProblem(opened)
    components = tuple(c for c in bench.registry.components if c.kind != "mujoco")
    broken = [
        dataclasses.replace(c, requires=("no_such_package",))
        for c in bench.registry.components
        if c.kind == "mujoco"
    ]
    registry = dataclasses.replace(bench.registry, components=(*components, *broken))
    check = verify(dataclasses.replace(bench, registry=registry), problem, found(RADIUS))
    assert list(check.verified) == ["quasistatic"]
    assert any(note.startswith("mujoco") and "no_such_package" in note for note in check.notes)


def test_an_engine_that_breaks_inside_compiled_code_is_a_note_and_ctrl_c_there_is_not(tmp_path, monkeypatch):
    def breaks(bench, study, engine):
        raise SystemError("returned NULL") from cause

    monkeypatch.setattr(verification, "run_in", breaks)
    opened, cause = springs(tmp_path, verify_block="{fem: false}"), None
    check = verify(opened.context, StudyProblem(opened), found(RADIUS))
    assert check.notes[0] == "quasistatic, with the laws of the search: SystemError: returned NULL"
    cause = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        verify(opened.context, StudyProblem(opened), found(RADIUS))


def test_the_search_block_may_leave_fem_out(tmp_path):
    check = checked(tmp_path, verify_block="{fem: false}")
    assert (check.verified, check.laws) == ({}, ())
    assert list(check.predicted) == ["quasistatic"]
    assert "verify.fem is false" in check.notes[0]


def test_a_study_without_fem_gets_one_that_covers_table_and_task(tmp_path):
    opened = springs(tmp_path, fem="")
    task = ("task.pressure", 20e3)
    studies = [opened.study, changed(opened.context.registry, opened.study, dict([task]))]
    assert default_fem(opened.context, studies[:1]).pressure_max_pa == 15e3
    fem = default_fem(opened.context, studies)
    assert fem.pressure_max_pa == pytest.approx(21e3)
    assert fem.self_contact == "end"
    direct, said = direct_studies(opened.context, studies)
    assert [study.meta_model for study in direct] == [None, None]
    assert [study.fem.pressure_max_pa for study in direct] == [fem.pressure_max_pa] * 2
    assert "no 'fem' block" in said[0]


def test_a_missing_material_shows_before_the_search(tmp_path):
    material = ("material: {kind: neo_hookean, shear_modulus: 240 kPa}\n", "")
    with pytest.raises(UserError, match="no 'material' block"):
        check_verifiable(springs(tmp_path, material).study)
    check_verifiable(springs(tmp_path, material, verify_block="null").study)
    check_verifiable(springs(tmp_path, material, verify_block="{fem: false}").study)
    assert solvable(springs(tmp_path).study)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"task.trails": 3}, "search.verify.change: 'task.trails' is no key of this study"),
        ({"task.pressure": "fast"}, "task.pressure.* is not a quantity"),
        ({"chain.segments.3.modules": 2}, "'chain.segments' has no item"),
        ({"name": "other"}, "'name' cannot be set"),
    ],
)
def test_a_wrong_change(tmp_path, change, sentence):
    opened = springs(tmp_path)
    with pytest.raises(UserError, match=sentence):
        changed(opened.context.registry, opened.study, change)
    search = opened.study.search.model_copy(update={"verify": VerifyConfig(change=change)})
    with pytest.raises(UserError, match=sentence):
        check_verifiable(opened.study.model_copy(update={"search": search}), opened.context.registry)


def test_misses_by_a_law_that_is_off_by_a_known_share(tmp_path):
    opened = springs(tmp_path)
    direct, _ = direct_studies(opened.context, [opened.study])
    from pliant.pipeline.study import build_study_laws

    (stages,) = build_study_laws(opened.context, direct[0])
    data = stages.fem.value

    class OffLaw:
        axes, domain = stages.law.law.axes, stages.law.law.domain

        def evaluate(self, p, u):
            true = data.tau[:, :1]
            return SimpleNamespace(tau=true + 0.01 * np.abs(data.tau).max())

        def band(self, p, u, level):
            return None

    found_misses = law_errors(OffLaw(), data, "off")
    assert found_misses["rmse_of_largest"] == pytest.approx(0.01)
    assert found_misses["worst_of_largest"] == pytest.approx(0.01)
    assert found_misses["largest_effort"] == pytest.approx(np.abs(data.tau).max())
    assert found_misses["rmse_of_range"] == pytest.approx(0.01 * np.abs(data.tau).max() / np.ptp(data.tau))
    assert math.isnan(found_misses["in_band"])


FINGER = """\
pliant: 1
name: finger
family: {kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}
material: {kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3}
fem: {kind: skfem, pressure_max: 12 kPa, sampling: grid, pressures: 3, angles: 3, check_states: 1}
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 4}
physics: quasistatic
cross_check: [mujoco]
task: {kind: free_bending, pressure: 10 kPa}
search: {variables: {chain.modules: {low: 3, high: 5}}, objective: tip_z}
"""


@pytest.mark.slow
def test_the_published_bellow_law_against_its_own_fem(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "finger.yaml").write_text(FINGER)
    opened = api.open_study(tmp_path / "finger.yaml", store=tmp_path / "store")
    check = verify(opened.context, StudyProblem(opened), found({"chain.modules": 5}))
    assert "states a law" in check.notes[0]
    assert list(check.verified) == ["quasistatic", "mujoco"]
    one, other = (check.verified[engine]["tip_x_m"] for engine in check.verified)
    assert one == pytest.approx(other, abs=1e-6)
    assert check.predicted["quasistatic"]["tip_x_m"] == pytest.approx(one, rel=0.15)
    assert check.predicted["quasistatic"]["tip_x_m"] != pytest.approx(one, rel=1e-4)
    (law,) = check.laws
    assert law["fit_worst_of_range"] < 0.02
    assert law["rmse_of_largest"] > law["fit_worst_of_range"]
    assert math.isnan(law["in_band"])
