"""The experiment on the terminal: a line per step, and during a run commands, readings and expected readings."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import typer

from pliant.cli.session import Session
from pliant.formatting import listed, output_unit, plural, whole_percent
from pliant_bench.bench import BenchProtocol, BenchSample
from pliant_bench.loop.fit_progress import IMPROVING, FitProgress
from pliant_bench.loop.folder import RoundFolder
from pliant_bench.loop.person import Person, words
from pliant_bench.loop.view import View
from pliant_bench.watchdog import Expectation

# Seconds between two updates of the line.
EVERY_S = 0.1
# The same without a terminal.
SAID_EVERY_S = 15.0
MOST_SHOWN = 3


class TerminalView(View):
    """Lines of a verb's session; the live line is on standard error, and only on a terminal."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._live = session.err.is_terminal and not session.quiet
        self._protocol: BenchProtocol | None = None
        self._expected: Expectation | None = None
        self._shown_s, self._said_s = -math.inf, -math.inf

    def planned(self, folder: RoundFolder, plan: Mapping[str, Any]) -> None:
        """Print the run and why it was chosen."""
        nats = plan["expected_nats"]
        gain = "" if nats is None else f"; expected {bits(nats)}"
        self._session.say(f"run {folder.number}: {plan['words']} ({plan['minutes']:.2g} min{gain})")
        self._session.say(f"  {plan['why']}")

    def begins(self, protocol: BenchProtocol, expected: Expectation | None) -> None:
        """Keep what the live line compares with."""
        self._protocol, self._expected, self._shown_s = protocol, expected, -math.inf

    def sample(self, sample: BenchSample) -> None:
        """Rewrite the live line, ten times a second at most."""
        now = time.monotonic()
        if not self._live or self._protocol is None or now - self._shown_s < EVERY_S:
            return
        self._shown_s = now
        done = self._protocol.time_s[sample.index] / max(self._protocol.duration_s, 1e-9)
        parts = [f"{whole_percent(float(done))} of {self._protocol.duration_s:.3g} s"]
        parts += [words(name, value) for name, value in sample.commands.items()]
        parts += [self._reading(name, value, sample.index) for name, value in sample.readings.items()]
        self._write("  " + ", ".join(parts[: 1 + 2 * MOST_SHOWN]))

    def recorded(self, folder: RoundFolder, recording: Mapping[str, Any]) -> None:
        """Print how the run ended."""
        self._clear()
        late = f", {plural(len(recording['late']), 'late sample')}" if recording["late"] else ""
        self._session.say(f"  {plural(recording['samples'], 'sample')} recorded{late}")
        if recording["ending"] != "complete":
            self._session.say(f"  {recording['ending']}: {recording['reason']}")
            self._session.say(f"  {recording['words']}")

    def reconnecting(self, folder: RoundFolder) -> None:
        """Print that the connection is opened again."""
        self._session.say("  connecting again …")

    def fitting(self, progress: FitProgress) -> None:
        """Rewrite the live line; without one, print the progress of an improvement at intervals."""
        now = time.monotonic()
        if self._live and now - self._shown_s >= EVERY_S:
            self._shown_s = now
            self._write(f"  {progress.words}")
        elif not self._live and progress.doing == IMPROVING and now - self._said_s >= SAID_EVERY_S:
            self._said_s = now
            self._session.say(f"  {progress.words}")

    def improved(self) -> None:
        """Clear the live line."""
        self._clear()

    def diagnosed(self, folder: RoundFolder, verdict: Mapping[str, Any]) -> None:
        """Print the verdict."""
        self._clear()
        gained = verdict["obtained_nats"]
        gain = "" if gained is None else f" (obtained {bits(gained)})"
        self._session.say(f"  {verdict['sentence']}{gain}")

    def _reading(self, name: str, value: float, index: int) -> str:
        text = words(name, value)
        if self._expected is None or name not in self._expected.mean:
            return text
        mean, sd = float(self._expected.mean[name][index]), float(self._expected.sd[name][index])
        if not np.isfinite(mean):
            return text
        unit = output_unit(name)
        return f"{text} (expected {unit.text(mean, 3)} ± {unit.text(sd, 2)})"

    def _write(self, line: str) -> None:
        width = max(self._session.err.width - 1, 20)
        self._session.err.file.write("\r" + line[:width].ljust(width))
        self._session.err.file.flush()

    def _clear(self) -> None:
        if self._live:
            self._write("")
            self._session.err.file.write("\r")


class TerminalPerson(Person):
    """Somebody at the keyboard."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def set_conditions(self, changes: Mapping[str, float], new_specimen: bool) -> None:
        """Print what to set, and wait for Enter."""
        todo = [words(name, value) for name, value in changes.items()]
        todo += ["a new specimen, never loaded before"] if new_specimen else []
        self._session.err.print(f"Please set: {listed(todo)}.", markup=False)
        typer.prompt("Press Enter when it is done", default="", show_default=False, err=True)

    def confirm(self, question: str) -> bool:
        """Ask on standard error; anything but "y" or "yes" is no."""
        answer = typer.prompt(f"{question} Type yes to begin", default="no", err=True)
        return str(answer).strip().lower() in ("y", "yes")


def bits(nats: float) -> str:
    """Return information in bits, as text."""
    return f"{round(nats / math.log(2.0), 2) + 0.0:.2f} bit"
