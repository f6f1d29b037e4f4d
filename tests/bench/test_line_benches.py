"""Benches behind the line protocol, over a pseudo-terminal and TCP, on good lines and on bad ones."""

import os
import pty
import threading
import time
import tty

import numpy as np
import pytest
from tests.bench.conftest import pressure

from pliant.errors import UserError
from pliant_bench.bench import RunStoppedError
from pliant_bench.clock import AcceleratedClock
from pliant_bench.drivers.line_config import SerialConfig, SocketConfig
from pliant_bench.drivers.line_protocol import decode, encode
from pliant_bench.drivers.socket_line import SocketBench
from pliant_bench.emulator import Emulator
from pliant_bench.ramps import shaped
from pliant_bench.watchdog import Watchdog, WatchdogConfig

pytest.importorskip("serial")
from tests.bench.mangled_benches import MangledSerial, MangledSocket

from pliant_bench.drivers.serial_line import SerialBench

NEEDS_A_QUIET_COMPUTER = pytest.mark.skipif(
    os.getloadavg()[0] > 2 * (os.cpu_count() or 1), reason="the computer is too busy for real time"
)
DAMPING_N_M_S = 0.3 * 0.0245


@pytest.fixture
def serial_bench(emulator_program, tmp_path):
    """Return a function that connects a bench to an emulated microcontroller, whose time passes with each line."""
    opened = []

    def connected(kind=SerialBench, step_ms=10):
        tcp = issubclass(kind, SocketBench)
        device = Emulator(emulator_program, tmp_path / "valve.log", step_ms=step_ms, tcp=tcp)
        # A good line on a busy computer may still be slow.
        timeout_s = 0.02 if kind in (MangledSerial, MangledSocket) else 0.3
        config = (SocketConfig if tcp else SerialConfig)(port=device.port, timeout_s=timeout_s)
        bench = kind(config)
        if step_ms:
            bench.clock = AcceleratedClock()
        bench.device = device
        opened.append(bench)
        if tcp:
            threading.Thread(target=device.accept).start()
        bench.connect()
        return bench

    yield connected
    for bench in opened:
        bench.close()
        bench.device.close()


def angle_of(device, instants_s):
    """Return the angle of the finger at instants of CLOCK_MONOTONIC, from the log of the valve."""
    times, values = device.valve()
    grid = np.arange(times[0], instants_s[-1] + 0.01, 0.001)
    valve = values[np.maximum(np.searchsorted(times, grid, side="right") - 1, 0)]
    angles, angle = np.empty(len(grid)), 0.0
    for k, value in enumerate(valve):
        pushed = 1.637e-6 * value - 1.704e-6 * value * angle
        angle += 0.001 * (pushed - 0.0506 * angle * abs(angle) - 0.0245 * angle) / DAMPING_N_M_S
        angles[k] = angle
    return np.interp(instants_s, grid, angles)


@pytest.mark.parametrize("kind", [SerialBench, SocketBench])
def test_a_run_over_a_good_line(serial_bench, hill, unwatched, kind):
    bench = serial_bench(kind)
    assert [c.name for c in (*bench.inputs, *bench.outputs)] == ["pressure_pa", "angle_rad"]
    assert (bench.inputs[0].limits.high, bench.inputs[0].limits.rate) == (15e3, 20e3)
    assert not any(one.problem for one in bench.check())
    protocol = hill(8e3, 2.0)
    done = bench.run(protocol, unwatched)
    # The valve is read when it begins to move to the new command: it is where the last one sent it.
    before = np.concatenate([[0.0], protocol.commands["pressure_pa"][:-1]])
    assert done.commands["pressure_pa"] == pytest.approx(before, abs=0.01)
    assert done.ending == "complete" and done.readings["angle_rad"].max() == pytest.approx(0.25, abs=0.02)
    assert bench.device.valve()[1][-1] == 0.0


@pytest.mark.parametrize("kind", [MangledSerial, MangledSocket])
def test_no_sample_is_an_old_one_on_a_bad_line(serial_bench, kind):
    bench, device_s = serial_bench(kind), []
    raw = np.repeat(np.random.default_rng(5).uniform(0, 12e3, 9), 30)
    done = bench.run(shaped(pressure(raw), bench.inputs), lambda sample: device_s.append(bench._device_s))
    assert done.ending == "complete" and min(bench.mangler.mangled.values()) > 15
    read = done.readings["angle_rad"]
    is_read = np.isfinite(read)
    assert is_read.mean() > 0.5
    read_s = np.array(device_s)[is_read]
    # A line that comes to the microcontroller takes 10 ms of its time: each sample has a reading of its own.
    assert np.diff(read_s).min() >= 0.0099
    assert np.abs(read[is_read] - angle_of(bench.device, read_s)).max() < 2e-3


