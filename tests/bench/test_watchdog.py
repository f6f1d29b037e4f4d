"""The watchdog ends a run with one sentence, and leaves a run that is as it should be alone."""

from dataclasses import replace

import numpy as np
import pytest
from tests.bench.bad_benches import Dropping, NotANumber, Plant, Restarting
from tests.bench.conftest import pressure

from pliant_bench.bench import BenchSample, ChannelLimits, RunStoppedError
from pliant_bench.watchdog import Expectation, Watchdog, WatchdogConfig


def sample(index, read_s, angle=0.1, **others):
    return BenchSample(index, read_s, read_s, {"pressure_pa": 0.0}, {"angle_rad": angle, **others})


def ended(samples, config=WatchdogConfig(), expected=None, protocol=pressure(np.zeros(1000))):
    """Return how many samples passed, and the reason."""
    watchdog = Watchdog(protocol, config, expected)
    for count, one in enumerate(samples):
        try:
            watchdog(one)
        except RunStoppedError as stopped:
            return count, str(stopped)
    return len(samples), ""


@pytest.mark.parametrize("bench", [Dropping, NotANumber])
def test_a_bench_without_readings_is_stopped_after_the_silence(hill, bench):
    protocol, driver = hill(), bench()
    done = driver.run(protocol, Watchdog(protocol, WatchdogConfig(0.2)))
    assert done.ending == "stopped" and driver.is_vented
    assert done.reason == "No reading came for 0.22 s, at 0.29 s."
    assert np.isnan(done.readings["angle_rad"][-10:]).all()


def test_a_clock_that_restarts_is_noticed(hill):
    protocol, driver = hill(), Restarting()
    done = driver.run(protocol, Watchdog(protocol, WatchdogConfig()))
    assert done.ending == "stopped" and driver.is_vented
    assert done.reason == "The bench's clock jumped back from 0.99 s to 0 s."


def test_a_run_as_it_should_be_is_complete(hill):
    protocol, driver = hill(), Plant()
    clean = driver.run(protocol, lambda one: None).readings["angle_rad"]
    expected = Expectation({"angle_rad": clean}, {"angle_rad": np.full(len(clean), 1e-3)})
    config = WatchdogConfig(0.1, {"angle_rad": ChannelLimits(-0.1, 1.0)}, 4.0)
    assert Plant().run(protocol, Watchdog(protocol, config, expected)).ending == "complete"


def test_an_envelope_ends_the_run_at_the_first_reading_outside():
    config = WatchdogConfig(envelope={"angle_rad": ChannelLimits(-0.5, 0.5)})
    readings = [sample(k, 0.01 * k, angle) for k, angle in enumerate((0.1, 0.4, 0.6))]
    assert ended(readings, config) == (
        2,
        "angle_rad was 34.38° at 0.02 s, above its envelope, which ends at 28.65°.",
    )


def test_an_output_with_an_envelope_must_not_be_silent_alone():
    config = WatchdogConfig(0.05, {"tip_x_m": ChannelLimits(-1, 1)})
    count, reason = ended([sample(k, 0.01 * k, tip_x_m=np.nan) for k in range(20)], config)
    assert count == 7 and reason == "No reading of tip_x_m came for 0.07 s, at 0.07 s."


def test_a_prediction_is_missed_by_three_readings_in_a_row():
    n = 50
    expected = Expectation({"angle_rad": np.full(n, 0.1)}, {"angle_rad": np.full(n, 0.01)})
    config = WatchdogConfig(missed_multiple=5.0)
    spike = [sample(k, 0.01 * k, 0.3 if k in (10, 20, 21) else 0.12) for k in range(n)]
    assert ended(spike, config, expected) == (n, "")
    wrong = [sample(k, 0.01 * k, 0.2 if k >= 10 else 0.1) for k in range(n)]
    count, reason = ended(wrong, config, expected)
    assert count == 12
    assert reason.endswith("where 5.73° was predicted: 10 times the expected error, 5 times are allowed.")


def test_a_clock_that_stands_still_is_noticed():
    assert ended([sample(0, 0.0), sample(1, 0.01), sample(2, 0.01)]) == (
        2,
        "The bench's clock stands still at 0.01 s.",
    )
    backwards = replace(sample(1, 0.01), commanded_s=0.02)
    assert "jumped back by 0.01 s within a sample" in ended([sample(0, 0.0), backwards])[1]


def test_a_clock_that_jumps_ahead_is_silence():
    assert ended([sample(0, 0.0), sample(1, 5.0)]) == (1, "No reading came for 5 s, at 5 s.")


def test_long_intervals_of_the_protocol_are_no_silence():
    slow = pressure(np.zeros(5), period_s=10.0)
    assert ended([sample(k, 10.0 * k) for k in range(5)], protocol=slow) == (5, "")
