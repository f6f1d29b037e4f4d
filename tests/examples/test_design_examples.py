"""The studies of examples/shape_matching and examples/gripper_codesign search what the docs state."""

from __future__ import annotations

import importlib.util
import itertools
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from pliant import api
from pliant.errors import UserError
from pliant.pipeline.chain import base_rotation
from pliant.pipeline.segments import chain_length_m
from pliant.testing.samples import sample_chain
from pliant_search.problem.feasibility import require_reachable
from pliant_search.problem.search_problem import SearchProblem

EXAMPLES = Path(__file__).parents[2] / "examples"
GRASPS = 14_400
TASKS = ("egg-5", "egg-6", "egg-7", "cylinder-2", "cylinder-3", "cylinder-4")


def open_problem(name: str) -> tuple[api.OpenStudy, SearchProblem]:
    opened = api.open_study(EXAMPLES / name)
    return opened, SearchProblem.from_study(opened.study, opened.context.registry)


def structures() -> set[tuple[int, ...]]:
    """Return the structures of 25 to 29 modules in four segments that differ by at most two."""
    splits = itertools.product(range(1, 20), repeat=4)
    return {s for s in splits if 25 <= sum(s) <= 29 and max(s) - min(s) <= 2}


@pytest.mark.parametrize("name", ["helix", "free_roll", "halving", "per_segment_pressure"])
def test_the_structures_are_the_81_in_the_study(name: str) -> None:
    _, problem = open_problem(f"shape_matching/{name}.yaml")
    found = [tuple(branch[f"n{k}"] for k in (1, 2, 3, 4)) for branch in problem.branches()]
    assert len(found) == len(structures()) == 81
    assert set(found) == structures()


def test_integers_are_searched_in_one_search_with_as_many_candidates() -> None:
    _, separate = open_problem("shape_matching/free_roll.yaml")
    _, joint = open_problem("shape_matching/integers.yaml")
    assert joint.branches() == ({},)
    assert joint.config.budget == 81 * separate.config.budget
    _, small = open_problem("shape_matching/small.yaml")
    assert (len(small.branches()), len(small.branches()) * small.config.budget) == (3, 30)
    assert len(joint.space().variables) == len(separate.space().variables) + 4
    values: dict[str, Any] = dict.fromkeys([v.name for v in joint.variables], 0.0)
    inside, outside = ((7, 7, 7, 6), (8, 8, 5, 5))
    assert not joint.violated({**values, **dict(zip(("n1", "n2", "n3", "n4"), inside, strict=True))})
    assert joint.violated({**values, **dict(zip(("n1", "n2", "n3", "n4"), outside, strict=True))})


def test_the_polished_search_has_half_the_candidates_and_goes_on_with_fem() -> None:
    _, joint = open_problem("shape_matching/integers.yaml")
    _, polished = open_problem("shape_matching/polished.yaml")
    assert 2 * polished.config.budget == joint.config.budget
    assert polished.config.polish is not None
    assert polished.config.verify.rounds == 2
    assert polished.config.verify.change == joint.config.verify.change
    assert [v.name for v in polished.variables] == [v.name for v in joint.variables]


def test_the_other_reading_stays_within_its_laws_data() -> None:
    _, joint = open_problem("shape_matching/integers.yaml")
    _, other = open_problem("shape_matching/axis_along_base.yaml")
    assert [v.name for v in other.variables] == [v.name for v in joint.variables]
    values: dict[str, Any] = {v.name: 0.0 for v in other.variables} | {"n1": 7, "n2": 7, "n3": 7, "n4": 6}
    assert not other.metric_violations(values, {"outside_domain": 0.0})
    assert other.metric_violations(values, {"outside_domain": 1.0})


def test_a_candidate_sets_every_segment() -> None:
    opened, problem = open_problem("shape_matching/per_segment_pressure.yaml")
    values: dict[str, Any] = {v.name: v.variable.high for v in problem.variables}
    values |= {"n1": 8, "n2": 8, "n3": 7, "n4": 6, "share2": 0.5}
    study = problem.apply(values, 0)
    segments = study.chain.as_segments()
    assert [s.modules for s in segments] == [8, 8, 7, 6]
    assert [s.actuation_share for s in segments] == [1.0, 0.5, 1.0, 1.0]
    assert [round(s.rotation_rad, 4) for s in segments] == [0.0, 1.5708, 3.1416, 4.7124]
    assert study.chain.base.roll_rad == pytest.approx(np.pi)
    assert chain_length_m(opened.context, study) == pytest.approx(29 * 6e-3)
    opened.context.build("task", study.task).check_reach(29 * 6e-3)


def test_the_target_winds_about_the_vertical_and_bends_first_where_unturned_modules_do() -> None:
    opened, problem = open_problem("shape_matching/helix.yaml")
    study = problem.apply({v.name: v.stated for v in problem.variables}, 0)
    assert study.chain is not None and study.task is not None
    base = base_rotation(study.chain.base)
    engine = opened.context.build("physics", study.physics)
    with engine.build(sample_chain(modules=2).with_(base_rotation=base)) as simulation:
        result = opened.context.build("task", study.task).run(simulation)
    target = np.asarray(result.metrics["target_points_m"], float)
    axis = target[:-1, :2].mean(axis=0)
    assert np.linalg.norm(target[:, :2] - axis, axis=1) == pytest.approx(18e-3, rel=2e-2)
    assert target[0, 2] - target[-1, 2] == pytest.approx(60e-3, rel=1e-3)
    # Seen from above: unturned modules bend from the base toward the centre of the circle.
    toward = np.array([*(axis - target[0, :2]), 0.0]) / 18e-3
    bends = base @ np.array([0.0, 0.0, -1.0])
    assert bends @ toward == pytest.approx(1.0, abs=2e-2)


