"""`run_bench.py --small`: a few sets of every group through all processes, as in the full run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks.evidence.tasks import planned, small_plan

ROOT = Path(__file__).resolve().parents[2]
# Right by class of seven effects, and of two unknown ones: at a true share of 90 %, fewer in 0.3 % and 1 % of benches.
FEWEST = {"effects": 4, "unknown": 1}


@pytest.mark.slow
def test_the_small_bench_is_right(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "evidence" / "run_bench.py"), "--small"]
    done = subprocess.run([*command, "--out", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    data = json.loads((tmp_path / "evidence_small.json").read_text())
    assert data["n"] == len(small_plan().tasks()) and data["errors"] == 0
    assert data["planned"] == planned(small_plan()) == {g: row["n"] for g, row in data["time"].items()}
    assert (data["false_alarms"]["right"], data["false_alarms"]["n"]) == (0, 2)
    assert (data["effects"]["n"], data["unknown"]["n"]) == (7, 2)
    assert data["effects"]["by_class"]["right"] >= FEWEST["effects"]
    assert data["unknown"]["right"] >= FEWEST["unknown"]