@pytest.mark.slow
@NEEDS_A_QUIET_COMPUTER
@pytest.mark.parametrize("kind", [MangledSerial, MangledSocket])
def test_no_sample_is_wrong_silently_on_a_bad_line(serial_bench, kind):
    bench, starts = serial_bench(kind, step_ms=0), []
    raw = np.repeat(np.random.default_rng(5).uniform(0, 12e3, 9), 40)
    protocol = shaped(pressure(raw), bench.inputs)

    def watch(sample):
        if np.isfinite(sample.readings.get("angle_rad", np.nan)):
            starts.append(time.monotonic() - bench.age_s - sample.read_s)

    done = bench.run(protocol, watch)
    assert done.ending == "complete" and len(done) == len(protocol)
    assert min(bench.mangler.mangled.values()) > 15
    read = done.readings["angle_rad"]
    is_read = np.isfinite(read)
    assert is_read.mean() > 0.5
    # The finger moves by up to 0.5 rad/s: a reading that were 20 ms old would be wrong by 10 mrad.
    instants_s = min(starts) + done.read_s[is_read]
    true = angle_of(bench.device, instants_s)
    times, values = bench.device.valve()
    valve = values[np.searchsorted(times, instants_s, side="right") - 1]
    # So is the pressure, within 6 ms at 20 kPa/s: 20 ms would be 400 Pa.
    assert np.abs(done.commands["pressure_pa"][is_read] - valve).max() < 120
    assert np.abs(read[is_read] - true).max() < 2.5e-3


def test_limits_hold_on_a_bad_line(serial_bench):
    bench = serial_bench(MangledSerial)
    raw = np.tile([0.0, 12e3], 10).repeat(10)
    bench.run(shaped(pressure(raw), bench.inputs), lambda sample: None)
    times, values = bench.device.valve()
    steps, gaps = np.diff(values), np.diff(times)
    up = steps > 0
    assert values.max() <= 15e3 and values.min() >= 0.0
    assert (steps[up] <= 20e3 * (gaps[up] + 0.001) * 1.001).all()


def test_a_line_that_dies_is_silence_and_the_microcontroller_vents_itself(serial_bench, hill):
    bench = serial_bench(MangledSerial, step_ms=0)
    protocol = hill(8e3, 4.0)
    watchdog = Watchdog(protocol, WatchdogConfig(1.0))

    def watch(sample):
        if sample.index == 100:
            bench.mangler._share = 1e-9
            bench.mangler._mangle = lambda line, queue: None  # nothing gets through any more
        watchdog(sample)

    done = bench.run(protocol, watch)
    assert done.ending == "lost" and done.reason.startswith("No reading came for 1.")
    assert done.reason.endswith("could not be vented (the microcontroller does not answer): vent it by hand.")
    time.sleep(0.6)
    assert bench.device.valve()[1][-1] == 0.0


def test_a_bench_that_vented_by_itself_is_not_filled_again(serial_bench, hill):
    bench = serial_bench(step_ms=0)

    def watch(sample):
        if sample.index == 100:
            time.sleep(0.7)

    done = bench.run(hill(8e3, 4.0), watch)
    assert done.ending == "stopped" and "vented because no line came" in done.reason
    assert bench.device.valve()[1][-1] == 0.0
    assert bench.run(hill(1e3, 1.0), lambda sample: None).ending == "complete"


def test_a_run_with_longer_intervals_than_the_silence_is_refused(serial_bench, unwatched):
    bench = serial_bench()
    with pytest.raises(
        UserError, match=r"leaves 0.3 s between two samples; .* vents after 0.5 s without a line"
    ):
        bench.run(pressure([0, 0, 0], period_s=0.3), unwatched)


def test_commands_outside_the_range_of_the_microcontroller_are_refused_by_it(serial_bench):
    bench = serial_bench()
    with pytest.raises(RunStoppedError, match="outside its range"):
        bench.exchange({"pressure_pa": 15.1e3})
    with pytest.raises(RunStoppedError, match="could not read"):
        bench.exchange({"pressure_pa": np.nan})
    assert bench.device.valve()[1].max() == 0.0


def test_the_microcontroller_keeps_its_rate_whatever_it_is_sent(serial_bench):
    bench = serial_bench()
    for value in (15e3, 0.0):
        for _ in range(30):
            bench.exchange({"pressure_pa": value})
    times, values = bench.device.valve()
    moving = np.flatnonzero(np.diff(values))
    rates = np.abs(np.diff(values)[moving]) / (np.diff(times)[moving] + 0.001)
    assert values.max() > 4e3 and rates.max() <= 20e3 * 1.001


