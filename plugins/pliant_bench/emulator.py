"""The microcontroller of `microcontroller/`, compiled for this computer, behind a pseudo-terminal or a TCP port.

``python -m pliant_bench.emulator`` starts one and prints the block `bench` for it; Ctrl-C ends it. It needs a C
compiler and a POSIX system.
"""

from __future__ import annotations

import argparse
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from importlib import resources
from pathlib import Path
from types import TracebackType

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array

SOURCES = resources.files("pliant_bench") / "microcontroller"


def compile_emulator(folder: Path) -> Path:
    """Return the program, compiled into a folder; raise `UserError` without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        raise UserError("The emulated microcontroller needs a C compiler; install gcc or clang.")
    program = folder / "emulator"
    with resources.as_file(SOURCES) as sources:
        files = [str(sources / name) for name in ("emulator.c", "pliant_bench.c")]
        command = [compiler, "-std=c99", "-D_DEFAULT_SOURCE", "-O2", *files, "-o", str(program), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UserError(f"The emulated microcontroller does not compile: {done.stderr.strip()}")
    return program


class Emulator:
    """A running emulated microcontroller; a context manager that ends it.

    Args:
        program: of `compile_emulator`.
        log: file for the valve.
        step_ms: 0 for real time; else time passes by so much at each line.
        tcp: whether it is behind a TCP port instead of a pseudo-terminal.

    Attributes:
        port: name of the serial port, or number of the TCP port.
    """

    def __init__(self, program: Path, log: Path, step_ms: int = 0, tcp: bool = False) -> None:
        self.log = log
        self._command = [str(program), str(log), str(step_ms)]
        self._processes: list[subprocess.Popen[bytes]] = []
        self._terminal: int | None = None
        self._listener: socket.socket | None = None
        self.port = self._listen() if tcp else self._open_terminal()

    def __enter__(self) -> Emulator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def is_running(self) -> bool:
        """Return whether the program runs."""
        return any(process.poll() is None for process in self._processes)

    @property
    def process_ids(self) -> list[int]:
        """Return the numbers of the processes that were started."""
        return [process.pid for process in self._processes]

    def accept(self) -> None:
        """Wait for a TCP connection, which becomes the line."""
        assert self._listener is not None
        connection, _ = self._listener.accept()
        with connection:
            self._start(connection.fileno())

    def valve(self) -> tuple[Array, Array]:
        """Return the times in seconds, of CLOCK_MONOTONIC in real time, and pressures of all changes of the valve."""
        values = " ".join(row for row in self._rows() if not row.startswith("#")).split()
        table: Array = np.array(values, float).reshape(-1, 2)
        return table[:, 0] / 1000, table[:, 1]

    def pauses(self) -> tuple[Array, Array]:
        """Return the ends and durations, in seconds, of the times in which this computer did not run the program."""
        rows = [row.split()[2:] for row in self._rows() if row.startswith("# late")]
        table: Array = np.array(rows, float).reshape(-1, 2)
        return table[:, 0] / 1000, table[:, 1] / 1000

    def _rows(self) -> list[str]:
        """Return the lines of the log that are complete."""
        complete, _, _ = self.log.read_text().rpartition("\n")
        return complete.splitlines()

    def close(self) -> None:
        """End the program."""
        for process in self._processes:
            process.terminate()
            process.wait()
        if self._listener is not None:
            self._listener.close()
        if self._terminal is not None:
            os.close(self._terminal)
            self._terminal = None

    def _start(self, line: int) -> None:
        self._processes.append(subprocess.Popen(self._command, stdin=line, stdout=line))

    def _open_terminal(self) -> str:
        import pty
        import tty

        controller, terminal = pty.openpty()
        tty.setraw(terminal)
        name = os.ttyname(terminal)
        self._start(controller)
        os.close(controller)
        # The terminal stays open here, so that it outlives the programs that use it.
        self._terminal = terminal
        return name

    def _listen(self) -> str:
        self._listener = socket.create_server(("127.0.0.1", 0))
        return str(self._listener.getsockname()[1])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run an emulated microcontroller until Ctrl-C."""
    parser = argparse.ArgumentParser(
        prog="python -m pliant_bench.emulator",
        description="Start the sketch of docs/connect_your_bench.md on this computer, with a finger of one joint "
        "behind a pseudo-terminal, and print the block 'bench' of a study for it. Ctrl-C ends it.",
    )
    parser.add_argument("--tcp", action="store_true", help="behind a TCP port instead of a pseudo-terminal")
    is_tcp = parser.parse_args(arguments).tcp
    with tempfile.TemporaryDirectory() as parent, suppress(KeyboardInterrupt):
        folder = Path(parent)
        program = compile_emulator(folder)
        with Emulator(program, folder / "valve.log", tcp=is_tcp) as emulator:
            kind = "socket" if is_tcp else "serial"
            print(f"bench: {{kind: {kind}, port: {emulator.port}}}", flush=True)
            while is_tcp:  # one connection after the other
                emulator.accept()
            while emulator.is_running:
                time.sleep(0.2)


if __name__ == "__main__":
    main()
