"""The bench of the diagnoser: the plan is fair, a killed bench resumes, a sealed run is in the ledger."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from benchmarks.evidence import ledger, oracle, run_bench, seal
from benchmarks.evidence.counting import OTHERS, summary
from benchmarks.evidence.judge import judge
from benchmarks.evidence.law_shapes import SIZES
from benchmarks.evidence.oracle import best, choice, mean_squares
from benchmarks.evidence.publish import LAW_OFF_TABLES, PAGE, TABLES, expected_time, publish, with_tables
from benchmarks.evidence.publish import stored as stored_tables
from benchmarks.evidence.result_pictures import matrix
from benchmarks.evidence.robots import ROBOTS
from benchmarks.evidence.run_bench import Bench, Job, append, read
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.evidence.tasks import PLAN_OF, QUICK, Plan, Task, planned, small_plan
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN, kind_robots
from benchmarks.evidence.workers import ANY, make
from tests.testbed.judged_lines import CLASSES, answer, make_label, stated

from pliant.errors import UserError
from pliant.execution.executors import InlineExecutor, ProcessExecutor

KEY = bytes(range(32))
ROOT = Path(__file__).resolve().parents[2]


def test_the_plan_is_what_the_issue_asks_for() -> None:
    tasks = Plan(split="judged").tasks()
    of = {name: [t.spec for t in tasks if t.group == name] for name in {task.group for task in tasks}}
    assert len(KINDS) == 27 and all(sum(spec.kind == kind for spec in of["effect"]) >= 20 for kind in KINDS)
    clean = of["clean"]
    assert len(clean) >= 300
    for engine in ("functional", "mujoco", "explicit"):
        assert sum(spec.engine == engine for spec in clean) > 20
    assert len({spec.kind for spec in of["unknown"]}) >= 12 and len(of["unknown"]) >= 100
    assert not set(UNKNOWN) & set(KINDS)
    assert len({spec.kind for spec in of["pair"]}) == len(of["pair"]) >= 60
    assert len(of["poor"]) >= 50 and len(of["improve"]) >= 50
    for name in ("midway", "coarse"):
        assert Counter(spec.kind for spec in of[name]) == dict.fromkeys((*QUICK, CLEAN), 8)
    assert {spec.robot for spec in of["rod"]} == {"rod"} and not [
        t for t in Plan().tasks() if t.group == "rod"
    ]
    for kind in KINDS:  # every engine that follows its robots, and both robots
        mine = [spec for spec in of["effect"] if spec.kind == kind]
        assert {spec.robot for spec in mine} == set(kind_robots(kind))
        assert {spec.engine for spec in mine} >= {"functional", "mujoco"}
    suggested, random = ([t.spec for t in tasks if t.mode == mode] for mode in ("suggested", "random"))
    assert suggested == random and len(suggested) >= 50  # both ways of adding runs to the same sets
    names = {task.secret_id(KEY) for task in tasks}
    assert len(names) == len(tasks) and not [n for n in names if any(k in n for k in (*KINDS, *UNKNOWN))]
    task = Task("effect", SetSpec("mullins", 0))
    assert task.secret_id(KEY) == task.secret_id(KEY) != task.secret_id(KEY[::-1])
    other = Plan().tasks()
    assert {task.spec.engine for task in other} == {"functional"}  # one engine of three
    law_off = [
        t for split in ("calibration", "judged") for t in replace(PLAN_OF["law_off"], split=split).tasks()
    ]
    assert len(law_off) / 2 < len(tasks) and all(SIZES[0] <= t.spec.law_error <= SIZES[1] for t in law_off)
    assert all(not t.spec.law_error for t in tasks)
    seen = {t.group for t in law_off}
    assert seen == {t.group for t in tasks} - {"weak", "poor", "rich_noload"} | set(OTHERS)
    for part in ("payload", "clock", "gravity"):
        assert {t.spec.robot for t in law_off if t.group == part} == set(ROBOTS)
    small = small_plan().tasks()
    assert {task.group for task in small} == {"effect", "clean", "unknown", "midway", "coarse", "plan"}
    assert len(small) < 20
    assert expected_time(small_plan()).splitlines()[-1].split()[1] == str(len(small))


def test_any_beginning_in_the_plan_is_a_fair_part_from_every_group() -> None:
    tasks = Plan().tasks()
    whole = Counter((task.group, task.mode) for task in tasks)
    for part in (0.2, 0.4, 0.75):
        first = tasks[: round(part * len(tasks))]
        assert Plan(share=part).tasks() == first
        for group, count in Counter((task.group, task.mode) for task in first).items():
            assert count == pytest.approx(part * whole[group], abs=1.0)
        of_kind = Counter(task.spec.kind for task in first if task.group == "effect")
        assert max(of_kind.values()) - min(of_kind[kind] for kind in KINDS) <= 1
    assert planned(Plan(share=0.1)) == planned(Plan()) == Counter(task.group for task in tasks)
    shown = {task.spec.kind for task in tasks[: len(tasks) // 4] if task.group == "weak"}
    assert len(shown) > 5 and shown != set(KINDS[: len(shown)])  # not the first kinds of the list alone


def test_shards_share_the_tasks_and_their_results_are_read_as_one(tmp_path: Path) -> None:
    tasks = Plan(seeds=2).tasks()
    shards = [Bench(tmp_path, "full", shard=(part, 3)) for part in (1, 2, 3)]
    shared = [task for shard in shards for task in shard.shard_tasks(tasks)]
    assert len(shared) == len(tasks) == len(set(shared))
    for k, shard in enumerate(shards):
        append(shard.results, {"id": f"set{k}", "n": k})
    assert sorted(Bench(tmp_path, "full").lines()) == ["set0", "set1", "set2"]


def test_a_plan_adds_two_runs_and_stops_where_none_is_proposed() -> None:
    proposed = {"result": {"next_experiment": {"name": "holds"}}, "wall_s": 1.0, "cpu_s": 1.0}
    job = Job("x", Task("plan", SetSpec("mullins", 0), "suggested"))
    assert job.next_run(proposed) == "holds"
    assert job.next_run({"result": {"next_experiment": None}}) is None
    assert job.next_run({"error": "boom"}) is None
    job.runs = ["holds", "level"]
    assert job.next_run(proposed) is None
    assert Job("x", Task("plan", SetSpec("mullins", 0), "random")).next_run(proposed) == ANY
    assert Job("x", Task("poor", SetSpec("mullins", 0))).next_run(proposed) is None


@pytest.mark.slow
def test_the_scorer_with_the_true_forms_finds_strengths_and_kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = np.linspace(0, 1, 50)
    assert best(lambda s: grid * (s - 0.7), 0.0, 5.0, 1.0) == pytest.approx(0.0, abs=1e-12)
    assert choice({CLEAN: 1.0, "mullins": 0.99}, 100) == CLEAN
    assert choice({CLEAN: 1.0, "mullins": 0.9, "leak": 0.8}, 100) == "leak"
    monkeypatch.setattr(oracle, "KINDS", ("stiffness", "dead_zone", "mullins", "tendon_friction"))
    spec = SetSpec("dead_zone", 3, protocol="poor", snr=3.0)
    squares = mean_squares(spec, make_set(spec))
    assert choice(squares, 100) == "dead_zone"
    assert squares["dead_zone"] == pytest.approx(1.06, abs=0.15)  # noise and runs' offsets remain
    assert "tendon_friction" not in squares and squares[CLEAN] > 5


def test_the_page_is_written_from_numbers_alone(tmp_path: Path) -> None:
    items = [stated(0.95, True) for _ in range(19)] + [stated(0.9, False)]
    items += [judge("clean", make_label(CLEAN), answer("nothing_missing"))]
    data = json.loads(json.dumps(summary(items)))
    page = tmp_path / "page.md"
    marks = "".join(f"<!-- bench: {name} -->\nSTALE\n<!-- end -->\n\n" for name in TABLES)
    page.write_text(f"# Title\n\nwords stay\n\n{marks}")
    publish(data, page, tmp_path)
    text = page.read_text()
    assert "words stay" in text and "STALE" not in text
    assert "| `mullins` | 19/20 | 19/20 | a form 19/20 | `stiffness` 1 |" in text
    assert all((tmp_path / f"bench_{name}.png").exists() for name in ("confusion", "reliability", "strength"))
    publish(data, page, tmp_path)
    assert page.read_text() == text
    page.write_text("<!-- bench: nonsense -->\n<!-- end -->")
    with pytest.raises(UserError, match="nonsense"):
        publish(data, page, tmp_path)
    hidden, columns, shares = matrix(data)
    assert shares[hidden.index("mullins"), columns.index("mullins")] == pytest.approx(95)
    assert with_tables(PAGE.read_text(), stored_tables()) == PAGE.read_text()  # no typed numbers
    named = set(re.findall(r"<!-- bench: (\w+) -->", PAGE.read_text()))
    assert set(TABLES) <= named <= {*TABLES, *LAW_OFF_TABLES}


def test_a_torn_line_is_closed_off_and_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "r.jsonl"
    append(path, {"id": "a", "n": 1})
    with path.open("a") as file:
        file.write('{"id": "b", "n"')  # killed while writing
    append(path, {"id": "c", "n": 3})
    assert read(path) == {"a": {"id": "a", "n": 1}, "c": {"id": "c", "n": 3}}
    assert read(tmp_path / "none.jsonl") == {}


NONE = dict.fromkeys(
    ("clean", "unknown", "pairs", "weak", "poor", "noload", "quick", "rods", "plan", "improve"), 0
)
THREE = Plan(kinds=("stiffness",), seeds=3, other_every=0, protocol="poor", **NONE)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def three_sets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bench's folder with made sets, of which the stand-in reads a head: no process compiles the truths."""
    made = Bench(tmp_path_factory.mktemp("made") / "evidence", "full")
    head = "run,specimen,time_s,pressure_pa,angle_rad\n"
    one = SimpleNamespace(csv=head, study="surrogate: {kind: polynomial}\n", label=make_label("stiffness"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("benchmarks.evidence.sets.make_set", lambda spec, name: one)
        for task in THREE.tasks():
            make(task, task.secret_id(made.key()), made.sets, made.key())
    return made.folder


def words(out: Path, *more: str) -> list[str]:
    found = ["--out", str(out), "--diagnoser", "testbed_stand_in", "--workers", "1", "--kinds", "stiffness"]
    found += ["--seeds", "3", "--other-every", "0", "--protocol", "poor", *more]
    return found + [word for name in NONE for word in (f"--{name}", "0")]


@pytest.fixture
def bench(
    three_sets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., str]:
    """Return a function that gives the output of a bench over the three sets; it runs in this process."""
    shutil.copytree(three_sets, tmp_path / "evidence")
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setattr(run_bench, "ProcessExecutor", lambda workers: InlineExecutor())

    def run(*more: str) -> str:
        run_bench.main(words(tmp_path, *more))
        return capsys.readouterr().out

    return run


@pytest.mark.slow
def test_a_killed_bench_goes_on_where_it_was(bench: Callable[..., str], tmp_path: Path) -> None:
    lines = tmp_path / "evidence" / "full.jsonl"
    script = str(ROOT / "benchmarks" / "evidence" / "run_bench.py")
    paths = {"PYTHONPATH": str(Path(__file__).parent), "STAND_IN_SECONDS": "2"}
    first = subprocess.Popen(
        [sys.executable, script, *words(tmp_path)], env=os.environ | paths, stdout=subprocess.DEVNULL
    )
    while not (lines.exists() and read(lines)):
        assert first.poll() is None
        time.sleep(0.1)
    first.send_signal(signal.SIGKILL)
    first.wait()
    before = read(lines)
    assert 1 <= len(before) < 3
    assert f"3 sets, {len(before)} done before" in bench()
    after = read(lines)
    assert len(after) == 3 and all(after[name] == line for name, line in before.items())
    data = json.loads((tmp_path / "evidence.json").read_text())
    assert (data["effects"]["right"], data["effects"]["n"]) == (3, 3)
    assert "stiffness 3" in bench("--summarise")


@pytest.mark.slow
def test_a_diagnoser_that_dies_costs_its_own_set_alone(
    bench: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_bench, "ProcessExecutor", ProcessExecutor)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    named = Bench(tmp_path / "evidence", "full")
    one = THREE.tasks()[0].secret_id(named.key())
    monkeypatch.setenv("STAND_IN_DIES_AT", one)
    with pytest.raises(SystemExit):
        bench()
    lines = named.lines()
    assert [name for name, line in lines.items() if "was killed" in line.get("error", "")] == [one]
    assert len(lines) == 3
    monkeypatch.delenv("STAND_IN_DIES_AT")
    assert "3 sets, 2 done before" in bench()
    assert "result" in named.lines()[one]


def test_shards_run_apart_and_are_summarised_as_one(bench: Callable[..., str], tmp_path: Path) -> None:
    assert "2 sets, 0 done before" in bench("--shard", "1/2")
    assert "1 sets, 0 done before" in bench("--shard", "2/2")
    files = sorted((tmp_path / "evidence").glob("full.*-of-2.jsonl"))
    assert [len(read(file)) for file in files] == [2, 1]
    (tmp_path / "evidence.json").unlink()
    assert "stiffness 3" in bench("--summarise")
    data = json.loads((tmp_path / "evidence.json").read_text())
    assert (data["effects"]["right"], data["effects"]["n"]) == (3, 3) and data["planned"] == {"effect": 3}


def sealed(tmp_path: Path, done: int, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Return the files of a run of three sets, `done` of which were answered when it was stopped."""
    plan = replace(THREE, split="judged", draw="abc")
    bench = Bench(tmp_path / "evidence", "sealed-abc")
    paths = tmp_path / "ledger.jsonl", tmp_path / "answers.jsonl.gz"
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(KeyboardInterrupt), run_bench.in_the_ledger(bench, plan, *paths):
        bench.sets.mkdir(parents=True)
        for task in plan.tasks()[:done]:
            name = task.secret_id(bench.key())
            (bench.sets / f"{name}.sealed").write_text(seal.seal(make_label("stiffness"), bench.key()))
            append(bench.results, {"id": name, **answer("missing_effect", "stiffness"), "cpu_s": 1.23456789})
        raise KeyboardInterrupt
    return paths


def test_a_sealed_run_stays_in_the_ledger_whatever_happens_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, kept = sealed(tmp_path, 0, monkeypatch)
    (nothing,) = ledger.entries(path)
    assert nothing["code"] == "abc" and not nothing["finished"] and nothing["done"] == 0 and not kept.exists()
    ledger.note(
        {"run": "killed", "began": "2026-01-01T00:00:00Z", "commit": "x", "code": "y", "planned": 9}, path
    )
    monkeypatch.setattr(ledger, "now", lambda: "2026-01-02T00:00:00Z")
    before = path.read_text()
    shutil.rmtree(tmp_path / "evidence")
    sealed(tmp_path, 2, monkeypatch)
    assert path.read_text().startswith(before)  # lines are only added
    *_, last = ledger.entries(path)
    assert last["figures"]["strictly"] == [2, 2] and last["planned"] == 3 and not last["finished"]
    head, items = ledger.read_answers(kept)
    assert head["done"] == 2 and [item.is_right for item in items] == [True, True]
    rows = list(TABLES["runs"]({"ledger": ledger.entries(path)}))
    assert ["stopped" in rows[2], "killed" in rows[3], "100.0 %" in rows[4]] == [True] * 3


def test_a_truth_that_cannot_be_followed_ends_no_bench_and_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any) -> None:
        raise RuntimeError("run 'holds' of the truth did not converge")

    monkeypatch.setattr(run_bench, "make", fails)
    monkeypatch.setattr(run_bench, "ProcessExecutor", lambda workers: InlineExecutor())
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    bench, path = Bench(tmp_path / "evidence", "sealed-abc"), tmp_path / "ledger.jsonl"
    with run_bench.in_the_ledger(bench, THREE, path, tmp_path / "answers.gz"):
        run_bench.run(bench, THREE)
    (one,) = ledger.entries(path)
    assert (one["done"], one["unmade"], one["finished"]) == (0, 3, True)
    assert all("holds" in line["unmade"] for line in bench.lines().values())


def test_judged_sets_are_drawn_from_the_code_that_is_judged(tmp_path: Path) -> None:
    for name in ledger.CODE:
        part = tmp_path / name
        (part.parent if part.suffix else part).mkdir(parents=True, exist_ok=True)
        (part if part.suffix else part / "one.py").write_text("x = 1\n")
    seen = {ledger.code_digest(tmp_path)}
    for name in ledger.CODE:
        part = tmp_path / name
        (part if part.suffix else part / "one.py").write_text("x = 2\n")
        seen.add(ledger.code_digest(tmp_path))
    assert len(seen) == len(ledger.CODE) + 1  # each part of it counts
    one, same, other = (SetSpec("mullins", 0, split="judged", draw=draw) for draw in ("a", "a", "b"))
    drawn = [spec.generator().random() for spec in (one, same, other)]
    assert drawn[0] == drawn[1] != drawn[2]
    tasks = [Plan(split="judged", draw=draw).tasks() for draw in ("a", "b")]
    assert not {t.secret_id(KEY) for t in tasks[0]} & {t.secret_id(KEY) for t in tasks[1]}
    with pytest.raises(SystemExit, match="the whole plan"):
        run_bench.main(["--sealed", "--seeds", "3"])


def test_kept_answers_are_judged_as_the_whole_ones(tmp_path: Path) -> None:
    line = answer("ambiguous", credible=[["stiffness"], ["wall_thickness"]])
    line["result"] |= {
        "classes": [{"kinds": kinds, "why": "x"} for kinds in CLASSES],
        "next_experiment": {"a": 1},
    }
    line["result"]["hypotheses"] = [
        {"kinds": ["leak"], "probability": 0.003},
        {"kinds": ["stiffness"], "probability": 0.6},
    ]
    task = Task("effect", SetSpec("stiffness", 0))
    kept = ledger.compact(task, make_label("stiffness"), line)
    path = tmp_path / "kept.gz"
    ledger.write_answers({"commit": "x"}, [kept], path)
    first = path.read_bytes()
    ledger.write_answers({"commit": "x"}, [kept], path)
    assert path.read_bytes() == first
    assert ledger.read_answers(path) == ({"commit": "x"}, [judge("effect", make_label("stiffness"), line)])
    assert "0.003" not in json.dumps(kept) and "next_experiment" not in json.dumps(kept)
    assert ledger.read_answers(tmp_path / "none.gz") == ({}, [])


def test_a_sealed_run_continues_from_the_stored_answers_of_the_same_code(tmp_path: Path) -> None:
    tasks = replace(THREE, split="judged").tasks()
    kept = [ledger.compact(task, make_label("stiffness"), answer("ambiguous")) for task in tasks]
    path = tmp_path / "kept.gz"
    ledger.write_answers({"code": "a"}, kept, path)
    assert ledger.stored_answers("b", path) == {} == ledger.stored_answers("a", tmp_path / "none.gz")
    stored = ledger.stored_answers("a", path)
    assert list(stored) == [task.public_id for task in tasks]
    assert len({task.public_id for task in (*tasks, *THREE.tasks())}) == 2 * len(
        tasks
    )  # other sets, other names
    bench = Bench(tmp_path / "bench", "sealed", stored=stored)
    run_bench.run(bench, replace(THREE, split="judged"))
    assert not bench.results.exists() and run_bench.answers(bench, replace(THREE, split="judged")) == kept


def test_the_answers_in_the_tree_are_small_and_belong_to_the_last_run_that_ended() -> None:
    head, items = ledger.read_answers()
    ended = [one for one in ledger.entries() if one.get("done") and "plan" in one]
    ended = [one for one in ended if one["plan"].get("bed", "exact") == "exact"]
    assert bool(head) == bool(ended)
    if head:
        assert ledger.ANSWERS.stat().st_size < 2_000_000 and len(items) == head["done"]
        assert head["run"] == ended[-1]["run"] and ledger.headline(summary(items)) == ended[-1]["figures"]
