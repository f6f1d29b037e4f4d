"""Checks of a `Bench`: channels, handshake, times and readings of a run, limits, and rest after every ending.

They move the inputs by a tenth of their range. Without a bench at the address of the config they are skipped.
"""

from __future__ import annotations

import threading
from dataclasses import replace
from functools import partial

import numpy as np

from pliant.errors import UserError
from pliant.testing import Finding, Subject, require, require_refused
from pliant_bench.bench import (
    Bench,
    BenchSample,
    RunStoppedError,
)
from pliant_bench.conformance_runs import (
    PERIOD_S,
    SHARE,
    performed,
    require_rest,
    rounding_error,
    small_run,
    with_bench,
)

REASON = "The check ends the run here."
STOP_AT = 10  # the sample at which a run is stopped


def channels_are_named_and_limited(subject: Subject) -> None:
    """no two channels have the same name; each input has a range that contains its rest, finite on hardware."""

    def act(bench: Bench) -> None:
        names = [channel.name for channel in (*bench.inputs, *bench.outputs)]
        require(bench.inputs and bench.outputs, "a bench needs an input and an output at least")
        require(len(set(names)) == len(names), f"a channel's name occurs twice: {sorted(names)}")
        for channel in bench.inputs:
            limits = channel.limits
            finite = np.isfinite(limits.low) and np.isfinite(limits.high)
            require(
                finite or not bench.is_hardware,
                f"{channel.name} has no finite range: [{limits.low:g}, {limits.high:g}]",
            )
            require(
                limits.low <= channel.rest <= limits.high and limits.low < limits.high,
                f"the range [{limits.low:g}, {limits.high:g}] of {channel.name} lacks its rest {channel.rest:g}",
            )
            require(
                limits.rate > 0 and limits.acceleration > 0 and limits.dwell_s >= 0,
                f"{channel.name} has a limit of rate, acceleration or dwell that lets it never move",
            )

    with_bench(subject, act)


def a_bench_that_is_not_there_is_a_users_error(subject: Subject) -> None:
    """`connect` raises `UserError` where no bench answers, and `close` may follow."""
    bench: Bench = subject.build()
    try:
        bench.connect()
    except UserError as error:
        require(str(error).strip(), "the error has no message")
    finally:
        bench.close()


def closes_twice_and_connects_again(subject: Subject) -> None:
    """`close` may be called twice and before `connect`; `connect` may follow it."""
    subject.build().close()

    def act(bench: Bench) -> None:
        bench.close()
        bench.close()
        bench.connect()
        performed(bench)

    with_bench(subject, act)


def checks_every_channel(subject: Subject) -> None:
    """`check` returns one result for every channel, and leaves the inputs at rest."""

    def act(bench: Bench) -> None:
        names = sorted(channel.name for channel in (*bench.inputs, *bench.outputs))
        checks = bench.check()
        require(
            sorted(one.name for one in checks) == names,
            f"check() names {[c.name for c in checks]}, not {names}",
        )
        problems = [one.problem for one in checks if one.problem]
        require(not problems, f"the handshake finds: {' '.join(problems)}")
        require_rest(bench)

    with_bench(subject, act)


def performs_the_run_it_is_given(subject: Subject) -> None:
    """the recording has the samples and the commands of the protocol, and of every output readings in its range."""

    def act(bench: Bench) -> None:
        done = performed(bench)
        recording, protocol = done.recording, done.protocol
        require(len(recording) == len(protocol), f"{len(recording)} samples of {len(protocol)} were recorded")
        for channel in bench.inputs:
            sent, at_s = recording.commands[channel.name], recording.commanded_s
            path = [
                np.interp(at_s + shift, protocol.time_s, protocol.commands[channel.name])
                for shift in (-2 * PERIOD_S, 0.0, PERIOD_S)
            ]
            slack = rounding_error(channel)
            require(
                np.all((sent >= np.min(path, axis=0) - slack) & (sent <= np.max(path, axis=0) + slack)),
                f"other commands of {channel.name} were recorded than asked for",
            )
        names = [channel.name for channel in bench.outputs]
        require(
            sorted(recording.readings) == sorted(names),
            f"readings of {sorted(recording.readings)}, not {names}",
        )
        for channel in bench.outputs:
            read = recording.readings[channel.name]
            read = read[np.isfinite(read)]
            require(len(read) > 0.5 * len(recording), f"{channel.name} was read in {len(read)} samples only")
            limits = channel.limits
            require(
                np.all((read >= limits.low) & (read <= limits.high)),
                f"{channel.name} reads {read.min():g} to {read.max():g}, outside [{limits.low:g}, {limits.high:g}]",
            )
        require_rest(bench)

    with_bench(subject, act)


