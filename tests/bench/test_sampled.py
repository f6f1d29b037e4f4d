"""The loop that paces a run: times, late samples, limits before every sample, and venting on every exit."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from tests.bench.bad_benches import Disconnecting, Plant, Stalling, Unventable
from tests.bench.conftest import pressure

from pliant.errors import UserError
from pliant_bench import sampled
from pliant_bench.bench import RunStoppedError
from pliant_bench.clock import AcceleratedClock, RealClock


class Slow(Plant):
    """Takes 35 ms for its tenth exchange."""

    def exchange(self, commands):
        if len(self.sent) == 10:
            time.sleep(0.035)
        return super().exchange(commands)


def test_a_run_is_recorded_as_it_was_commanded(hill, unwatched):
    bench, protocol = Plant(), hill()
    done = bench.run(protocol, unwatched)
    assert done.ending == "complete" and not done.reason
    assert np.array_equal(done.commanded_s, protocol.time_s)
    assert np.array_equal(done.commands["pressure_pa"], protocol.commands["pressure_pa"])
    assert np.isfinite(done.readings["angle_rad"]).all() and not done.late.any()
    assert bench.vents == 2 and bench.is_vented


def test_in_real_time_samples_are_taken_when_they_are_due(hill, unwatched):
    bench = Plant()
    bench.clock = RealClock()
    done = bench.run(hill(2e3, 1.0), unwatched)
    assert np.median(done.commanded_s - done.protocol.time_s) < 0.005
    assert (done.commanded_s >= done.protocol.time_s).all()


def test_a_late_sample_is_marked_and_the_path_goes_on_in_the_present(hill, unwatched):
    bench, protocol = Slow(), hill()
    bench.clock = AcceleratedClock(counts_work=True)
    done = bench.run(protocol, unwatched)
    assert done.ending == "complete" and done.late[9:11].all() and done.late.sum() < 20
    sent = done.commands["pressure_pa"]
    # Samples that are later than a period have the value of the path at that time, not of the instant missed.
    assert sent[10] > protocol.commands["pressure_pa"][10]
    expected = np.interp(done.commanded_s, protocol.time_s, protocol.commands["pressure_pa"])
    assert np.abs(sent - expected).max() < 8e3 * 0.011  # a period at the largest rate
    assert len(done) == len(protocol)


def test_minutes_at_100_hz_take_no_time_in_an_accelerated_clock(unwatched):
    bench = Plant()
    bench.stall_s = None
    n = 20_001
    path = pressure(5e3 * (1 - np.cos(2 * np.pi * np.arange(n) / (n - 1))))
    path.commands["pressure_pa"][-1] = 0.0
    assert bench.run(path, unwatched).read_s[-1] == pytest.approx(200.0)


@pytest.mark.parametrize(
    "error", [RunStoppedError("The angle is wrong."), KeyboardInterrupt(), ValueError("x")]
)
def test_the_bench_is_vented_whatever_the_watch_raises(hill, error):
    def watch(sample):
        if sample.index == 20:
            raise error

    bench = Plant()
    if isinstance(error, RunStoppedError):
        done = bench.run(hill(), watch)
        assert (done.ending, done.reason, len(done)) == ("stopped", "The angle is wrong.", 21)
    else:
        with pytest.raises(type(error)):
            bench.run(hill(), watch)
    assert bench.is_vented and len(bench.sent) == 23


def test_stop_ends_the_run_from_another_thread(hill, unwatched):
    bench = Plant()
    bench.clock = RealClock()
    timer = threading.Timer(0.2, bench.stop)
    timer.start()
    started = time.monotonic()
    done = bench.run(hill(5e3, 20.0), unwatched)
    timer.join()
    assert done.ending == "stopped" and done.reason == sampled.STOPPED
    assert time.monotonic() - started < 2.0 and bench.is_vented


def test_stop_during_a_long_interval_wakes_the_loop(unwatched):
    bench = Plant()
    bench.clock = RealClock()
    threading.Timer(0.2, bench.stop).start()
    started = time.monotonic()
    assert bench.run(pressure([0, 0, 0], period_s=30.0), unwatched).ending == "stopped"
    assert time.monotonic() - started < 5.0


def test_stop_within_the_watch_and_without_a_run(hill):
    bench = Plant()
    done = bench.run(hill(), lambda sample: bench.stop() if sample.index == 5 else None)
    assert done.ending == "stopped" and len(done) == 6
    vents = bench.vents
    bench.stop()
    assert bench.vents == vents + 1


def test_a_bench_that_hangs_is_given_up_and_vented(hill, unwatched):
    bench = Stalling()
    done = bench.run(hill(), unwatched)
    bench.released.set()
    assert done.ending == "lost" and done.reason == "The bench did not answer for 0.2 s."
    assert bench.is_vented


def test_a_lost_connection_ends_the_run(hill, unwatched):
    bench = Disconnecting()
    done = bench.run(hill(), unwatched)
    assert (done.ending, len(done)) == ("lost", 10)
    assert done.reason == "The connection to the bench was lost (Input/output error)."
    assert bench.is_vented


def test_a_bench_that_cannot_be_vented_says_so(hill):
    def watch(sample):
        if sample.index == 20:
            raise RunStoppedError("The angle is wrong.")

    done = Unventable().run(hill(), watch)
    assert done.ending == "lost"
    assert (
        done.reason
        == "The angle is wrong. The bench could not be vented (Input/output error): vent it by hand."
    )


def test_a_bench_that_cannot_be_vented_after_ctrl_c_says_so(hill):
    def watch(sample):
        if sample.index == 20:
            raise KeyboardInterrupt

    with pytest.raises(UserError, match="could not be vented .*: vent it by hand"):
        Unventable().run(hill(), watch)


def test_ctrl_c_during_venting_vents_again(hill):
    class Impatient(Plant):
        def vent(self):
            super().vent()
            if self.vents == 2:
                raise KeyboardInterrupt

    def watch(sample):
        raise KeyboardInterrupt

    bench = Impatient()
    with pytest.raises(KeyboardInterrupt):
        bench.run(hill(), watch)
    assert bench.vents == 3


def test_a_protocol_beyond_the_drivers_limits_is_not_begun(hill, unwatched):
    bench = Plant()
    with pytest.raises(UserError, match="above its limit of 15 kPa"):
        bench.run(hill(16e3), unwatched)
    assert not bench.sent


def test_a_protocol_that_changes_while_it_runs_is_stopped_before_the_command_is_sent(hill):
    protocol = hill()

    def watch(sample):
        if sample.index == 50:
            protocol.commands["pressure_pa"][51:] = 14e3

    bench = Plant()
    done = bench.run(protocol, watch)
    assert (
        done.ending == "stopped"
        and "before a command that is not allowed: pressure_pa changes" in done.reason
    )
    assert max(value for _, value in bench.sent) < 14e3 and bench.is_vented


def test_the_handshake_reads_every_channel_at_rest():
    found = {one.name: one for one in Plant().check()}
    assert found["angle_rad"].value == 0.0 and not any(one.problem for one in found.values())

    class Blind(Plant):
        def exchange(self, commands):
            return {}

    class Beyond(Plant):
        def exchange(self, commands):
            return {"angle_rad": 3.0}

    class Hanging(Plant):
        stall_s = 0.1

        def exchange(self, commands):
            time.sleep(0.5)
            return {}

    with pytest.raises(
        UserError, match=r"handshake with the bench failed: the bench did not answer for 0.1 s\. Switch"
    ):
        Hanging().check()
    assert Blind().check()[-1].problem == "angle_rad gives no reading."
    assert Beyond().check()[-1].problem == "angle_rad reads 3, outside [-2, 2]."


def test_the_recording_of_a_stopped_run_has_the_whole_protocol(hill):
    def watch(sample):
        raise RunStoppedError("Enough.")

    protocol = replace(hill(), conditions={"payload_kg": 0.1})
    assert Plant().run(protocol, watch).protocol is protocol
