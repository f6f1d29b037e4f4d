"""The second bed: laws with errors of shape, wrong records, the candidates' own equations."""

from __future__ import annotations

import csv
import hashlib
import io
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from benchmarks.evidence import dump, law_shapes, robots
from benchmarks.evidence.bench_errors import BenchError, done
from benchmarks.evidence.form_table import CANDIDATE_FORMS, LAW_SHAPES, SPLITS
from benchmarks.evidence.forms import TYPICAL_ANGLE_RAD, law_error
from benchmarks.evidence.law_shapes import SURFACES, draw_law, draw_pull, sayable, visited
from benchmarks.evidence.protocols import protocol
from benchmarks.evidence.robots import (
    B_E,
    GRAVITY_M_S2,
    K_N,
    M_A,
    M_E,
    PEAK_TORQUE_N_M,
    PRESSURE_MAX_PA,
    ROBOTS,
    Array,
)
from benchmarks.evidence.sets import (
    MeasuredSet,
    SetSpec,
    draw_truth,
    follow,
    make_set,
    noise_sizes,
    signal,
)
from benchmarks.evidence.tasks import INTERVAL_PROTOCOL, group_tasks
from benchmarks.evidence.truths import CLEAN, PARAMETERS

from pliant import api
from pliant.evidence.error_bins import run_residuals

# CSVs of the bed of exact laws as they were before this bed: its sets do not change, bit for bit.
BEFORE = {
    "54b4fb50cad3c674": SetSpec(CLEAN, 1, split="calibration", protocol="poor"),
    "8c9b7260b1ec8a66": SetSpec("mullins", 2, split="calibration"),
    "b41c65eb70fe33f6": SetSpec("detent", 4, split="calibration", robot="four", protocol="coarse"),
    "828261ec1d5b7483": SetSpec("tendon_friction", 5, robot="finger", protocol="coarse", draw="abc"),
    "d8d4f49196fb18d7": SetSpec(CLEAN, 9, "functional", "chain", "rates"),
    "9f7bac82885238fc": SetSpec("supply_lag", 11, split="calibration", protocol="midway"),
}


@cache
def made(kind: str, robot: str = "joint", protocol: str = "rates", **more: object) -> MeasuredSet:
    return make_set(SetSpec(kind, 2, robot=robot, protocol=protocol, split="calibration", **more))


@pytest.mark.parametrize("digest", BEFORE, ids=[spec.kind for spec in BEFORE.values()])
def test_sets_with_exact_laws_are_what_they_were(digest: str) -> None:
    assert hashlib.sha256(make_set(BEFORE[digest]).csv.encode()).hexdigest()[:16] == digest


def off(
    size: float, split: str, seed: int = 0, robot: str = "joint"
) -> tuple[Array, Array, Array, law_shapes.LawShape]:
    """Return shares, angles and errors, in shares of the torque range, at the visited states."""
    share, angle = visited(robot)
    law = draw_law(size, split, share, angle, np.random.default_rng(seed))
    errors = np.array([law_error(*state, law.table) for state in zip(share, angle, strict=True)])
    return share, angle, errors / PEAK_TORQUE_N_M, law


@pytest.mark.parametrize("split", SPLITS)
@pytest.mark.parametrize("size", [0.003, 0.03])
def test_an_error_has_its_size_and_no_stiffness_gain_offset_or_quadratic_part(
    split: str, size: float
) -> None:
    share, angle, errors, law = off(size, split)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(size, rel=0.01) and law.rms == size
    assert np.abs(errors).max() == pytest.approx(law.largest, rel=0.05)
    torques = (  # of a unit of each effect that is a sum of these parts
        (K_N + M_A * angle) * share,
        K_N + M_A * angle,
        B_E * angle + 0.5 * M_E * angle * np.abs(angle),
        angle * np.abs(angle),
    )
    for torque in torques:
        assert abs(np.corrcoef(torque, errors)[0, 1]) < 0.01
    left = errors - sayable(share, angle) @ (np.linalg.pinv(sayable(share, angle)) @ errors)
    assert np.sqrt(np.mean(left**2)) > 0.99 * size


@pytest.mark.parametrize("split", SPLITS)
def test_no_shape_is_a_low_order_polynomial_and_joints_stay_stiff(split: str) -> None:
    told, forms = [], set()
    for seed in range(12):
        share, angle, errors, law = off(0.02, split, seed)
        x, y = 2 * share - 1, angle / np.abs(angle).max()
        low = np.column_stack([x**i * y**j for i in range(4) for j in range(4 - i)])
        left = errors - low @ np.linalg.lstsq(low, errors, rcond=None)[0]
        told.append(1 - np.mean(left**2) / np.mean(errors**2))
        forms.add(law.form)
        step = 1e-4
        for p in np.linspace(0, 1, 11):
            for u in np.linspace(angle.min(), angle.max(), 41):
                slope = (law_error(p, u + step, law.table) - law_error(p, u - step, law.table)) / (2 * step)
                stiffness = B_E + M_E * abs(u) - M_A * PRESSURE_MAX_PA * p
                assert slope < 0.8 * stiffness
    assert np.max(told) < 0.995 and np.median(told) < 0.97
    assert forms == {form.name for form in LAW_SHAPES[SPLITS.index(split)]}


