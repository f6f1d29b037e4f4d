"""Benches whose inputs can be set, and whose outputs can be read, at any time: the loop that paces a run.

A driver writes `connect`, `inputs`, `outputs`, `exchange`, `vent` and `close`. The loop sends each command when it is
due, checks it against the limits once more, marks late samples, and vents however the run ends.
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from pliant.errors import UserError
from pliant_bench.bench import (
    Bench,
    BenchChannel,
    BenchConfig,
    BenchProtocol,
    BenchRecording,
    BenchSample,
    ChannelCheck,
    ConnectionLostError,
    Ending,
    RunStoppedError,
    Watch,
)
from pliant_bench.clock import Clock, RealClock
from pliant_bench.driver_thread import DriverThread, call_driver
from pliant_bench.limits import CommandGuard, check_protocol

CHECK_SAMPLES, CHECK_PERIOD_S = 5, 0.1
VENT_ATTEMPTS = 3
# `stop` waits this long for the run to vent.
STOP_S = 5.0
STOPPED = "The run was stopped by the user."


class SampledBench(Bench):
    """A bench that is paced sample by sample.

    Attributes:
        stall_s: the longest time that `exchange` and `vent` may take; an exchange that takes longer is given up and the
            bench is vented meanwhile, from another thread than the one that hangs. None runs them in the calling
            thread, for benches that cannot hang.
        age_s: how long before the return of `exchange` the outputs were read, where the driver knows it.
        set_age_s: the same of the inputs; None where they are set when `exchange` is called.
    """

    stall_s: float | None = 1.0
    age_s: float = 0.0
    set_age_s: float | None = None

    def __init__(self, config: BenchConfig) -> None:
        super().__init__(config)
        self.clock: Clock = RealClock()
        self._stopping = threading.Event()
        self._idle = threading.Event()
        self._idle.set()
        self._running_in: int | None = None

    @abstractmethod
    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        """Set every input and read every output once, SI; an output without a reading is NaN or missing.

        A bench that knows the present value of an input, such as a valve on its way, returns it as well; it is recorded
        in place of the command.

        Raises:
            ConnectionLostError: the bench no longer answers and will not again.
        """

    @abstractmethod
    def vent(self) -> None:
        """Set the inputs to rest at once; called before and after each run, maybe while `exchange` hangs."""

    def check(self) -> tuple[ChannelCheck, ...]:
        """Return the medians of a few slow readings at rest.

        Raises:
            UserError: the bench does not answer.
        """
        try:
            readings = self._readings_at_rest()
        except (OSError, RunStoppedError) as error:
            raise UserError(
                f"The handshake with the bench failed: {_cause(error)}. Switch it on and connect it."
            ) from None
        inputs = [ChannelCheck(channel.name, channel.rest) for channel in self.inputs]
        return (*inputs, *(_checked(channel, readings) for channel in self.outputs))

    def _readings_at_rest(self) -> list[Mapping[str, float]]:
        call_driver(self.stall_s, self.vent)
        rest = {channel.name: channel.rest for channel in self.inputs}
        readings: list[Mapping[str, float]] = []
        for _ in range(CHECK_SAMPLES):
            self.clock.sleep_until(self.clock.now() + CHECK_PERIOD_S)
            readings.append(call_driver(self.stall_s, partial(self.exchange, rest)))
        call_driver(self.stall_s, self.vent)
        return readings

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        """Perform the run and return its recording.

        Raises:
            UserError: the run is not allowed, or was ended by another error and the bench could not be vented.
            KeyboardInterrupt: and every other error of `watch`, after venting.
        """
        inputs = self.limited_inputs
        check_protocol(protocol, inputs)
        samples: list[BenchSample] = []
        self._stopping.clear()
        self._idle.clear()
        self._running_in = threading.get_ident()
        try:
            ending, reason = self._performed(protocol, inputs, watch, samples)
        except BaseException as error:
            if unvented := self._vent_surely():
                raise UserError(unvented) from error
            raise
        else:
            if unvented := self._vent_surely():
                ending, reason = "lost", f"{reason} {unvented}".strip()
        finally:
            self._running_in = None
            self._idle.set()
        return recorded(protocol, samples, self.outputs, ending, reason)

    def stop(self) -> None:
        """End the run and vent; return when it has vented."""
        self._stopping.set()
        if self._running_in == threading.get_ident():  # called by the watch: the loop vents after this sample
            return
        if self._idle.is_set():
            self.vent()
        else:
            self._idle.wait(STOP_S)

    def _performed(
        self,
        protocol: BenchProtocol,
        inputs: tuple[BenchChannel, ...],
        watch: Watch,
        samples: list[BenchSample],
    ) -> tuple[Ending, str]:
        """Perform the run up to its end, whatever ends it; return how and why it ended."""
        try:
            self._perform(protocol, inputs, watch, samples)
        except ConnectionLostError as lost:
            return "lost", str(lost)
        except RunStoppedError as stopped:
            return "stopped", str(stopped)
        except OSError as error:
            return "lost", f"The connection to the bench was lost ({_cause(error)})."
        return "complete", ""

    def _perform(
        self,
        protocol: BenchProtocol,
        inputs: tuple[BenchChannel, ...],
        watch: Watch,
        samples: list[BenchSample],
    ) -> None:
        """Send each command when it is due; a late one is that of the present time, so that no step is hurried."""
        times = np.asarray(protocol.time_s, float)
        periods = np.diff(times, append=2 * times[-1] - times[-2])
        guard = CommandGuard(inputs, float(periods.max()))
        with DriverThread(self.stall_s) as worker:
            worker.call(self.vent, "did not vent")
            start_s, sent_s = self.clock.now(), 0.0
            for index, (due_s, period_s) in enumerate(zip(times.tolist(), periods.tolist(), strict=True)):
                if self.clock.sleep_until(start_s + due_s, self._stopping):
                    raise RunStoppedError(STOPPED)
                now_s = self.clock.now() - start_s
                is_late = now_s > due_s + period_s
                sent_s = max(sent_s, min(now_s, times[-1]) if is_late else due_s)
                commands = _at(protocol, index, sent_s)
                if violation := guard.admit(sent_s, commands):
                    raise RunStoppedError(
                        f"The run was stopped before a command that is not allowed: {violation}."
                    )
                sample = self._exchanged(worker, start_s, index, commands, due_s + period_s)
                samples.append(replace(sample, late=is_late or sample.late))
                watch(samples[-1])

    def _exchanged(
        self, worker: DriverThread, start_s: float, index: int, commands: dict[str, float], latest_s: float
    ) -> BenchSample:
        """Return the sample of one exchange; it is late if its command or reading came after `latest_s`."""
        commanded_s = self.clock.now() - start_s
        values = worker.call(partial(self.exchange, commands), "did not answer")
        now_s = self.clock.now() - start_s
        if self.set_age_s is not None:
            commanded_s = max(commanded_s, now_s - self.set_age_s)
        read_s = max(commanded_s, now_s - self.age_s)
        present = {name: values.get(name, command) for name, command in commands.items()}
        readings = {name: value for name, value in values.items() if name not in present}
        return BenchSample(index, commanded_s, read_s, present, readings, max(commanded_s, read_s) > latest_s)

    def _vent_surely(self) -> str:
        """Vent, and again after an error or Ctrl-C; return a sentence where it failed."""
        cause, interruption = "", None
        for _ in range(VENT_ATTEMPTS):
            try:
                call_driver(self.stall_s, self.vent)
            except KeyboardInterrupt as pressed:
                interruption, cause = pressed, "Ctrl-C was pressed"
            except Exception as error:  # of a driver: any
                cause = _cause(error)
            else:
                cause = ""
                break
        if interruption is not None:
            raise interruption
        return f"The bench could not be vented ({cause}): vent it by hand." if cause else ""


def _cause(error: Exception) -> str:
    """Return the text of an error inside brackets."""
    text = (error.strerror or "") if isinstance(error, OSError) else ""
    text = (text or str(error) or type(error).__name__).rstrip(".")
    return text[:1].lower() + text[1:] if isinstance(error, RunStoppedError) else text


def _at(protocol: BenchProtocol, index: int, time_s: float) -> dict[str, float]:
    """Return the commands at a time; those of the instant itself without interpolation."""
    if time_s == protocol.time_s[index]:
        return protocol.commands_at(index)
    return {
        name: float(np.interp(time_s, protocol.time_s, values)) for name, values in protocol.commands.items()
    }


def _checked(channel: BenchChannel, readings: list[Mapping[str, float]]) -> ChannelCheck:
    values = np.array([one.get(channel.name, np.nan) for one in readings], float)
    read = values[np.isfinite(values)]
    if not len(read):
        return ChannelCheck(channel.name, np.nan, f"{channel.name} gives no reading.")
    value, limits = float(np.median(read)), channel.limits
    if not limits.low <= value <= limits.high:
        return ChannelCheck(
            channel.name, value, f"{channel.name} reads {value:g}, outside [{limits.low:g}, {limits.high:g}]."
        )
    if len(read) < len(values):
        lost = len(values) - len(read)
        return ChannelCheck(
            channel.name, value, f"{channel.name} gives no reading in {lost} of {len(values)} samples."
        )
    return ChannelCheck(channel.name, value)


def recorded(
    protocol: BenchProtocol,
    samples: list[BenchSample],
    outputs: tuple[BenchChannel, ...],
    ending: Ending = "complete",
    reason: str = "",
) -> BenchRecording:
    """Return the recording of the samples of a run; readings of other outputs are left out."""
    return BenchRecording(
        protocol,
        np.array([one.commanded_s for one in samples], float),
        np.array([one.read_s for one in samples], float),
        {name: np.array([one.commands[name] for one in samples], float) for name in protocol.commands},
        {c.name: np.array([one.readings.get(c.name, np.nan) for one in samples], float) for c in outputs},
        np.array([one.late for one in samples], bool),
        ending,
        reason,
    )
