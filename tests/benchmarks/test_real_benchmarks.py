"""The parts of the benchmarks on measured hardware; `make bench-real` prints their tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.real import baselines, elastomer, five, recordings, splits, tentacle, two_bellow
from benchmarks.real.held_out import held_out
from benchmarks.real.measured_bench import MeasuredBench, study_predictor
from benchmarks.real.static_laws import FOLDS, chosen, folds, static_laws

import pliant

BENCHES = {
    elastomer: "elastomer_strip.csv",
    tentacle: "tendon_tentacle.csv",
    two_bellow: "two_bellow_bending.csv",
}


def needs(name: str) -> Any:
    """Skip a test where a recording is not available."""
    path = recordings.MEASURED / name
    return pytest.mark.skipif(not path.is_file(), reason=f"{path} is not here")


def test_blocks_are_dealt_out_in_turn() -> None:
    number = folds(np.arange(0.0, 60.0, 0.5), block_s=5.0)
    assert np.all(number[:10] == 0)
    assert np.all(number[10:20] == 1)
    assert np.bincount(number).tolist() == [20] * FOLDS


def test_a_polynomial_is_found_again_and_its_degree_chosen() -> None:
    time = np.arange(0.0, 120.0, 0.5)
    first, second = 5e4 * np.sin(time / 7) ** 2, 5e4 * np.cos(time / 11) ** 2
    across = (first - second) / 5e4
    best = chosen(static_laws(first, second, 0.3 * across - 0.1 * across**3 + 0.02, time))
    assert best.degree == 3
    assert best.blocked < 1e-12
    assert best.weights == pytest.approx([0.02, 0.3, 0.0, -0.1], abs=1e-12)
    assert best.predict(np.array([5e4]), np.array([0.0])) == pytest.approx([0.22])


@pytest.mark.parametrize("bench", BENCHES, ids=lambda bench: bench.__name__.rpartition(".")[2])
def test_without_the_file_it_says_so(
    bench: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(recordings, "MEASURED", Path("nowhere"))
    monkeypatch.setattr(sys, "argv", ["bench"])
    bench.main()
    assert capsys.readouterr().out == f"skipped: {Path('nowhere') / BENCHES[bench]} is not here\n"


def test_the_draw_depends_on_names_alone() -> None:
    groups = [["b", "a", "c"], ["x", "y"]]
    assert held_out(groups, (1, 1)) == held_out([group[::-1] for group in groups], (1, 1))
    assert len(set(held_out(groups, (2, 1)))) == 3


@needs("tendon_tentacle.csv")
def test_tentacle_shapes_are_listed_in_body_order() -> None:
    """Points are ordered along the body whatever the markers are called; the authors' own list of two files agrees."""
    shapes = {
        run: tentacle.marker_positions(rows)
        for run, rows in recordings.read_runs(["tendon_tentacle.csv"]).items()
    }
    for shape in shapes.values():
        steps = np.linalg.norm(np.diff(shape, axis=0), axis=1)
        assert np.all((steps > 0.06) & (steps < 0.1))
    assert shapes["m1_u025"][3] == pytest.approx([0.0466, 0.0857, -0.0908], abs=2e-3)  # the body curls back
    assert shapes["m1_u015"][3] == pytest.approx([0.0759, 0.1499, -0.2443], abs=2e-4)
    assert tentacle.tension_n("m1_u015") == pytest.approx(0.15 / 0.0325)


def test_the_tentacle_is_as_stiff_and_heavy_as_its_cones(tmp_path: Path) -> None:
    path = tmp_path / "tentacle.yaml"
    path.write_text(tentacle.study_text(1e6, 1000.0))
    segments = pliant.open(path, store=tmp_path).config.chain.segments
    volume = sum(np.pi * size * (a * a + a * b + b * b) / 3 for size, a, b, _ in tentacle.CONES)
    assert sum(s.module_mass_kg for s in segments) == pytest.approx(1000.0 * volume, rel=1e-4)
    assert sum(s.module_length_m for s in segments) == pytest.approx(tentacle.LENGTH_M)
    # ∫ ds/r⁴ over a cone is l (1/b³ − 1/a³) / (3 (a − b)).
    give = sum(4 * size * (b**-3 - a**-3) / (3 * np.pi * 1e6 * (a - b)) for size, a, b, _ in tentacle.CONES)
    assert sum(1 / s.surrogate.coefficients.b_e for s in segments) == pytest.approx(give, rel=1e-3)


@needs("elastomer_strip.csv")
def test_the_relaxed_rubber_equals_the_training_holds() -> None:
    tests = {
        name: elastomer.thinned(rows)
        for name, rows in recordings.read_runs(["elastomer_strip.csv"], "test").items()
    }
    modulus = elastomer.relaxed_modulus(tests, ["relax_2d5", "relax_3d5", "relax_5d0"])
    assert 12.0 < modulus < 14.0
    assert 0.5 < elastomer.specimen_scatter(tests) < 3.0


@needs("two_bellow_bending_more.csv")
def test_the_runs_on_the_two_bellow_bench(tmp_path: Path) -> None:
    runs = two_bellow.read(tmp_path)
    assert set(runs) == {"7V", "12V", "9V", "7V_again"}
    for run in runs.values():
        assert np.corrcoef(run.p1 - run.p2, run.angle)[0, 1] > 0.9
        assert -0.1 < run.zero < 0.05
    repeat = two_bellow.compare_repeat(runs["7V"], runs["7V_again"])
    assert 0.0 < repeat.moved < repeat.by_clock < 0.03
    assert abs(repeat.shift_s) < 1.0


