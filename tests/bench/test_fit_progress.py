"""Progress of fits: a count, and a remaining time that is no promise."""

from __future__ import annotations

import pytest

from pliant_bench.loop.fit_progress import DIAGNOSING, IMPROVING, FitProgress, duration


class Clock:
    """A clock that is set by hand."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def done(progress: FitProgress, clock: Clock, fits: int, each_s: float = 2.0) -> None:
    for k in range(fits):
        clock.now_s += each_s
        progress.tick("nothing" if k == 0 else f"effect {k}")


def test_the_remaining_time_is_that_of_the_expected_fits_of_all_diagnoses() -> None:
    clock = Clock()
    progress = FitProgress(IMPROVING, 10, 2, clock=clock)
    done(progress, clock, 4)
    assert progress.left_s == pytest.approx(2.0 * (6 + 10)) and progress.share == pytest.approx(0.2)
    assert progress.words == (
        "improving the model, diagnosis 1 of at least 2, fit 4 of about 10 (effect 3), 8 s so far, at least 32 s left"
    )


def test_a_further_diagnosis_takes_as_many_fits_as_the_one_before() -> None:
    clock = Clock()
    progress = FitProgress(IMPROVING, 3, 1, clock=clock)
    done(progress, clock, 5)
    assert progress.left_s == 0.0 and "longer than expected" in progress.words
    done(progress, clock, 1)
    assert (progress.diagnosis, progress.diagnoses, progress.fits) == (2, 2, 5)
    assert progress.left_s == pytest.approx(2.0 * 4)


def test_a_slow_first_fit_does_not_set_the_time_alone() -> None:
    clock = Clock()
    progress = FitProgress(DIAGNOSING, 10, 1, each_s=1.0, clock=clock)
    done(progress, clock, 1, each_s=12.0)  # with compilation
    assert progress.left_s == pytest.approx(9 * (10.0 + 12.0) / 11)


def test_the_file_is_written_twice_a_second_at_most() -> None:
    clock = Clock()
    progress = FitProgress(DIAGNOSING, 10, clock=clock)
    assert progress.is_due() and not progress.is_due()
    clock.now_s = 0.6
    assert progress.is_due()


@pytest.mark.parametrize(
    ("seconds", "words"), [(3.2, "3 s"), (99.0, "99 s"), (150.0, "2.5 min"), (1500.0, "25 min")]
)
def test_durations_in_words(seconds: float, words: str) -> None:
    assert duration(seconds) == words
