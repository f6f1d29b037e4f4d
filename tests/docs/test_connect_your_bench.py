"""The drivers, the study and the lines of connect_your_bench.md, copied unchanged."""

import re
import shutil
import socketserver
import sys
import threading
import types
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.docs.pages import blocks, commands, page_text, run

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant.registry.files import with_files
from pliant.testing import run_checks
from pliant_bench.clock import AcceleratedClock
from pliant_bench.conformance_runs import small_run
from pliant_bench.drivers.line_bench import REFUSALS
from pliant_bench.emulator import SOURCES, Emulator, compile_emulator
from pliant_bench.emulator import main as emulator_main

PAGE = page_text("connect_your_bench")
MINIMAL, ROS2 = blocks(PAGE, "python")


class Instruments(socketserver.StreamRequestHandler):
    """The pressure controller and the angle sensor of the page."""

    pressure_pa = 0.0

    def handle(self):
        for line in self.rfile:
            for command in line.decode().strip().split(";"):
                if command == "MEAS:ANG?":
                    self.wfile.write(b"%.6f\n" % (4e-5 * self.pressure_pa))
                else:
                    self.pressure_pa = float(command.removeprefix("SOUR:PRES "))


@pytest.fixture
def rig():
    """Return the TCP port of the instruments."""
    server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Instruments)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_address[1]
    server.shutdown()
    server.server_close()


def component(folder, text, kind):
    file = folder / f"{kind}.py"
    file.write_text(text, encoding="utf-8")
    (found,) = [one for one in with_files(discover(), [file]).components if one.kind == kind]
    return found


def test_the_minimal_driver_has_forty_lines():
    assert len([line for line in MINIMAL.splitlines() if line.strip()]) <= 40


def test_the_minimal_driver_passes_the_conformance_suite(rig, tmp_path):
    outcomes = run_checks(component(tmp_path, MINIMAL, "rig"), changes={"port": rig})
    assert [one.message for one in outcomes if one.status != "passed"] == []


def test_the_minimal_driver_says_where_no_rig_answers(tmp_path):
    found = component(tmp_path, MINIMAL, "rig")
    with pytest.raises(UserError, match="The rig does not answer on port 1"):
        found.build(found.config_model()(port=1)).connect()


@pytest.fixture
def ros2(monkeypatch):
    """Stand-ins for ROS 2: a robot that answers each command with its angle."""
    state = SimpleNamespace(callback=None, waiting=[])

    class Node:
        def create_publisher(self, kind, topic, depth):
            return SimpleNamespace(publish=lambda m: state.waiting.append(4e-5 * m.data))

        def create_subscription(self, kind, topic, callback, depth):
            state.callback = callback
            state.waiting.append(0.0)

        def destroy_node(self):
            return None

    class Executor:
        def add_node(self, node):
            pass

        def spin_once(self, timeout_sec):
            if state.waiting:
                state.callback(SimpleNamespace(position=[state.waiting.pop(0)]))

    modules = {
        "rclpy": {"init": lambda: None, "create_node": lambda name: Node(), "shutdown": lambda: None},
        "rclpy.executors": {"SingleThreadedExecutor": Executor},
        "sensor_msgs.msg": {"JointState": object},
        "std_msgs.msg": {"Float64": lambda data: SimpleNamespace(data=data)},
    }
    for name, members in modules.items():
        module = types.ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    return state


def test_the_driver_of_ros_2_performs_a_run(ros2, tmp_path):
    file = tmp_path / "ros2.py"
    file.write_text(ROS2, encoding="utf-8")
    space = {"__name__": "ros2_driver"}
    exec(compile(ROS2, str(file), "exec"), space)
    bench = space["Ros2Bench"](space["Ros2Config"]())
    bench.close()
    bench.connect()
    bench.clock = AcceleratedClock()
    done = bench.run(small_run(bench), lambda sample: ros2.waiting.clear())
    assert done.ending == "complete"
    assert done.readings["angle_rad"] == pytest.approx(4e-5 * done.commands["pressure_pa"])
    ros2.waiting.clear()
    with pytest.raises(UserError, match="is the robot on"):
        bench.config = bench.config.model_copy(update={"angle_topic": "/silent"})
        ros2.callback = lambda message: None
        bench.angle_within = lambda wait_s: float("nan")
        bench.connect()


def test_the_complete_study_is_valid(tmp_path):
    (tmp_path / "my_finger.yaml").write_text(blocks(PAGE, "yaml")[0])
    study = load_study(tmp_path / "my_finger.yaml", discover())
    assert study.block("experiment").inputs["pressure_pa"].limits("pressure_pa").high == 12e3
    assert study.block("bench").port == "/dev/ttyACM0"
    for block in (
        "surrogate",
        "law_error",
        "chain",
        "bench",
        "inputs",
        "outputs",
        "period",
        "set_up_minutes",
        "minutes",
    ):
        assert re.search(rf"^\| .*`{block}`.* \|", PAGE, re.M)  # says where its numbers come from


def test_the_complete_study_plans_its_first_run_on_the_emulated_microcontroller(tmp_path, monkeypatch):
    pytest.importorskip("serial")
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_finger.yaml").write_text(blocks(PAGE, "yaml")[0])
    (dry_run,) = [one for one in commands(PAGE) if one.startswith("experiment my_finger.yaml --dry-run")]
    with Emulator(compile_emulator(tmp_path), tmp_path / "valve.log") as device:
        said = run(dry_run, f"bench.port={device.port}")
        assert device.valve()[1].max(initial=0.0) == 0.0
    assert "The model assumes no gravity" in said and "nothing was moved" in said and "8.4 kPa" in said


def test_the_emulator_tells_its_options_and_starts_nothing(monkeypatch, capsys):
    monkeypatch.setattr("pliant_bench.emulator.compile_emulator", lambda folder: pytest.fail("it starts"))
    for words, code in ((["--help"], 0), (["--tpc"], 2)):
        with pytest.raises(SystemExit) as ended:
            emulator_main(words)
        assert ended.value.code == code
    said = capsys.readouterr()
    assert "--tcp" in said.out and "unrecognized arguments: --tpc" in said.err


def test_the_commands_of_the_page_exist(tmp_path, monkeypatch, rig):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.py").write_text(MINIMAL.replace("5025", str(rig)))
    (example,) = [one for one in commands(PAGE) if one.startswith("example")]
    run(example)
    (experiment,) = [one for one in commands(PAGE) if one.startswith("experiment emulated-bench")]
    assert load_study(Path(experiment.split()[1]), discover()).block("bench").kind == "serial"
    (check,) = [one for one in commands(PAGE) if one.startswith("check bench rig")]
    assert "1 passed, 0 failed" in run(check, "--clause", "checks_every_channel")


def test_every_refusal_and_request_of_the_sketch_is_documented():
    sketch = (SOURCES / "pliant_bench.c").read_text()
    refusals = set(re.findall(r'refuse\(sequence, "(\w+)"\)', sketch)) | {"hello", "silence"}
    row = next(line for line in PAGE.splitlines() if line.startswith("| any |"))
    assert refusals == set(re.findall(r"`(\w+)`", row.split("refused:")[1])) - {"V", "H"}
    assert set(REFUSALS) <= refusals
    for kind in "HIOXSV":
        assert re.search(rf"^\| `{kind}[ `]", PAGE, re.M)


def test_the_constants_of_the_sketch_are_those_of_the_page():
    sketch = (SOURCES / "pliant_bench.ino").read_text()
    for line in re.findall(r"^const pliant_\w+ .*;", PAGE, re.M):
        assert line in sketch
