"""The design studies: the small one end to end with its JSON and its page; parts, thresholds and scores."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.output import Bar, ratio
from benchmarks.studies import (
    gripper_bars,
    gripper_codesign,
    gripper_page,
    reach_around,
    reach_bars,
    reach_page,
    shape_matching,
    shape_page,
)
from benchmarks.studies.command import (
    Given,
    Parts,
    brief,
    kernel_s,
    published_parts,
    run_command,
    spread,
    study_digest,
)
from benchmarks.studies.gripper_bars import rise_m, seed_statistics, stable, worst_law
from benchmarks.studies.page import DOCS, MARK, number, publish, reached, rendered
from benchmarks.studies.shape_bars import apart, bars

from pliant import api
from pliant.errors import UserError
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import FoundDesign, SearchHistory, SearchResult

CONTRACT = ("best", "objective", "history", "evaluations", "wall_s", "verified", "machine", "published")
SMALL = shape_matching.SMALL[0].file


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Given, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("study")
    given = Given(
        "shape_matching", small=True, workers=1, quiet=True, out=folder / "out", store=folder / "store",
        overrides=("meta_model.folds=2", "search.budget=3"),
    )  # fmt: skip
    return given, shape_matching.study(given)


def read_page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def marks(text: str) -> dict[str, str]:
    return {m[2]: m[0].removeprefix(m[1]).removesuffix(m[3]) for m in MARK.finditer(text)}


@pytest.mark.slow
def test_the_small_study_writes_what_the_contract_names(small: tuple[Given, dict[str, Any]]) -> None:
    given, result = small
    written = json.loads((given.out / "shape_matching_small.json").read_text())
    assert written == json.loads(json.dumps(result))
    assert set(CONTRACT) <= set(written)
    assert written["reference_kernel_s"] > 0
    assert written["wall_in_kernels"] == pytest.approx(written["wall_s"] / written["reference_kernel_s"])
    assert written["evaluations"] == 9
    assert given.part_store(
        "helix"
    ).is_dir()  # its own store: with cached candidates of other searches the measured time would be too short
    assert written["published"]["verified"]["rmse_m"] == 5.05e-3
    best = [row["best"] for row in written["history"]]
    assert best == sorted(best, reverse=True)
    assert written["objective"] == pytest.approx(best[-1])
    assert not written["bars"]  # a small run is not judged


@pytest.mark.slow
def test_the_winner_and_the_structures_equal_the_search(small: tuple[Given, dict[str, Any]]) -> None:
    _, result = small
    found = result["structures"]
    assert [sum(one["values"].values()) for one in found] == [26, 26, 26]
    assert found[0]["best"] == pytest.approx(result["objective"], rel=1e-5)
    assert [one["best"] for one in found] == sorted(one["best"] for one in found)
    lines = result["runs"]["helix"]["lines"]
    apart_m = np.linalg.norm(np.array(lines["backbone_m"]) - np.array(lines["target_m"]), axis=1)
    assert apart_m[0] < 1e-6  # both start from the base design
    assert np.sqrt(np.mean(apart_m**2)) == pytest.approx(result["objective"], rel=0.02)
    assert lines["laws"] == "the search"


@pytest.mark.slow
def test_a_finished_part_is_not_made_again(small: tuple[Given, dict[str, Any]], monkeypatch: Any) -> None:
    given, result = small
    monkeypatch.setattr(shape_matching, "searched", lambda *_: pytest.fail("searched again"))
    assert shape_matching.study(given) == result
    with pytest.raises(BaseException, match="searched again"):  # results of another study are not reused
        shape_matching.study(Given(**{**vars(given), "overrides": ("meta_model.folds=2", "search.budget=4")}))


def judged(small: tuple[Given, dict[str, Any]], verified_m: float) -> dict[str, Any]:
    """Return the result as a full study would give it, with numbers of a check."""
    part = json.loads((small[0].folder / "helix.json").read_text())
    law = {"name": "R 6 mm", "n_states": 321, "rmse_of_range": 0.0123, "worst_of_range": 0.0456}
    here, other = {"rmse_m": verified_m, "e_max_m": 2.5e-3}, {"rmse_m": 1.4e-3, "e_max_m": 2.6e-3}
    predicted = {"quasistatic": {"rmse_m": 1.3e-3, "e_max_m": 2.4e-3}}
    check = {"engines": {"quasistatic": here, "mujoco": other}, "predicted": predicted, "notes": []}
    part = {**part, "verified": {**check, "laws": [{**law, "rmse_of_largest": 0.0078}]}}
    return shape_matching.assembled({"helix": part, "halving": part}, {"small": False, "overrides": []})


@pytest.mark.slow
def test_the_page_has_the_numbers_in_the_json(small: tuple[Given, dict[str, Any]], tmp_path: Path) -> None:
    result = judged(small, 1.234e-3)
    (tmp_path / "shape_matching.md").write_text(read_page("shape_matching"))
    written = publish("shape_matching", shape_page.TABLES, shape_page.PICTURES, result, tmp_path)
    assert all(path.is_file() for path in written)
    text = (tmp_path / "shape_matching.md").read_text()
    assert "not been run" not in text
    found = marks(text)
    run = result["runs"]["helix"]
    assert "1.30 mm / 2.40 mm | 1.23 mm / 2.50 mm | 1.40 mm / 2.60 mm (mujoco) | 0.07 mm" in found["runs"]
    assert f"| {run['evaluations']} | {run['wall_s']:.1f} s | {run['wall_in_kernels']:.0f}" in found["runs"]
    assert "5.05 mm / 8.19 mm" in found["runs"]
    assert "estimates of ours" in found["runs"]
    assert "| R 6 mm | 321 | 1.2 % | 4.6 % | 0.78 % |" in found["laws"]
    assert "| ≤ 1.5 mm | 1.23 mm | met |" in found["reached"]
    assert "helix_generations: search, wall time | ≤ 20 min | not run |" in found["reached"]
    pressure = f"{result['best']['values']['pressure'] / 1e3:.4g} kPa"
    assert pressure in found["best"]
    for picture in re.findall(r"\]\((\w+\.png)\)", text):
        assert (tmp_path / picture).stat().st_size < 200_000
    missed = judged(small, 1.6e-3)
    assert "| ≤ 1.5 mm | 1.6 mm | **missed** |" in marks(rendered(text, shape_page.TABLES, missed))["reached"]


@pytest.mark.parametrize(
    "name, tables",
    [("shape_matching", shape_page), ("gripper_codesign", gripper_page), ("reach_around", reach_page)],
)
def test_pages_without_a_result_hold_no_figures(name: str, tables: Any) -> None:
    found = marks(read_page(name))
    assert set(found) == set(tables.TABLES)
    if not (DOCS / f"{name}.json").is_file():
        assert "not been run" in found.pop("state")
        assert not any(found.values())


def test_parts_from_another_study_are_outdated(tmp_path: Path) -> None:
    parts, made = Parts(tmp_path), list[int]()

    def make() -> dict[str, Any]:
        made.append(1)
        return {"value": float("nan")}

    assert parts.get("a", "one", make) == parts.get("a", "one", make) == {"made_of": "one", "value": None}
    assert len(made) == 1
    assert parts.find("a", "two") is None
    parts.get("a", "two", make)
    Parts(tmp_path, fresh=True).get("a", "two", make)
    assert len(made) == 3
    (tmp_path / "a.json").write_text("{")
    assert parts.find("a", "two") is None


@pytest.mark.slow
def test_a_published_part_stands_in_for_one_that_is_missing(small: tuple[Given, dict[str, Any]]) -> None:
    given, result = small
    file = given.out / "shape_matching_small.json"
    docs = published_parts(file, "helix")
    of = docs["helix"]["made_of"]
    elsewhere = Parts(given.out / "nowhere", published=docs)
    assert elsewhere.known("helix", "another study") is None
    assert elsewhere.find("helix", of) is None  # the requested part is run
    part = elsewhere.known("helix", of)
    assert part is not None
    again = shape_matching.assembled({"helix": part}, {"small": True, "overrides": result["overrides"]})
    assert json.loads(json.dumps(again)) == json.loads(file.read_text())
    assert published_parts(given.out / "no_such.json", "helix") == {}


def test_published_seeds_and_the_baseline_are_found_by_name(tmp_path: Path) -> None:
    base = {"part": "baseline", "made_of": "b", "engines": {}, "design": {}}
    seed = {"part": "seed_ppo_1_60", "made_of": "s", **gripper_part(1.0, 4.0)}
    stated = {"small": False, "overrides": []}
    main = {"made_of": "m", **gripper_part(1.0, 4.5)}
    result = gripper_codesign.assembled({"ppo": main}, base, {"ppo": [seed], "cmaes": []}, stated)
    (tmp_path / "study.json").write_text(json.dumps(result))
    docs = Parts(tmp_path, published=published_parts(tmp_path / "study.json", "ppo"))
    assert docs.known("baseline", "b") == base
    assert docs.known("seed_ppo_1_60", "s") == seed
    again = docs.known("ppo", "m")
    assert again is not None
    assert {key: again[key] for key in main} == main


def test_a_published_table_over_seeds_is_kept_and_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []
    monkeypatch.setattr(
        gripper_codesign, "_seed", lambda asked, opened, workers, name: ran.append(name) or {"part": name}
    )

    def seeds(folder: str, docs: dict[str, Any], **given: Any) -> dict[str, list[dict[str, Any]]]:
        parts = Parts(tmp_path / folder, fresh=given.pop("fresh", False), published=docs)
        asked = Given("gripper_codesign", store=tmp_path / "store", quiet=True, **given)
        return gripper_codesign._seeds(parts, gripper_codesign.ASKED[:1], asked)

    made = seeds("out", {}, only=("seeds",), seeds=2, seed_grasps=60)["ppo"]
    assert ran == ["seed_ppo_1_60", "seed_ppo_2_60"]
    docs = {part["part"]: part for part in made}
    assert seeds("elsewhere", docs, only=("cmaes",))["ppo"] == made  # the published value stays
    assert len(ran) == 2
    more = seeds("elsewhere", docs, only=("seeds",), seeds=3, seed_grasps=60)["ppo"]
    assert more[:2] == made
    assert ran[2:] == ["seed_ppo_3_60"]
    seeds("elsewhere", docs, only=("seeds",), seeds=1, seed_grasps=60, fresh=True)
    assert ran[3:] == ["seed_ppo_1_60"]


def test_the_part_digest_follows_the_study(tmp_path: Path) -> None:
    def digest(*overrides: str) -> str:
        return study_digest(api.open_study(SMALL, overrides, store=tmp_path).study)

    assert digest() == digest()
    assert len({digest(), digest("search.seed=2"), digest("task.pressure=12 kPa")}) == 3
    table = tmp_path / "table.csv"
    table.write_text("1")
    first = digest(f"meta_model.data={table}")
    table.write_text("2")
    assert digest(f"meta_model.data={table}") != first


def test_bars() -> None:
    assert Bar("a", 1.0, 1.0, "mm").met
    assert not Bar("a", 1.1, 1.0, "mm").met
    assert Bar("a", 5.0, 5.0, "", at_most=False).met
    assert not Bar("a", 4.0, 5.0, "", at_most=False).met
    assert Bar("a", None, 5.0, "").met is None
    assert ratio([8.0, 10.0, 12.0], [1.0, 1.0, 4.0]) == 8.0
    shown = list(reached({"bars": [Bar("a", 2e-3, 1e-3, "mm", scale=1e3).json()]}))
    assert shown[-1] == "| a | ≤ 1 mm | 2 mm | **missed** | – |"
    verified = {"engines": {"q": {"rmse_m": 3.0}}, "predicted": {"q": {"rmse_m": 5.0}}}
    assert apart({"engine": "q", "verified": verified}) == 2
    assert all(bar.met is None for bar in bars({}))


def test_the_kernel_takes_time_and_rows_keep_both_ends() -> None:
    assert 1e-3 < kernel_s() < 60
    assert spread(1000, 3) == [0, 499, 999]
    assert spread(2, 300) == [0, 1]
    assert spread(0, 5) == []
    assert brief([np.float64(1.23456789), np.nan, [2]]) == [1.23457, None, [2]]


def policy_result() -> SearchResult:
    """Return the result of two tasks of three candidates each, one of them refused, to be maximised."""
    objectives = np.array([[-1.0], [-5.0], [-3.0], [np.nan], [-2.0], [-6.0]])
    history = SearchHistory(
        np.zeros(6, int), np.array([0, 1, 0, 1, 0, 1]), {"a": np.arange(6.0), "b": np.arange(6.0)},
        np.array([0, 0, 0, 1, 0, 0]), objectives, {}, np.ones(6),
    )  # fmt: skip
    best = [
        FoundDesign({"a": 2.0}, {}, {"reward": 3.0}, {}, {"egg": {"success_share": 1.0}}, context=0),
        FoundDesign({"a": 5.0}, {}, {"reward": 6.0}, {}, {"cylinder": {"success_share": 0.0}}, context=1),
    ]
    tasks = ("egg", "cylinder")
    return SearchResult(
        "ppo", 1, (), ("reward",), (True,), tasks, ({},), history, tuple(best), 5, 5, {}, {}, "budget", 1.0
    )


def test_a_policy_is_scored_over_its_tasks() -> None:
    result = policy_result()
    assert gripper_bars.score(result) == 4.5
    assert gripper_bars.stable_tasks(result) == 1
    found = gripper_bars.curve(result)
    assert found["grasps"] == [1, 2, 3, 3, 4, 5]  # the refused one was no grasp
    assert found["score"] == [None, 3.0, 4.0, 4.0, 4.0, 4.5]
    assert gripper_bars.policy(result)["cylinder"] == {"a": [5.0], "b": [5.0]}


def test_successes_are_counted() -> None:
    tasks = gripper_part(0.9, 1.0)["verified"]["conditions"]["mujoco"]
    assert stable(tasks) == (19, 20)
    assert rise_m(tasks) == pytest.approx(0.04)
    assert seed_statistics([{"score": 1.0}, {"score": 3.0}]) == pytest.approx(
        {"mean": 2.0, "sd": np.sqrt(2), "low": 1.0, "high": 3.0}
    )
    assert number(seed_statistics([{"score": 1.0}])["sd"]) == "–"
    laws = [{"rmse_of_largest": 0.01}, {"rmse_of_largest": 0.02}, {}]
    assert worst_law({"verified": {"laws": laws}}) == 0.02
    assert worst_law(None) is None


def gripper_part(held: float, score: float) -> dict[str, Any]:
    """Return a finished search over two tasks, checked in two engines, as stored for a part."""
    egg = {"success_share": held, "trials": 10.0, "z_max_m": 0.05}
    cylinder = {"success_share": 1.0, "trials": 10.0, "z_max_m": 0.03}
    values = {"r": 2.5e-3, "modules": 7, "egg_inset": 0.012, "cylinder_inset": 0.001}
    law = {"name": "r 2.5 mm", "n_states": 99, "rmse_of_largest": 0.0062, "worst_of_largest": 0.03}
    tasks = {"egg": egg, "cylinder": cylinder}
    length = ("real", "m")
    kinds = {"r": length, "modules": ("integer", ""), "egg_inset": length, "cylinder_inset": length}
    return {
        "pliant": "0", "words": "by a test", "simulations": 600, "failed": {"did not settle": 3}, "wall_s": 1800.0,
        "overrides": [], "reference_kernel": "solves", "reference_kernel_s": 0.1, "wall_in_kernels": 18000.0,
        "from_store": False, "machine": {"processor": "P", "cores": 2, "python": "3", "load": 0.5},
        "tasks": list(tasks), "stable_tasks": 2, "score": score, "seed": 1,
        "acting": {"egg": ["r", "modules", "egg_inset"], "cylinder": ["r", "modules", "cylinder_inset"]},
        "variables": [{"name": n, "type": t, "unit": u, "low": 0.0, "high": 10.0} for n, (t, u) in kinds.items()],
        "designs": [
            {"values": values, "context": 0, "objectives_before": {"reward": 5.5}},
            {"values": values, "context": 1, "objectives_before": {"reward": 4.5}},
        ],
        "policy": {"egg": {"modules": [6, 7, 7]}, "cylinder": {"modules": [9, 9, 10]}},
        "curve": {"grasps": [1, 300, 600], "score": [None, 1.0, score]},
        "verified": {"conditions": {"mujoco": tasks, "pybullet": tasks}, "laws": [law], "notes": []},
    }  # fmt: skip


def test_the_gripper_page_has_its_result_numbers(tmp_path: Path) -> None:
    part = gripper_part(1.0, 4.5)
    engines = {"mujoco": {"egg": {"success_share": 0.3, "trials": 10.0, "z_max_m": 0.02}}}
    base = {"engines": engines, "design": {"r": 2e-3, "modules": 6}, "laws": "direct FEM", "notes": []}
    over_seeds = {"ppo": [gripper_part(1.0, 4.0), gripper_part(1.0, 5.0)], "cmaes": []}
    stated = {"small": False, "overrides": ["search.seed=3"]}
    result = gripper_codesign.assembled({"ppo": part}, base, over_seeds, stated)
    (tmp_path / "gripper_codesign.md").write_text(read_page("gripper_codesign"))
    written = publish("gripper_codesign", gripper_page.TABLES, gripper_page.PICTURES, result, tmp_path)
    assert len([path for path in written if path.suffix == ".png" and path.stat().st_size < 200_000]) == 3
    found = marks((tmp_path / "gripper_codesign.md").read_text())
    assert "`search.seed=3`" in found["state"]
    assert "| 600 | 3 | 30.0 min | 18000 | 5 | 4.500 | 2 of 2 |" in found["searches"]
    assert "| `baseline` | mujoco | 3/10 | 20.0 mm |" in found["grasps"]
    assert "| `ppo` | pybullet | 20/20 | 40.0 mm | direct FEM |" in found["grasps"]
    assert "| `ppo` | r 2.5 mm | 99 | 0.62 % | 3 % | – |" in found["laws"]
    assert "| `ppo` | 2 | 600 | 4.500 ± 0.707 | 4.000 to 5.000 |" in found["seeds"]
    assert "| egg_inset | – | 12 mm | – |" in found["designs"]  # a policy is checked only where it acts
    assert "of the largest torque | ≤ 1 % | 0.62 % | met | 3.21 % |" in found["reached"]
    assert found["reached"].count("100 % | met") == 2
    worse = gripper_codesign.assembled({"ppo": gripper_part(0.9, 4.5)}, None, {}, stated)
    assert sum(bar["met"] is False for bar in worse["bars"]) == 2  # one of ten grasps lost, in two engines


def test_equal_grasps_are_equal_whoever_searches(tmp_path: Path) -> None:
    budgets = {}
    for one in gripper_codesign.small():
        opened = one.opened(tmp_path, quiet=True)
        budgets[one.name] = gripper_codesign.candidates(opened, 60)
    assert budgets == {"ppo": 60, "cmaes": 10, "optuna": 10}


def test_the_small_gripper_study_can_be_searched(tmp_path: Path) -> None:
    opened = gripper_codesign.small()[0].opened(tmp_path, quiet=True)
    problem = SearchProblem.from_study(gripper_codesign.few(opened.study), opened.context.registry)
    assert [condition.name for condition in problem.conditions] == ["egg-5", "cylinder-4"]
    acts = {"egg-5": ["egg_inset"], "cylinder-4": ["cylinder_inset"]}
    assert gripper_bars.acting(problem) == acts


@pytest.mark.parametrize(
    "words, said",
    [
        (["--small", "--publish"], "leave out one"),
        (["--workers", "0"], "at least 1"),
        (["--small", "task.no_such=1"], "no_such"),
    ],
)
def test_mistakes_are_one_sentence(words: list[str], said: str, tmp_path: Path, capsys: Any) -> None:
    with pytest.raises(SystemExit) as end:
        shape_matching.main([*words, "--out", str(tmp_path), "--store", str(tmp_path)])
    assert end.value.code == 2
    assert said in capsys.readouterr().err


def test_nothing_is_published_without_the_main_search(tmp_path: Path) -> None:
    folders = dict.fromkeys(("out", "store", "docs"), tmp_path)
    given = Given("shape_matching", only=("none",), publish=True, quiet=True, **folders)
    with pytest.raises(UserError, match="--only helix"):
        shape_matching.study(given)
    assert [path.name for path in tmp_path.iterdir()] == ["shape_matching.json"]
    assert not json.loads((tmp_path / "shape_matching.json").read_text())["runs"]


def test_an_interrupted_study_says_so(capsys: Any) -> None:
    def stopped() -> None:
        raise KeyboardInterrupt

    assert run_command(stopped) == 130
    assert "same command" in capsys.readouterr().err


def reaching(objective: float, wall_error: float = 0.002, worst: float = 0.01) -> dict[str, Any]:
    """Return a winner of the arm's study as a part has it."""
    solid = {"watertight": True, "crossings": 0, "volume_error": -0.002, "wall_error": wall_error}
    return {
        "reached_objective": objective,
        "printed": solid,
        "verified": {"laws": [{"worst_of_range": worst}]},
    }


