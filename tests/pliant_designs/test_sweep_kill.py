"""A sweep killed twice with its whole process group: nothing is lost, nothing saved is solved twice."""

import os

import pytest
from benchmarks.families.kill import SPRINGS, Killing


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="POSIX signals")
@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_kill_9_loses_nothing_and_repeats_nothing_saved(tmp_path, workers):
    text = SPRINGS.replace("delay_s: 0.05", "delay_s: 0.02, pressures: 3, angles: 3, check_states: 1")
    count = Killing(text, tmp_path, seed=1, window_s=0.4, workers=workers).run(kills=2)
    assert count.kills == 2
    assert count.states >= 70
    assert count.cut_off + count.unsure >= 1
    assert (count.lost, count.saved_and_solved_twice) == (0, 0)
    assert count.largest_difference == 0.0
    assert count.complaints == []
    assert count.sound