def test_every_basis_has_its_function_and_a_rod_gets_a_pull_from_the_actuation_alone() -> None:
    assert set(SURFACES) == {form.name for split in LAW_SHAPES for form in split}
    _, pull = draw_pull(0.02, "judged", np.random.default_rng(3))
    nodes = law_shapes.LOWEST_SHARE + law_shapes.NODE_SHARE * np.arange(law_shapes.SHARE_NODES)
    share = np.linspace(0, 1, 201)
    errors = np.interp(share, nodes, pull)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(0.02, rel=0.1)
    left = errors - np.polyval(np.polyfit(share, errors, 2), share)
    assert np.sqrt(np.mean(left**2)) == pytest.approx(0.02, rel=0.1)


def residuals(one: MeasuredSet, folder: Path) -> dict[str, float]:
    """Return the RMS of measured − model over σ, of the model that is given to the diagnoser."""
    (folder / "study.yaml").write_text(one.study)
    (folder / "bench.csv").write_text(one.csv)
    opened = api.open_study(folder / "study.yaml", store=folder / "store")
    predictor = api.predictor(opened, folder / "bench.csv")
    every = run_residuals(predictor.measurement, predictor.predict())
    found = {}
    for name, sigma in one.sigma.items():
        values = np.concatenate([run[name] for run in every if name in run])
        found[name] = float(np.sqrt(np.nanmean(values**2)) / sigma)
    return found


@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_a_payload_hangs_at_the_tip_as_the_model_has_it(robot: str, tmp_path: Path) -> None:
    one = made(CLEAN, robot, "payload")
    assert max(residuals(one, tmp_path).values()) < 1.5
    rows = list(csv.DictReader(io.StringIO(one.csv)))
    assert {row["payload_kg"] for row in rows} == {
        f"{x * ROBOTS[robot].payload_max_kg:.4f}" for x in (0, 0.5, 1)
    }


def test_a_law_that_is_off_leaves_its_error_and_what_is_static_is_static(tmp_path: Path) -> None:
    one = made(CLEAN, law_error=0.03, law_seed=4)
    assert one.label["right"] == ["nothing_missing", "law_off", "insufficient_data"]
    left = residuals(one, tmp_path)["angle_rad"]
    assert left > 1.2 and left == pytest.approx(np.hypot(1.0, one.label["law_snr"]), rel=0.2)
    assert one.csv != made(CLEAN, law_error=0.03, law_seed=5).csv
    assert "law_error" not in one.study
    truth = draw_truth(SetSpec(CLEAN, 2, robot="joint", law_error=0.03, law_seed=4))
    assert truth.at().forms.actuation_error == 0.0 and truth.at().forms.law.shape == (31, 69)
    for kind, known in (("gain_bump", True), ("detent", True), ("torque_ripple", False)):
        assert ("law_off" in made(kind, law_error=0.01, law_seed=4).label["right"]) is known


@pytest.mark.parametrize("kind", sorted(PARAMETERS))
def test_the_candidates_equation_with_the_stated_parameters_makes_the_readings(
    kind: str, tmp_path: Path
) -> None:
    """The law is exact to 0.4 % and the study has the candidate with the label's parameters: only noise remains."""
    one = made(kind, "joint", INTERVAL_PROTOCOL, candidates=True)
    values = {name.split(".")[1]: value for name, value in one.label["parameters"].items()}
    assert set(CANDIDATE_FORMS) == set(PARAMETERS) and values
    parts = ", ".join(
        f"{name.removesuffix('_rad').removesuffix('_s')}: {text}" for name, text in _units(values).items()
    )
    (tmp_path / "with").mkdir()
    effect = f"effects:\n  - {{kind: {kind}, {parts}}}\n"
    plain = residuals(one, tmp_path)["angle_rad"]
    with_it = residuals(MeasuredSet(one.study + effect, *set_contents(one)), tmp_path / "with")["angle_rad"]
    assert plain > 1.6 and with_it < 1.12
    assert one.label["forms"] == ["the candidate's"]


def _units(values: dict[str, float]) -> dict[str, str]:
    ends = {"_rad": " rad", "_s": " s"}
    return {
        name: f"{value:.9g}" + next((unit for end, unit in ends.items() if name.endswith(end)), "")
        for name, value in values.items()
    }


def set_contents(one: MeasuredSet) -> tuple[object, ...]:
    return one.csv, one.label, one.clean, one.hidden, one.measured, one.sigma


