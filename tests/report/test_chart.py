"""A chart's data next to its picture: numbers within half a quantisation step, and names that cannot close a tag."""

import base64
import json

import numpy as np

from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel
from pliant.report.chart_json import LEVELS, MISSING, as_script_data


def unpacked(packed):
    codes = np.frombuffer(base64.b64decode(packed["levels"]), "<u2")
    return np.where(codes == MISSING, np.nan, packed["low"] + packed["span"] * codes / LEVELS)


def chart(x, y, name="run"):
    return Chart(
        (Panel(ChartAxis("time", "s"), ChartAxis("angle", "°"), (ChartLine("measured", x, y, name),)),)
    )


def test_numbers_come_back_within_half_a_level_and_gaps_as_gaps():
    rng = np.random.default_rng(0)
    x, y = np.arange(500.0), rng.normal(3.0, 40.0, 500)
    y[[0, 7, 499]] = np.nan
    data = json.loads(as_script_data(chart(x, y)))
    line = data["panels"][0]["marks"][0]
    for values, of in ((x, "x"), (y, "y")):
        again = unpacked(data["lists"][line[of]])
        assert np.array_equal(np.isnan(again), np.isnan(values))
        assert np.nanmax(np.abs(again - values)) <= 0.5001 * np.ptp(values[np.isfinite(values)]) / LEVELS


def test_lists_without_numbers_or_with_one_value_stay_unchanged():
    data = json.loads(as_script_data(chart(np.full(4, 2.5), np.full(4, np.nan))))
    line = data["panels"][0]["marks"][0]
    assert np.array_equal(unpacked(data["lists"][line["x"]]), np.full(4, 2.5))
    assert np.isnan(unpacked(data["lists"][line["y"]])).all()


def test_a_list_that_several_lines_share_is_written_once():
    x = np.arange(9.0)
    lines = tuple(ChartLine("measured", x, x**2, str(k)) for k in range(5))
    data = json.loads(as_script_data(Chart((Panel(ChartAxis("a"), ChartAxis("b"), lines),))))
    assert len(data["lists"]) == 2


def test_a_hostile_name_is_text():
    name = "</script><!--<script>&\u2028\u202e\x00"
    text = as_script_data(chart(np.arange(2.0), np.arange(2.0), name))
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text)["panels"][0]["marks"][0]["run"] == "</script><!--<script>&\u2028\ufffd\ufffd"
