"""What the benchmark of the measured actuator is made of; its table is printed by `make bench-real`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.real import two_bellow
from benchmarks.real.two_bellow_data import FILE, FOLDS, folds, open_bench, static_laws


def test_blocks_are_dealt_out_in_turn() -> None:
    number = folds(np.arange(0.0, 60.0, 0.5), block_s=5.0)
    assert np.all(number[:10] == 0)
    assert np.all(number[10:20] == 1)
    assert np.bincount(number).tolist() == [20] * FOLDS


def test_a_polynomial_is_found_again_and_its_degree_chosen() -> None:
    time = np.arange(0.0, 120.0, 0.5)
    first, second = 5e4 * np.sin(time / 7) ** 2, 5e4 * np.cos(time / 11) ** 2
    across = (first - second) / 5e4
    laws = static_laws(first, second, 0.3 * across - 0.1 * across**3 + 0.02, time)
    best = min((law for law in laws if not law.apart), key=lambda law: law.blocked)
    assert best.degree == 3
    assert best.blocked < 1e-12
    assert best.weights == pytest.approx([0.02, 0.3, 0.0, -0.1], abs=1e-12)
    assert best.predict(np.array([5e4]), np.array([0.0])) == pytest.approx([0.22])


def test_without_the_file_it_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(two_bellow, "FILE", Path("nowhere/two_bellow_bending.csv"))
    two_bellow.main()
    assert capsys.readouterr().out == "skipped: nowhere/two_bellow_bending.csv is not here\n"


@pytest.mark.skipif(not FILE.is_file(), reason=f"{FILE} is not here")
def test_the_runs_as_pliant_reads_them(tmp_path: Path) -> None:
    bench = open_bench(tmp_path)
    for run in ("7V", "12V"):
        assert len(bench.measured(run)) == 2276
        first, second = bench.pressures(run)
        assert np.corrcoef(first - second, bench.measured(run))[0, 1] > 0.9
    assert bench.covered("7V", "12V").all()
    assert 0.6 < bench.covered("12V", "7V").mean() < 0.7