def times_belong_to_the_run(subject: Subject) -> None:
    """times begin at the run's start and increase; nothing is read before its command, and late samples are marked."""

    def act(bench: Bench) -> None:
        done = performed(bench)
        commanded_s, read_s = done.recording.commanded_s, done.recording.read_s
        require(np.all(np.diff(read_s) > 0), "the times of the readings do not increase")
        require(np.all(read_s >= commanded_s), "a reading has a time before its command")
        require(commanded_s[0] >= -1e-9, f"the first command has the time {commanded_s[0]:g} s")
        due_s = done.protocol.time_s
        require(np.all(commanded_s >= due_s - 1e-6), "a command was sent before it was due")
        late = np.maximum(commanded_s, read_s) - due_s > 2 * PERIOD_S
        require(not np.any(late & ~done.recording.late), "a sample is late by two periods and not marked")

    with_bench(subject, act)


def the_watch_sees_every_sample(subject: Subject) -> None:
    """the watch is called once with every sample, in order, with the values that are recorded."""

    def act(bench: Bench) -> None:
        done = performed(bench)
        indices = [sample.index for sample in done.samples]
        require(
            indices == list(range(len(done.protocol))),
            f"the watch saw {len(indices)} of {len(done.protocol)}",
        )
        known = {channel.name for channel in bench.outputs}
        others = sorted({name for sample in done.samples for name in sample.readings} - known)
        require(not others, f"readings of {', '.join(others)} came, which are no outputs of the bench")
        for name, values in done.recording.readings.items():
            seen = [sample.readings.get(name, np.nan) for sample in done.samples]
            require(
                np.array_equal(seen, values, equal_nan=True),
                f"the watch saw other readings of {name} than were recorded",
            )

    with_bench(subject, act)


def refuses_a_run_beyond_its_limits(subject: Subject) -> None:
    """a run that exceeds the driver's own limits is refused with `UserError`, before anything moves."""

    def act(bench: Bench) -> None:
        small = small_run(bench)
        for channel in bench.inputs:
            name, limits = channel.name, channel.limits
            span = limits.high - limits.low
            if not np.isfinite(span):
                continue
            beyond = {"above its highest value": np.full(len(small), limits.high + SHARE * span)}
            if np.isfinite(limits.rate):
                jump = np.full(len(small), channel.rest)
                jump[len(jump) // 2] += min(2 * limits.rate * PERIOD_S, limits.high - channel.rest)
                is_fast = jump.max() - channel.rest > 1.01 * limits.rate * PERIOD_S
                beyond |= {"beyond its rate": jump} if is_fast else {}
            for what, values in beyond.items():
                wrong = replace(small, commands={**small.commands, name: values})
                require_refused(
                    partial(bench.run, wrong, _never),
                    f"a run with {name} {what} was performed",
                    name,
                    "channel",
                )

    with_bench(subject, act)


def ends_when_the_watch_says_so(subject: Subject) -> None:
    """a `RunStoppedError` of the watch ends the run as `stopped` with its sentence, and the inputs go to rest."""

    def act(bench: Bench) -> None:
        def watch(sample: BenchSample) -> None:
            if sample.index >= STOP_AT:
                raise RunStoppedError(REASON)

        recording = bench.run(small_run(bench), watch)
        require(recording.ending == "stopped", f"the run ended as '{recording.ending}': {recording.reason}")
        require(recording.reason == REASON, f"the reason is '{recording.reason}'")
        require(len(recording) > 0, "the samples before the end were not recorded")
        require_rest(bench)
        performed(bench)

    with_bench(subject, act)


def rests_after_any_error(subject: Subject) -> None:
    """after Ctrl-C or another error of the watch the inputs are at rest, and the bench can be used again."""

    def act(bench: Bench) -> None:
        for error in (KeyboardInterrupt(), ValueError("of the check")):

            def watch(sample: BenchSample, raised: BaseException = error) -> None:
                if sample.index >= STOP_AT:
                    raise raised

            try:
                bench.run(small_run(bench), watch)
            except BaseException as seen:
                if seen is not error:
                    raise
            require_rest(bench)

    with_bench(subject, act)


def stops_from_another_thread(subject: Subject) -> None:
    """`stop` from another thread ends the run as `stopped`, and the inputs go to rest."""

    def act(bench: Bench) -> None:
        stopped = threading.Event()

        def stop() -> None:
            bench.stop()
            stopped.set()

        def watch(sample: BenchSample) -> None:
            if sample.index == STOP_AT:
                threading.Thread(target=stop, daemon=True).start()
            # A bench without waits would be done before the thread starts.
            stopped.wait(0.05)

        recording = bench.run(small_run(bench), watch)
        require(
            recording.ending == "stopped" and recording.reason,
            f"the run ended as '{recording.ending}' after stop()",
        )
        require_rest(bench)

    with_bench(subject, act)


def _never(sample: BenchSample) -> None:
    raise Finding("a run that is not allowed was begun")