@pytest.mark.parametrize("name", ["gripper", "cmaes", "optuna"])
def test_optimizers_get_as_many_grasps(name: str) -> None:
    opened, problem = open_problem(f"gripper_codesign/{name}.yaml")
    assert [condition.name for condition in problem.conditions] == list(TASKS)
    assert opened.study.block("optimizer") is not None
    contextual = opened.study.block("optimizer").kind == "ppo"
    assert problem.config.budget * (1 if contextual else len(TASKS)) == GRASPS
    assert problem.maximised == (True,)


def test_a_design_and_its_use_reach_the_study() -> None:
    _, problem = open_problem("gripper_codesign/gripper.yaml")
    values: dict[str, Any] = {v.name: v.variable.low for v in problem.variables}
    egg, cylinder = problem.apply(values, 2), problem.apply(values, 5)
    assert (egg.task.object.shape, egg.task.extra_weights, egg.task.base_inset_m) == ("egg", 7, 0.0)
    assert (cylinder.task.object.shape, cylinder.task.extra_weights) == ("cylinder", 4)
    assert cylinder.task.base_inset_m == pytest.approx(-4e-3)
    assert (egg.task.fingers, egg.chain.segments[1].modules) == (2, 5)
    assert egg.chain.segments[2].rigid.along_m(egg.family.module_length_m) == pytest.approx(8e-3 + 3e-3)
    assert len({condition.changes["task", "seed"] for condition in problem.conditions}) == len(TASKS)


def test_bellows_without_room_for_their_arcs_are_turned_away() -> None:
    _, problem = open_problem("gripper_codesign/gripper.yaml")
    values: dict[str, Any] = {v.name: v.variable.low for v in problem.variables}
    assert not problem.violated(values)
    assert problem.violated({**values, "r": 4e-3, "R": 6e-3, "l": 12e-3})


def longer(tmp_path: Path, target: str) -> tuple[api.OpenStudy, SearchProblem]:
    """Return the shape-matching study with another target."""
    path = tmp_path / "longer.yaml"
    extends = EXAMPLES / "shape_matching/helix.yaml"
    path.write_text(f"pliant: 1\nextends: {extends}\nname: longer\ntask: {{target: {target}}}\n")
    opened = api.open_study(path)
    return opened, SearchProblem.from_study(opened.study, opened.context.registry)


def test_a_target_longer_than_any_chain_is_refused_before_the_search(tmp_path: Path) -> None:
    # 8 · 4 · 6 mm = 192 mm straight; three turns of 30 mm radius are 568.7 mm long
    opened, problem = longer(tmp_path, "{radius: 30 mm, turns: 3}")
    with pytest.raises(UserError, match=r"568.* mm long, and the longest chain .* 192 mm"):
        require_reachable(problem, opened.context)
    opened, problem = longer(tmp_path, "{radius: 25 mm}")
    require_reachable(problem, opened.context)


def make(study: str = "gripper_codesign") -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"make_{study}", EXAMPLES / study / "make.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_grippers_designs_equal_the_script_and_can_be_built() -> None:
    script = make()
    assert script.DESIGNS.read_text(encoding="utf-8") == script.designs_text()
    rows = script.designs()
    assert len(rows) == len(set(rows)) == 90
    for k in range(4):
        values = [row[k] for row in rows]
        assert (min(values), max(values)) == (script.LOW[k], script.HIGH[k])
    opened = api.open_study(EXAMPLES / "gripper_codesign/fem/gripper_grid.yaml")
    family = opened.study.family
    assert family is not None
    for row in rows:
        sizes = {f"{name}_m": 1e-3 * value for name, value in zip(script.NAMES, row, strict=True)}
        opened.context.build("family", family.model_copy(update=sizes))


def test_the_shapes_table_is_the_published_grid_and_a_row_between() -> None:
    script = make("shape_matching")
    grid, table = script.GRID.read_text(), script.TABLE.read_text()
    assert table.startswith(grid)
    head, *rows = table.splitlines()
    names = head.split(",")
    wide, long, design = (names.index(n) for n in ("average_radius_m", "module_length_m", "design"))
    added = {
        (c[design], c[wide], c[long]) for row in rows[len(grid.splitlines()) - 1 :] if (c := row.split(","))
    }
    lengths = ("0.004", "0.0045", "0.005", "0.0055", "0.006")
    assert added == {(str(25 + k), "0.00525", length) for k, length in enumerate(lengths)}
    joined = script.joined("a,design\n1,0\n2,1\n", "a,design\n5,0\n6,1\n")
    assert joined == "a,design\n1,0\n2,1\n5,2\n6,3\n"
    with pytest.raises(SystemExit, match="other columns"):
        script.joined("a,design\n1,0\n", "b,design\n5,0\n")