def test_what_was_done_is_later_than_what_is_written_down() -> None:
    runs = protocol("rich")
    assert done(runs, BenchError()) is runs
    late = done(runs, BenchError(clock_late_s=0.6, clock_drift=0.01))
    for run, other in zip(runs, late, strict=True):
        assert np.array_equal(other.time_s[other.kept], run.time_s) and other.kept.sum() == len(run)
        then = other.time_s - 0.6 - 0.01 * other.time_s
        assert other.pressure_pa == pytest.approx(np.interp(then, run.time_s, run.pressure_pa))
        assert np.diff(other.time_s).max() <= max(0.0401, np.diff(run.time_s).max() / 2)
    session = done(runs, BenchError(clock_session=1e-3))
    clock = sum(run.seconds for run in runs[:-1])
    last = session[-1]
    assert last.pressure_pa == pytest.approx(
        np.interp(last.time_s - 1e-3 * clock, runs[-1].time_s, runs[-1].pressure_pa)
    )
    early = done(runs[-1:], BenchError(clock_late_s=-0.4))[0]
    assert early.pressure_pa[early.kept][:-1] == pytest.approx(runs[-1].pressure_pa[1:])


def test_labels_are_off_where_they_say() -> None:
    runs = protocol("payload")
    loaded = [run.payload_kg for run in runs if run.payload_kg]

    def hung(**error: float) -> list[float]:
        return [run.payload_kg for run in done(runs, BenchError(**error)) if run.payload_kg]

    assert len(loaded) == 16 and hung(label_factor=0.5) == pytest.approx([1.5 * kg for kg in loaded])
    top = max(loaded)
    assert hung(label_hook=0.2) == pytest.approx([kg + 0.2 * top for kg in loaded])
    assert hung(label_level=-0.3) == pytest.approx([0.7 * kg if kg == top else kg for kg in loaded])
    one = hung(label_run=3.0, label_run_off=0.4)
    assert one[2] == pytest.approx(1.4 * loaded[2]) and one[:2] + one[3:] == loaded[:2] + loaded[3:]
    assert (
        max(run.payload_kg for run in done(runs, BenchError(label_factor=-0.5)) if not run.payload_kg) == 0.0
    )


@pytest.mark.parametrize("split", SPLITS)
def test_records_that_are_wrong_are_as_wrong_as_the_label_says(split: str, tmp_path: Path) -> None:
    for group in ("payload", "clock"):
        one = make_set(group_tasks(group, 1, split, "law_off")[0].spec)
        assert one.label["snr_reached"] > 0.3 and one.label["kinds"] == [f"wrong_{group}"]
        assert residuals(one, tmp_path)["angle_rad"] > 1.1
    specs = [task.spec for task in group_tasks("gravity", 8, split, "law_off") if task.spec.robot == "joint"]
    for spec in specs[:2]:
        one = make_set(spec)
        assert one.label["strengths"] == [1.0] and "gravity: [" in one.study
        gravity = [float(x) for x in one.study.split("gravity: [")[1].split("]")[0].split(",")]
        assert np.linalg.norm(gravity) == pytest.approx(0.0, abs=1e-9) or np.linalg.norm(
            gravity
        ) == pytest.approx(GRAVITY_M_S2, rel=1e-4)


def test_sets_in_the_bed_are_dumped_with_open_labels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dump.main(["--bed", "law_off", "--group", "interval", "--count", "2", "--out", str(tmp_path)])
    assert "law off by" in capsys.readouterr().out
    assert len(list(tmp_path.glob("*.csv"))) == len(list(tmp_path.glob("*_label.json"))) == 2


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["joint", "four"])
def test_the_engines_agree_on_a_law_that_is_off(robot: str) -> None:
    runs = protocol("example", ROBOTS[robot])
    truth = draw_truth(SetSpec(CLEAN, 2, robot=robot, law_error=0.02, law_seed=4)).at()
    engines = ("functional", "mujoco", "explicit")[: 3 if robot == "joint" else 2]
    found = {one: follow(one, ROBOTS[robot], runs, truth, np.zeros(len(runs))) for one in engines}
    sigma = noise_sizes(found["functional"])
    for engine in found:
        assert signal(found["functional"], found[engine], sigma) < 0.1, engine


def test_only_the_study_with_an_exact_law_says_how_good_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robots, "LAW_ERROR_STATED", True)
    exact, off = (ROBOTS["joint"].study("x", exact_law=known) for known in (True, False))
    assert exact == off + "law_error: 0.5 %\n" and "law_error" not in off


def test_the_grid_holds_what_is_visited() -> None:
    for robot, runs in product(ROBOTS, ("rich", "payload")):
        share, angle = visited(robot, runs)
        bend = angle / TYPICAL_ANGLE_RAD
        assert share.min() == 0.0 and share.max() == 1.0
        assert bend.min() > law_shapes.LOWEST_BEND + 1
        assert bend.max() < law_shapes.LOWEST_BEND + (law_shapes.BEND_NODES - 1) * law_shapes.NODE_BEND - 1