def test_a_microcontroller_that_restarts_is_noticed(serial_bench, hill, emulator_program, tmp_path):
    first = serial_bench()
    first.run(hill(2e3, 1.0), lambda sample: None)
    with Emulator(emulator_program, tmp_path / "other.log", step_ms=10) as second:

        def watch(sample):
            if sample.index == 50:  # another one answers, whose clock is at its start
                other = SerialBench(SerialConfig(port=second.port))
                other.connect()
                first._client, other._client = other._client, first._client

        done = first.run(hill(2e3, 1.0), watch)
    assert done.ending == "stopped" and "has restarted" in done.reason


def test_a_microcontroller_without_a_hello_refuses_to_follow(emulator_program, tmp_path):
    with Emulator(emulator_program, tmp_path / "valve.log") as device:
        bench = SerialBench(SerialConfig(port=device.port))
        bench.connect()
        client = bench._client
        assert client.ask("X 0 100")[0] == "X"
        assert client.ask("Q")[:2] == ["E", "request"] and client.ask("I 9")[:2] == ["E", "channel"]
        bench.close()


def test_a_missing_port_is_a_sentence(tmp_path):
    with pytest.raises(
        UserError, match=r"serial port /dev/nothing cannot be opened: .*bench: \{kind: serial"
    ):
        SerialBench(SerialConfig(port="/dev/nothing")).connect()
    with pytest.raises(UserError, match=r"Nothing answers at 127.0.0.1:1 .*kind: socket"):
        SocketBench(SocketConfig(port=1)).connect()


def test_something_else_on_the_port_is_a_sentence(tmp_path):
    controller, terminal = pty.openpty()
    tty.setraw(terminal)
    config = SerialConfig(port=os.ttyname(terminal), start_s=0.1)
    with pytest.raises(UserError, match="does not answer; is the sketch"):
        SerialBench(config).connect()
    os.close(controller)
    os.close(terminal)


def test_closing_twice_and_without_connecting_is_allowed(serial_bench):
    bench = serial_bench()
    bench.close()
    bench.close()
    SocketBench(SocketConfig(port=1)).close()


class Wrong(SerialBench):
    """A bench behind a line whose answers a table gives."""

    answers: dict[str, str]

    def open_line(self):
        return Scripted(self.answers)


class Scripted:
    """A line that answers by the kind of the request."""

    def __init__(self, answers):
        self.answers, self.waiting = answers, b""

    def write(self, data):
        number, body = decode(data[:-1])
        self.waiting += encode(number, self.answers[body[0]])

    def read(self):
        data, self.waiting = self.waiting, b""
        return data

    def close(self):
        pass


GOOD = {
    "H": "H 1 scripted 1 1 500",
    "I": "I pressure_pa 0 0 15000 20000",
    "O": "O angle_rad -1 1",
    "X": "X 5 0 0.25",
    "V": "V 5",
}


def scripted(**answers):
    bench = Wrong(SerialConfig(port="scripted", start_s=0.1))
    bench.answers = {**GOOD, **answers}
    return bench


@pytest.mark.parametrize(
    ("answers", "says"),
    [
        ({"H": "H 2 other 1 1 500"}, "another version of the line protocol than 1"),
        ({"H": "H 1 other one 1 500"}, "states a channel or a limit that is no number"),
        ({"I": "I pressure_pa 0 low 15000 20000"}, "states a channel or a limit that is no number"),
        ({"O": "E channel"}, r"does not state its channels \(O 0\)"),
    ],
)
def test_a_sketch_that_states_nonsense_is_a_users_error(answers, says):
    with pytest.raises(UserError, match=says):
        scripted(**answers).connect()


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        ("X 5 0", "another number of values than it has channels"),
        ("X 5 0 half", "answered 'X 5 0 half', without numbers"),
        ("X 5 16000 0.25", "set pressure_pa to 16000, outside its own range"),
        ("E silence", "vented because no line came"),
        ("E hello", "has restarted, and is vented"),
        ("E other", r"refused a command \(other\)"),
    ],
)
def test_a_sketch_that_answers_nonsense_ends_the_run(answer, says):
    bench = scripted(X=answer)
    bench.connect()
    with pytest.raises(RunStoppedError, match=says):
        bench.exchange({"pressure_pa": 0.0})


def test_a_reading_that_the_sensor_does_not_give_is_nan():
    bench = scripted(X="X 5 0 nan")
    bench.connect()
    assert np.isnan(bench.exchange({"pressure_pa": 0.0})["angle_rad"])
