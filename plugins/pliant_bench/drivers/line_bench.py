"""Benches that speak the line protocol, over whatever carries the lines."""

from __future__ import annotations

import math
import secrets
import time
from abc import abstractmethod
from collections.abc import Mapping

import numpy as np

from pliant.errors import UserError
from pliant_bench.bench import (
    BenchChannel,
    BenchProtocol,
    BenchRecording,
    ChannelLimits,
    ConnectionLostError,
    RunStoppedError,
    Watch,
)
from pliant_bench.drivers.line_config import LineBenchConfig
from pliant_bench.drivers.line_protocol import Line, LineClient, LineCounts
from pliant_bench.sampled import SampledBench

VERSION = "1"
# Venting is asked for this long, and this often, before it counts as failed.
VENT_S, VENT_ATTEMPTS = 0.5, 5
# The clock of a microcontroller may be wrong by this share.
CLOCK_DRIFT = 1e-3
# A clock that goes back by more than this has restarted.
CLOCK_BACK_S = 0.005
REFUSALS = {
    "hello": "The microcontroller has restarted, and is vented.",
    "silence": "The microcontroller vented because no line came to it for the time that its sketch states.",
    "range": "The microcontroller refused a command outside its range.",
    "values": "The microcontroller could not read a command.",
}


class LineBench(SampledBench):
    """A bench behind the line protocol; its channels and limits are those that the microcontroller states.

    The microcontroller moves a valve to its command in a straight line that takes one sampling period, and reports its
    position, which is recorded: the path is that of the protocol, one period later, without steps.
    """

    config: LineBenchConfig

    def __init__(self, config: LineBenchConfig) -> None:
        super().__init__(config)
        self._vent_attempts = max(VENT_ATTEMPTS, math.ceil(VENT_S / config.timeout_s))
        self.stall_s = 1.0 + 2 * self._vent_attempts * config.timeout_s
        self._client: LineClient | None = None
        self._inputs: tuple[BenchChannel, ...] = ()
        self._outputs: tuple[BenchChannel, ...] = ()
        self._sent: dict[str, float] = {}
        self._move_s = 0.0
        self._silence_s = np.inf
        self._device_s = -np.inf
        self._offset_s = np.inf

    @abstractmethod
    def open_line(self) -> Line:
        """Open the connection; raise `UserError` if this is not possible."""

    @property
    @abstractmethod
    def address(self) -> str:
        """Return where the bench is, for messages."""

    @property
    def inputs(self) -> tuple[BenchChannel, ...]:
        return self._inputs

    @property
    def outputs(self) -> tuple[BenchChannel, ...]:
        return self._outputs

    @property
    def counts(self) -> LineCounts:
        """Return what happened on the line since `connect`."""
        return self._connected().counts

    def connect(self) -> None:
        self.close()
        config = self.config
        self._device_s, self._offset_s = -np.inf, np.inf
        self._client = LineClient(self.open_line(), config.timeout_s, config.attempts)
        try:
            inputs, outputs = self._hello()
            self._inputs = tuple(_input(self._describe(f"I {k}", 6)) for k in range(inputs))
            self._outputs = tuple(_output(self._describe(f"O {k}", 4)) for k in range(outputs))
        except OSError as error:
            self.close()
            raise UserError(
                f"The connection to {self.address} was lost ({error.strerror or error})."
            ) from None
        except ValueError:
            self.close()
            raise UserError(
                f"The bench at {self.address} states a channel or a limit that is no number; compare its answers with "
                "the line protocol in docs/connect_your_bench.md."
            ) from None
        except (UserError, KeyboardInterrupt):
            self.close()
            raise

    def reconnect(self) -> bool:
        """Connect again, as often and with the wait that the config states; the microcontroller vents meanwhile.

        Raises:
            UserError: a bench with other channels answers.
        """
        before = (self._inputs, self._outputs)
        for _ in range(self.config.reconnect_attempts):
            time.sleep(self.config.reconnect_s)
            try:
                self.connect()
            except (UserError, OSError, RunStoppedError):
                continue
            if (self._inputs, self._outputs) != before:
                raise UserError(
                    f"Another bench answers at {self.address} after the lost connection: its channels differ."
                )
            return True
        return False

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        longest_s = float(np.diff(protocol.time_s).max(initial=0.0))
        if longest_s > 0.5 * self._silence_s:
            raise UserError(
                f"Run '{protocol.name}' leaves {longest_s:g} s between two samples; the microcontroller vents after "
                f"{self._silence_s:g} s without a line; sample every {0.5 * self._silence_s:g} s at least."
            )
        self._move_s = longest_s
        try:
            return super().run(protocol, watch)
        finally:
            self._move_s = 0.0

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        client = self._connected()
        values = " ".join(f"{commands[channel.name]:.9g}" for channel in self._inputs)
        answer = client.ask(f"X {round(1000 * self._move_s)} {values}")
        before, self._sent = self._sent, dict(commands)
        if answer is None:  # the valves are, as far as is known, where they were sent before
            self.age_s, self.set_age_s = 0.0, None
            return before
        if answer[0] == "E":
            raise RunStoppedError(
                REFUSALS.get(answer[1], f"The microcontroller refused a command ({answer[1]}).")
            )
        try:
            device_ms, *numbers = (float(word) for word in answer[1:])
        except ValueError:
            raise RunStoppedError(
                f"The microcontroller answered '{' '.join(answer)}', without numbers."
            ) from None
        if len(numbers) != len(self._inputs) + len(self._outputs):
            raise RunStoppedError(
                "The microcontroller answered with another number of values than it has channels."
            )
        self._check_applied(numbers)
        self._place_in_time(device_ms / 1000)
        names = [channel.name for channel in (*self._inputs, *self._outputs)]
        return dict(zip(names, numbers, strict=True))

    def vent(self) -> None:
        if self._client is None:
            return
        self._sent = {channel.name: channel.rest for channel in self._inputs}
        if self._client.ask("V", self._vent_attempts) is None:
            raise ConnectionLostError("The microcontroller does not answer.")

    def close(self) -> None:
        if self._client is None:
            return
        try:
            self.vent()
        except (OSError, RunStoppedError):
            pass  # its own silence vents it
        finally:
            self._client.close()
            self._client = None

    def _connected(self) -> LineClient:
        if self._client is None:
            raise ConnectionLostError("The bench is not connected.")
        return self._client

    def _hello(self) -> tuple[int, int]:
        """Return the numbers of inputs and outputs of a bench that has started and speaks this version."""
        answer = self._insist(f"H {secrets.randbelow(1 << 31)}")
        if answer is None:
            damaged = self.counts.damaged
            heard = f"sends {damaged} lines that cannot be read" if damaged else "does not answer"
            raise UserError(
                f"The bench at {self.address} {heard}; is the sketch of docs/connect_your_bench.md on the "
                "microcontroller, with the same baud rate?"
            )
        if answer[:2] != ["H", VERSION] or len(answer) != 6:
            raise UserError(
                f"The bench at {self.address} speaks another version of the line protocol than {VERSION}; load the "
                "sketch of this version of Pliant."
            )
        self._silence_s = float(answer[5]) / 1000
        return int(answer[3]), int(answer[4])

    def _describe(self, request: str, words: int) -> list[str]:
        answer = self._insist(request)
        if answer is None or len(answer) != words or answer[0] != request[0]:
            raise UserError(f"The bench at {self.address} does not state its channels ({request}).")
        return answer

    def _insist(self, request: str) -> list[str] | None:
        """Return the answer to a request that is repeated for as long as a microcontroller may take to start."""
        deadline_s = time.monotonic() + self.config.start_s
        while (answer := self._connected().ask(request, 1)) is None and time.monotonic() < deadline_s:
            pass
        return answer

    def _check_applied(self, numbers: list[float]) -> None:
        for channel, value in zip(self._inputs, numbers, strict=False):
            limits = channel.limits
            slack = 1e-5 * max(abs(limits.low), abs(limits.high))
            if not limits.low - slack <= value <= limits.high + slack:
                raise RunStoppedError(
                    f"The microcontroller set {channel.name} to {value:g}, outside its own range of [{limits.low:g}, "
                    f"{limits.high:g}]."
                )

    def _place_in_time(self, device_s: float) -> None:
        """Set the age of the readings from the microcontroller's clock; the fastest answer is the youngest.

        Raises:
            RunStoppedError: the microcontroller's clock went back.
        """
        if device_s < self._device_s - CLOCK_BACK_S:
            raise RunStoppedError("The clock of the microcontroller went back: it has restarted.")
        now_s = time.monotonic()
        passed_s = device_s - self._device_s if np.isfinite(self._device_s) else 0.0
        self._offset_s = min(self._offset_s + CLOCK_DRIFT * passed_s, now_s - device_s)
        self._device_s = device_s
        self.age_s = self.set_age_s = now_s - device_s - self._offset_s


def _input(words: list[str]) -> BenchChannel:
    rest, low, high, rate = (float(word) for word in words[2:])
    return BenchChannel(words[1], ChannelLimits(low, high, rate), rest)


def _output(words: list[str]) -> BenchChannel:
    return BenchChannel(words[1], ChannelLimits(float(words[2]), float(words[3])))
