"""A command line to call in-process, and studies for it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.command import called

STATED = """\
pliant: 1
name: stated
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 8, module_length: 11 mm, gravity: [0, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa}
"""
FINGER = """\
pliant: 1
name: finger
family:
  kind: bellow_bending
  inner_radius: 2 mm
  average_radius: 6 mm
  wall: 1.5 mm
  module_length: 11 mm
material: {kind: neo_hookean, shear_modulus: 240 kPa}
fem: {kind: skfem, pressure_max: 15 kPa, pressures: 3, angles: 3, check_states: 2}
chain: {modules: 4}
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa}
"""


def interrupted(arguments, working):
    """Start the command, press Ctrl-C once `working()` is true, and check that it and its workers end correctly."""
    command = [sys.executable, "-m", "pliant", *map(str, arguments)]
    process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE)
    until = time.monotonic() + 120
    while not working():
        assert time.monotonic() < until
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the signal reaches the workers too
    said = process.communicate(timeout=150)[1].decode()  # loaded machines start their workers slowly
    assert process.returncode == 130, said
    assert "finished work is kept, run the same command to continue" in said and "Traceback" not in said
    with pytest.raises(ProcessLookupError):
        for _ in range(200):
            os.killpg(process.pid, 0)
            time.sleep(0.05)


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """Return an empty working folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    return tmp_path


@pytest.fixture
def pliant(workplace):
    """Return a function that calls the command; a traceback fails the test."""

    return called


@pytest.fixture
def run_json(pliant):
    """Return a function that calls the command, checks its exit code and returns its JSON."""

    def call(*arguments, code=0):
        pliant(*arguments, "--json", "result.json").done(code)
        return json.loads(Path("result.json").read_text())

    return call


@pytest.fixture
def write(workplace):
    """Return a function that writes a study and returns its path."""

    def writer(text, name="study.yaml"):
        path = workplace / name
        path.write_text(text)
        return path

    return writer


@pytest.fixture
def read():
    """Return a function that reads a JSON result."""
    return lambda path: json.loads(Path(path).read_text())


@pytest.fixture
def stated():
    return STATED


@pytest.fixture
def finger():
    return FINGER