def test_splits_are_the_draw() -> None:
    """Judged runs were drawn by name; benches with one file per kind are split in time."""
    for bench, (groups, each) in splits.draws().items():
        judged = {one.run for one in splits.stretches(bench, "judge")}
        assert judged == set(held_out(groups, each))
        assert {one.run for one in splits.stretches(bench, "train")} == {
            n for g in groups for n in g
        } - judged
    assert set(splits.draws()) == {"soft_arm", "coiled_muscle", "silicone_beam"}


def test_no_reading_is_in_both_parts() -> None:
    for bench in five.BENCHES:
        train, judge = (splits.stretches(bench, part) for part in ("train", "judge"))
        for one in train:
            for other in judge:
                apart = one.end is not None and other.start is not None and one.end <= other.start
                assert one.run != other.run or apart


def test_a_stretch_leaves_the_rest_out() -> None:
    clock = splits.Stretch("swing", None, 0.3)
    assert clock.excluded() == [{"run": "swing", "start": "0.3 s"}]
    rows = splits.Stretch("day", 800, None, rows=True)
    assert rows.excluded() == [{"run": "day", "lines": [2, 801]}]  # line 1 is the header


def lagging(seed: int, name: str) -> baselines.Series:
    """Return a first-order lag of 2 s of a random input, squared, which the second baseline can represent."""
    rng = np.random.default_rng(seed)
    time = 0.1 * np.arange(600)
    driven = np.repeat(rng.uniform(-1, 1, 30), 20)[:, None]
    state, read = float(driven[0, 0]), []
    for value in driven[:, 0]:
        state += (1 - np.exp(-0.1 / 2.0)) * (value - state)
        read.append(state + 0.5 * state**2)
    fold = (np.arange(600) * 15 // 600) % 5
    return baselines.Series(name, time, driven, np.array(read)[:, None], fold)


def test_baselines_are_chosen_on_blocks_and_find_what_they_are_made_for() -> None:
    training, other = [lagging(0, "a"), lagging(1, "b")], lagging(2, "c")
    zero, one = np.zeros(1), np.ones(1)
    scales = baselines.Scales(zero, one, zero, one, ("angle_rad",), (False,), True)
    lags = [(f"{t} s, {d}", baselines.lag(t, d)) for t in (0.5, 1.0, 2.0, 4.0) for d in (1, 2)]
    found = baselines.choose("lag", lags, training, scales)
    assert found.order == "2.0 s, 2"
    assert baselines.errors(found, [other], scales)["angle_rad"] < 1e-3
    still = baselines.choose(
        "polynomial", [(str(d), baselines.polynomial(d)) for d in (1, 2)], training, scales
    )
    assert baselines.errors(still, [other], scales)["angle_rad"] > 0.1


def test_an_arx_model_runs_freely() -> None:
    """y' = 0.9 y + 0.1 u is simulated from its first reading alone; later readings are not used."""
    rng = np.random.default_rng(0)
    driven = rng.standard_normal((400, 1))
    read = np.zeros((400, 1))
    for k in range(1, 400):
        read[k] = 0.9 * read[k - 1] + 0.1 * driven[k]
    series = baselines.Series("a", np.arange(400.0), driven, read, np.arange(400) // 80)
    predict = baselines.arx(1, 1e-9)([series], None)
    blinded = baselines.Series(
        "a", series.time, driven, np.where(np.arange(400)[:, None] < 1, read, 7.0), series.fold
    )
    np.testing.assert_allclose(predict(blinded), read, atol=1e-6)


def test_a_zero_in_each_run_is_subtracted_for_every_model() -> None:
    series = lagging(0, "a")
    off = [series.outputs + 3.0]
    assert baselines.miss([series], off, (True,), None)[0] == pytest.approx(0.0, abs=1e-20)
    assert baselines.miss([series], off, (False,), None)[0] == pytest.approx(9.0)


@pytest.mark.parametrize("name", five.BENCHES)
def test_without_its_files_a_bench_says_so(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(recordings, "MEASURED", Path("nowhere"))
    five.report(five.bench_named(name))
    assert capsys.readouterr().out.startswith(f"skipped: {Path('nowhere') / name}")


# Residual of the law fitted to the training runs on those runs, first output: rms, SI.
LEFT = {
    "soft_arm": ("tip_x_m", 4e-3, 9e-3),
    "three_bellow_link": ("curvature_y_1_per_m", 0.05, 0.3),
    "coiled_muscle": ("extension_m", 1e-3, 4e-3),
    "cable_arm": ("tip_x_m", 2e-3, 5e-3),
    "silicone_beam": ("marker_1_x_m", 1e-3, 3e-3),
}


@pytest.mark.parametrize("name", five.BENCHES)
def test_a_bench_is_read_and_compared_as_its_logger_wrote_it(name: str, tmp_path: Path) -> None:
    bench: MeasuredBench = five.bench_named(name)
    absent = [path for path in bench.files() if not path.is_file()]
    if absent:
        pytest.skip(f"{absent[0]} is not here")
    study = bench.study(tmp_path)
    found = study.compare().record
    output, low, high = LEFT[name]
    assert low < found.outputs[output].rmse < high
    assert any("fitted to the readings" in said for said in study_predictor(study).remarks)