def test_the_bars_of_the_arm_compare_with_the_hand_made_one() -> None:
    runs = {"cmaes": reaching(7.9), "optuna": reaching(8.1, wall_error=0.02, worst=0.04)}
    found = reach_bars.bars({"runs": runs, "baseline": {"reached_objective": 10.0}})
    met = {bar.what: bar.met for bar in found}
    assert [met[key] for key in met if key.startswith("cmaes")] == [True] * 5
    assert [met[key] for key in met if key.startswith("optuna")] == [False, False, True, True, False]
    assert all(bar.met is None for bar in reach_bars.bars({"runs": {}, "baseline": None}))


@pytest.mark.slow
def test_the_small_study_of_the_arm_begins_at_the_hand_made_one(tmp_path: Path) -> None:
    given = Given(
        "reach_around", small=True, workers=1, quiet=True, out=tmp_path / "out", store=tmp_path / "store",
        overrides=("search.budget=3", "meta_model.folds=2"),
    )  # fmt: skip
    result = reach_around.study(given)
    base = result["baseline"]["statics"]["reached_objective"]
    assert result["baseline"]["reached_objective"] <= base * (1 + 1e-9)
    for run in result["runs"].values():
        assert run["reached_objective"] == pytest.approx(run["objective"], rel=1e-6)
        assert run["reached_objective"] <= base * (1 + 1e-9)
        assert np.array(run["markers_m"]).shape[1] == 3
    assert reach_page.arms(result) is not None
