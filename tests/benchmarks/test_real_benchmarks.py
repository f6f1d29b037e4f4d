"""What the benchmarks of measured hardware are made of; their tables are printed by `make bench-real`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.real import elastomer, recordings, tentacle, two_bellow
from benchmarks.real.held_out import held_out
from benchmarks.real.static_laws import FOLDS, chosen, folds, static_laws

import pliant

BENCHES = {
    elastomer: "elastomer_strip.csv",
    tentacle: "tendon_tentacle.csv",
    two_bellow: "two_bellow_bending.csv",
}


def needs(name: str) -> Any:
    """Skips a test where a recording is not here."""
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
def test_shapes_of_the_tentacle_are_told_in_the_order_of_its_body() -> None:
    """Whatever the camera called its markers; the authors' own list of two files agrees."""
    shapes = {
        run: tentacle.markers_of(rows) for run, rows in recordings.runs_of(["tendon_tentacle.csv"]).items()
    }
    for shape in shapes.values():
        steps = np.linalg.norm(np.diff(shape, axis=0), axis=1)
        assert np.all((steps > 0.06) & (steps < 0.1))
    assert shapes["m1_u025"][3] == pytest.approx([0.0466, 0.0857, -0.0908], abs=2e-3)  # it curls back
    assert shapes["m1_u015"][3] == pytest.approx([0.0759, 0.1499, -0.2443], abs=2e-4)
    assert tentacle.tension_n("m1_u015") == pytest.approx(0.15 / 0.0325)


def test_the_tentacle_is_as_stiff_and_heavy_as_its_cones(tmp_path: Path) -> None:
    path = tmp_path / "tentacle.yaml"
    path.write_text(tentacle.study_of(1e6, 1000.0))
    segments = pliant.open(path, store=tmp_path).config.chain.segments
    volume = sum(np.pi * size * (a * a + a * b + b * b) / 3 for size, a, b, _ in tentacle.CONES)
    assert sum(s.module_mass_kg for s in segments) == pytest.approx(1000.0 * volume, rel=1e-4)
    assert sum(s.module_length_m for s in segments) == pytest.approx(tentacle.LENGTH_M)
    # ∫ ds/r⁴ over a cone is l (1/b³ − 1/a³) / (3 (a − b)).
    give = sum(4 * size * (b**-3 - a**-3) / (3 * np.pi * 1e6 * (a - b)) for size, a, b, _ in tentacle.CONES)
    assert sum(1 / s.surrogate.coefficients.b_e for s in segments) == pytest.approx(give, rel=1e-3)


@needs("elastomer_strip.csv")
def test_the_relaxed_rubber_is_that_of_the_training_holds() -> None:
    tests = {
        name: elastomer.thinned(rows)
        for name, rows in recordings.runs_of(["elastomer_strip.csv"], "test").items()
    }
    modulus = elastomer.relaxed_modulus(tests, ["relax_2d5", "relax_3d5", "relax_5d0"])
    assert 12.0 < modulus < 14.0
    assert 0.5 < elastomer.scatter_of(tests) < 3.0


@needs("two_bellow_bending_more.csv")
def test_the_runs_of_the_two_bellow_bench(tmp_path: Path) -> None:
    runs = two_bellow.read(tmp_path)
    assert set(runs) == {"7V", "12V", "9V", "7V_again"}
    for run in runs.values():
        assert np.corrcoef(run.p1 - run.p2, run.angle)[0, 1] > 0.9
        assert -0.1 < run.zero < 0.05
    repeat = two_bellow.repeat_of(runs["7V"], runs["7V_again"])
    assert 0.0 < repeat.moved < repeat.by_clock < 0.03
    assert abs(repeat.shift_s) < 1.0
