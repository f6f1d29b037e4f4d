"""The page of a comparison: self-contained and reproducible for any measurement."""

from dataclasses import replace

import numpy as np
import pytest
from tests.evidence.compare_data import angle, bench, falling_shift, measured_run
from tests.report.pages import check_sound

from pliant.evidence.comparison import compare
from pliant.records.history import History
from pliant.records.measurement import Measurement
from pliant.report.comparison import comparison_document
from pliant.report.render import page


def page_html(measurement, predicted, title="finger"):
    return page(comparison_document(title, measurement, predicted, compare(measurement, predicted)))


def test_the_page_shows_runs_places_loops_and_a_map():
    settings = [(5e3, 0.0)]
    made, again = (
        page_html(*bench(0, effect=falling_shift(0.02), settings=settings), title="<b>finger</b>")
        for _ in "ab"
    )
    assert set(made.pictures) == {"runs", "where_1", "loops_1", "map"}
    assert "falling pressure" in check_sound(made)
    assert "&lt;b&gt;finger" in made.html and "<b>finger" not in made.html
    assert made.html == again.html


@pytest.mark.slow
def test_a_chain_has_pictures_for_two_outputs():
    made = page_html(*bench(0, n_joints=3, settings=[(5e3, 0.0)], dt=0.4))
    assert set(made.pictures) == {"runs", "runs_2", "where_1", "where_2", "loops_1", "loops_2", "map"}


def one_sample():
    history = History.from_arrays({"pressure_pa": np.array([5e3])}, np.zeros(1))
    measurement = Measurement((measured_run(history, {"angle_rad": np.array([0.2])}),), ("angle_rad",))
    return measurement, [{"angle_rad": angle(np.array([5e3]))}]


def without_time():
    pressure = np.linspace(0, 15e3, 9)
    history = History.from_arrays({"pressure_pa": pressure})
    measurement = Measurement((measured_run(history, {"angle_rad": 1.1 * angle(pressure)}),), ("angle_rad",))
    return measurement, [{"angle_rad": angle(pressure)}]


def a_silent_run():
    measurement, predicted = bench(0, settings=[(5e3, 0.0)], repeats=3)
    silent = measurement.runs[0].with_outputs({"angle_rad": np.full(len(measurement.runs[0]), np.nan)})
    return replace(measurement, runs=(silent, *measurement.runs[1:])), predicted


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", [one_sample, without_time, a_silent_run])
def test_awkward_measurements_have_a_page(case):
    made = page_html(*case())
    assert "runs" in made.pictures


@pytest.mark.slow
def test_many_runs_and_many_samples_stay_readable():
    """No more than 12 of fifteen runs of a thousand samples are drawn, and the page stays small."""
    settings = [(5e3, k * 1e-3) for k in range(15)]
    made = page_html(*bench(0, settings=settings, repeats=1, dt=0.03))
    assert "one run of each condition, the worst first" in made.html
    assert len(made.html) < 5e6
