"""The closed loop over lines of which 40 % are dropped, late, doubled or damaged has the verdict of a good line."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from tests.docs.pages import ROOT

from pliant import api
from pliant_bench.choose import SearchEffort
from pliant_bench.drivers.line_config import SerialConfig, SocketConfig
from pliant_bench.drivers.socket_line import SocketBench
from pliant_bench.emulator import Emulator
from pliant_bench.loop.experiment import Experiment
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.person import Nobody
from pliant_bench.loop.planner import TellingPlanner, model_inputs
from pliant_bench.loop.rounds import run_rounds
from pliant_bench.loop.view import View

pytest.importorskip("serial")
from tests.bench.mangled_benches import MangledSerial, MangledSocket
from tests.bench.test_line_benches import NEEDS_A_QUIET_COMPUTER

from pliant_bench.drivers.serial_line import SerialBench

KINDS = ["supply_lag", "viscous_damping", "stiffness", "sensor_scale", "sensor_bias"]
LONGEST_RUN_S = 12.0  # the emulated bench runs in real time
QUICK = SearchEffort(random=6, elsewhere=2, settings=1, generations=1, children=3)


def verdict(bench: Any, folder: Path) -> dict[str, Any]:
    """Return the last verdict of an experiment on this bench."""
    opened = api.open_study(ROOT / "examples" / "emulated_bench" / "finger.yaml", store=folder / "store")
    settings = opened.study.block("experiment").model_copy(update={"longest_run_s": LONGEST_RUN_S})
    bench.connect()
    try:
        experiment = ExperimentFolder(folder / "experiment")
        experiment.begin({"study": opened.study.name})
        planner = TellingPlanner(opened, settings, bench, QUICK)
        run_rounds(
            Experiment(
                opened,
                settings,
                bench,
                experiment,
                model_inputs(opened),
                KINDS,
                planner,
                Nobody(),
                View(),
            )
        )
    finally:
        bench.close()
    return [one for f in experiment.rounds() if (one := f.read("verdict")) is not None][-1]


@pytest.mark.slow
@NEEDS_A_QUIET_COMPUTER
@pytest.mark.parametrize("kind", [SerialBench, MangledSerial, MangledSocket])
def test_a_bad_line_changes_no_verdict(kind: type[Any], emulator_program: Path, tmp_path: Path) -> None:
    tcp = issubclass(kind, SocketBench)
    with Emulator(emulator_program, tmp_path / "valve.log", tcp=tcp) as device:
        if tcp:
            threading.Thread(target=device.accept, daemon=True).start()
        found = verdict(kind((SocketConfig if tcp else SerialConfig)(port=device.port)), tmp_path)
        _, pressures = device.valve()
    assert found["verdict"] == "missing_effect" and found["selected"] == ["viscous_damping"]
    assert pressures.min() >= 0.0 and pressures.max() <= 12e3
