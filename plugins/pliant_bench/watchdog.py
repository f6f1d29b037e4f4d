"""The watchdog of a run: silence, a reading outside its envelope, a missed prediction, a clock that is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pliant.formatting import number, quantity
from pliant.records.design import Array
from pliant.units import si_unit
from pliant_bench.bench import BenchProtocol, BenchSample, ChannelLimits, RunStoppedError

# A prediction is missed when so many readings in a row are; a single one may be a disturbed reading.
IN_A_ROW = 3


@dataclass(frozen=True, eq=False)
class Expectation:
    """What a run is expected to read: (t,) of each output, at the protocol's instants.

    Attributes:
        mean, sd: mean and standard deviation, by which a missed prediction is judged.
        before: readings of the study's own model.
        band: standard deviation by the noise and by the explanations that are left; empty before the first diagnosis.
        explanation: name of the model of `mean`; empty if it is the study's own model.
    """

    mean: Mapping[str, Array]
    sd: Mapping[str, Array]
    before: Mapping[str, Array] = field(default_factory=dict)
    band: Mapping[str, Array] = field(default_factory=dict)
    explanation: str = ""


@dataclass(frozen=True)
class WatchdogConfig:
    """When a run is stopped.

    Attributes:
        silence_s: without any reading for this long; also without one of an output that has an envelope.
        envelope: range that the readings of an output must not leave, SI.
        missed_multiple: of the expected standard deviation, which the error of a prediction must not exceed in
            `IN_A_ROW` readings; None does not judge predictions.
    """

    silence_s: float = 0.5
    envelope: Mapping[str, ChannelLimits] = field(default_factory=dict)
    missed_multiple: float | None = None


class Watchdog:
    """A `Watch` that ends one run with a reason in one sentence."""

    def __init__(
        self, protocol: BenchProtocol, config: WatchdogConfig, expected: Expectation | None = None
    ) -> None:
        self._protocol, self._config, self._expected = protocol, config, expected
        self._last: BenchSample | None = None
        self._read_s: dict[str, float] = {}
        self._missed: dict[str, int] = {}

    def __call__(self, sample: BenchSample) -> None:
        """Raise `RunStoppedError` if the run has to end."""
        self._check_clock(sample)
        self._check_silence(sample)
        for name, value in sample.readings.items():
            if np.isfinite(value):
                self._check_envelope(name, value, sample)
                self._check_prediction(name, value, sample)
        self._last = sample

    def _check_clock(self, sample: BenchSample) -> None:
        last = self._last
        if sample.read_s < sample.commanded_s:
            raise RunStoppedError(
                f"The bench's clock jumped back by {number(sample.commanded_s - sample.read_s)} s within a sample, at "
                f"{number(sample.commanded_s)} s."
            )
        if last is None:
            return
        for name in ("commanded_s", "read_s"):
            before, now = getattr(last, name), getattr(sample, name)
            if now < before:
                raise RunStoppedError(
                    f"The bench's clock jumped back from {number(before)} s to {number(now)} s."
                )
            if now == before and sample.index > last.index:
                raise RunStoppedError(f"The bench's clock stands still at {number(now)} s.")

    def _check_silence(self, sample: BenchSample) -> None:
        now_s = sample.read_s if np.isfinite(sample.read_s) else sample.commanded_s
        alive = [name for name, value in sample.readings.items() if np.isfinite(value)]
        watched = {"": bool(alive), **{name: name in alive for name in self._config.envelope}}
        # A protocol may leave a longer time than `silence_s` between two instants.
        planned_s = self._planned_s(sample.index)
        for name, has_reading in watched.items():
            silent_s = now_s - self._read_s.get(name, 0.0)
            if silent_s > self._config.silence_s + planned_s:
                what = f"of {name} " if name else ""
                raise RunStoppedError(
                    f"No reading {what}came for {number(silent_s)} s, at {number(now_s)} s."
                )
            if has_reading:
                self._read_s[name] = now_s

    def _planned_s(self, index: int) -> float:
        times = self._protocol.time_s
        return float(times[index] - times[index - 1]) if index else 0.0

    def _check_envelope(self, name: str, value: float, sample: BenchSample) -> None:
        envelope = self._config.envelope.get(name)
        if envelope is None or envelope.low <= value <= envelope.high:
            return
        unit, side = si_unit(name), "above" if value > envelope.high else "below"
        limit = envelope.high if value > envelope.high else envelope.low
        raise RunStoppedError(
            f"{name} was {quantity(value, unit)} at {number(sample.read_s)} s, {side} its envelope, which ends at "
            f"{quantity(limit, unit)}."
        )

    def _check_prediction(self, name: str, value: float, sample: BenchSample) -> None:
        multiple, expected = self._config.missed_multiple, self._expected
        if multiple is None or expected is None or name not in expected.mean:
            return
        mean, sd = float(expected.mean[name][sample.index]), float(expected.sd[name][sample.index])
        is_missed = abs(value - mean) > multiple * sd
        self._missed[name] = self._missed.get(name, 0) + 1 if is_missed else 0
        if self._missed[name] >= IN_A_ROW:
            unit = si_unit(name)
            times = f"{number(abs(value - mean) / sd, 3)} times" if sd > 0 else "more than any multiple of"
            raise RunStoppedError(
                f"{name} was {quantity(value, unit)} at {number(sample.read_s)} s where {quantity(mean, unit)} was "
                f"predicted: {times} the expected error, {number(multiple)} times are allowed."
            )
