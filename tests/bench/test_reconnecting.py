"""A lost connection: the drivers open it again, the run that was cut short is repeated, and the experiment goes on."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.bench.plain_bench import PlainBench
from tests.bench.test_rounds import KINDS, QUICK, write_studies

from pliant import api
from pliant.errors import UserError
from pliant_bench.bench import BenchSample, ConnectionLostError
from pliant_bench.clock import AcceleratedClock
from pliant_bench.drivers.line_bench import LineBench
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
from pliant_bench.drivers.serial_line import SerialBench

EXAMPLE = Path(__file__).parents[2] / "examples" / "emulated_bench" / "finger.yaml"
CLOSED_AT = 12


class Pulled:
    """An emulated microcontroller behind a name that stays, whose pseudo-terminal can be closed and opened again."""

    def __init__(self, program: Path, folder: Path) -> None:
        self.program, self.folder, self.name = program, folder, folder / "tty"
        self.devices: list[Emulator] = []
        self.plug_in()

    def plug_in(self) -> None:
        log = self.folder / f"valve_{len(self.devices)}.log"
        self.devices.append(Emulator(self.program, log, step_ms=10))
        self.name.unlink(missing_ok=True)
        self.name.symlink_to(self.devices[-1].port)

    def pull(self) -> None:
        self.devices[-1].close()


@pytest.fixture
def pulled(emulator_program: Path, tmp_path: Path) -> Iterator[Pulled]:
    device = Pulled(emulator_program, tmp_path)
    yield device
    device.pull()


def serial(device: Pulled, attempts: int = 3) -> LineBench:
    config = SerialConfig(
        port=str(device.name), timeout_s=0.3, start_s=0.5, reconnect_attempts=attempts, reconnect_s=0.05
    )
    bench = SerialBench(config)
    bench.clock = AcceleratedClock()
    bench.connect()
    return bench


class Pulling(View):
    """A view that pulls the cable once, in the middle of a run, and plugs it in again unless it is to stay out."""

    def __init__(self, device: Pulled, run: int, stays_out: bool = False) -> None:
        self.device, self.run, self.stays_out = device, run, stays_out
        self.runs = 0

    def begins(self, protocol: object, expected: object) -> None:
        self.runs += 1

    def sample(self, sample: BenchSample) -> None:
        if self.runs == self.run and sample.index == CLOSED_AT:
            self.device.pull()
            if not self.stays_out:
                self.device.plug_in()


def experiment(bench: LineBench, folder: Path, view: View) -> tuple[object, ExperimentFolder]:
    opened = api.open_study(EXAMPLE, store=folder / "store")
    settings = opened.study.experiment.model_copy(
        update={
            "set_up_minutes": 0.0,
            "first_repeats": 2,
            "longest_run_s": 15.0,
            "silence_s": 100.0,
            "runs": 4,
        }
    )
    found = ExperimentFolder(folder / "experiment")
    planner = TellingPlanner(opened, settings, bench, QUICK)
    inputs = model_inputs(opened)
    end = run_rounds(Experiment(opened, settings, bench, found, inputs, KINDS, planner, Nobody(), view))
    return end, found


@pytest.mark.parametrize("run", [1, 3])
def test_the_run_is_repeated_after_the_terminal_was_closed_and_opened(
    pulled: Pulled, tmp_path: Path, run: int
) -> None:
    bench = serial(pulled)
    end, folder = experiment(bench, tmp_path, Pulling(pulled, run))
    bench.close()
    assert end.why != "bench"  # type: ignore[attr-defined]
    endings = [(one.read("recording") or {})["ending"] for one in folder.rounds()]
    assert endings.count("lost") == 1 and endings[run - 1] == "lost"
    cut, again = folder.rounds()[run - 1 : run + 1]
    assert (cut.read("recording") or {})["words"].startswith("cut short after")
    assert (again.read("plan") or {})[
        "why"
    ] == f"Run {run} was cut short by a lost connection; it is repeated."
    assert (
        again.read_protocol().commands["pressure_pa"].tolist()
        == cut.read_protocol().commands["pressure_pa"].tolist()
    )
    assert (again.read("recording") or {})["ending"] == "complete"
    _, second = (device.valve()[1] for device in pulled.devices)
    assert second[0] == 0.0 and second[-1] == 0.0  # vented when it was connected again, and in the end


def test_a_bench_that_stays_away_ends_the_experiment_after_the_stated_attempts(
    pulled: Pulled, tmp_path: Path
) -> None:
    bench = serial(pulled, attempts=2)
    opened = []
    line = bench.open_line
    bench.open_line = lambda: opened.append(1) or line()  # type: ignore[method-assign,func-returns-value]
    end, _ = experiment(bench, tmp_path, Pulling(pulled, 1, stays_out=True))
    assert end.why == "bench" and "The same command goes on" in end.sentence  # type: ignore[attr-defined]
    assert len(opened) == 2


def test_a_socket_is_opened_again(emulator_program: Path, tmp_path: Path) -> None:
    with Emulator(emulator_program, tmp_path / "valve.log", step_ms=10, tcp=True) as device:
        for _ in range(2):
            threading.Thread(target=device.accept, daemon=True).start()
        bench = SocketBench(SocketConfig(port=int(device.port), timeout_s=0.3, reconnect_s=0.05))
        bench.connect()
        assert bench._client is not None
        bench._client.close()
        with pytest.raises(OSError):
            bench.exchange({"pressure_pa": 0.0})
        assert bench.reconnect()
        assert bench.exchange({"pressure_pa": 0.0})["pressure_pa"] == 0.0
        bench.close()


def test_another_bench_at_the_same_place_is_refused(pulled: Pulled) -> None:
    bench = serial(pulled)
    bench._outputs = ()
    with pytest.raises(UserError, match="Another bench answers"):
        bench.reconnect()
    bench.close()


def test_a_connection_that_is_lost_again_and_again_ends_the_experiment(tmp_path: Path) -> None:
    class Loose(PlainBench):
        def reconnect(self) -> bool:
            return True

    def lose(index: int) -> None:
        if index == 8:
            raise ConnectionLostError("The cable is loose.")

    path = write_studies(tmp_path)
    opened = api.open_study(path, store=tmp_path / "store")
    bench, folder = Loose(before=lose), ExperimentFolder(tmp_path / "experiment")
    planner = TellingPlanner(opened, opened.study.experiment, bench, QUICK)
    inputs = model_inputs(opened)
    end = run_rounds(
        Experiment(opened, opened.study.experiment, bench, folder, inputs, KINDS, planner, Nobody())
    )
    assert end.why == "bench" and "3 runs were cut short one after the other" in end.sentence
    assert len(folder.rounds()) == 3
