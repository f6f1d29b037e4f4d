"""Interactive charts show the data of their still ones: law and states, search, chain, in a notebook too."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest
from tests.report import search_samples as samples

from pliant.notebook.result import Result
from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel
from pliant.report.chart_json import as_script_data
from pliant.report.document import Document, Picture, drawn
from pliant.report.law_charts import law_chart
from pliant.report.pose_charts import pose_chart
from pliant_search.records import SearchResult
from pliant_search.report.charts import front_chart, history_chart
from pliant_search.report.view import SearchView

AXIS = ChartAxis("a")


def document(chart: Chart | None) -> Document:
    shown = Picture("one", "</script><b>", np.zeros(8, np.uint8) if chart is None else chart)
    return Document(kind="k", title="t", sentence="s", data={}, draw=lambda: drawn(shown))


def test_a_result_shows_its_moving_picture_in_a_frame_without_our_origin(tmp_path: Path) -> None:
    line = ChartLine("measured", np.arange(3.0), np.arange(3.0), "</script>")
    made = Result(None, lambda: document(Chart((Panel(AXIS, AXIS, (line,)),)))).plot(interactive=True)
    frame = made._repr_html_()
    assert frame.count("<") == 2 and 'sandbox="allow-scripts"' in frame
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', frame)[1])
    assert page == made.html == made.save(tmp_path / "a.html").read_text("utf-8")
    data = re.search(r'<script type="application/json">(.*?)</script>', page)[1]
    assert json.loads(data)["panels"][0]["marks"][0]["run"] == "</script>"
    assert "<b>" not in page


def test_without_one_it_says_so() -> None:
    with pytest.raises(ValueError, match="no picture that moves"):
        Result(None, lambda: document(None)).plot(interactive=True)


def test_a_view_on_a_body_asks_for_equal_scales() -> None:
    panels = (Panel(AXIS, AXIS, (), equal=True), Panel(AXIS, AXIS, ()))
    assert [one["equal"] for one in json.loads(as_script_data(Chart(panels)))["panels"]] == [True, False]


def values(chart: Chart, panel: int, name: str) -> tuple[np.ndarray, np.ndarray]:
    lines = [line for line in chart.panels[panel].lines if line.name.startswith(name)]
    return tuple(np.concatenate([getattr(line, axis) for line in lines]) for axis in "xy")


def test_the_law_has_its_states_and_what_it_misses(kit) -> None:
    run = kit.full_run()
    chart, data = law_chart(run, run.designs[0]), kit.dataset()
    trusted = data.status == "ok"
    x, _ = values(chart, 0, "fitted")
    fitted = trusted & (data.role == "fit")
    assert np.allclose(np.sort(x), np.sort(np.degrees(data.angle_rad[fitted])))
    level = next(line for line in chart.panels[0].lines if line.name == "law")
    law = kit.PlainLaw().evaluate(np.zeros(len(level.x)), np.radians(level.x)[:, None]).tau[:, 0]
    assert level.run.startswith("0 ")
    assert np.allclose(level.y / np.abs(level.y).max(), law / np.abs(law).max())
    _, missed = values(chart, 1, "fitted")
    true = 100 * 1e-5 * np.sin(40 * data.angle_rad[fitted]) / kit.fit_report().effort_range
    assert np.allclose(np.sort(missed), np.sort(-true))


def test_every_engine_and_level_in_a_chain_is_in_its_view(kit) -> None:
    chart = pose_chart(kit.full_run())
    names = {line.name for line in chart.panels[0].lines}
    assert {"at rest", "on the way", "quasistatic", "mujoco"} <= names
    assert chart.panels[0].equal and chart.panels[-1].y.log
    (settled,) = [line for line in chart.panels[0].lines if line.name == "quasistatic"]
    lengths = np.hypot(np.diff(settled.x), np.diff(settled.y))
    assert np.allclose(lengths[1:-1], 11.0, rtol=1e-6)  # mm between joints, whatever the bend


def viewed(result: SearchResult) -> SearchView:
    return SearchView(result, samples.STUDY)


def test_best_so_far_only_gets_better_and_ends_at_the_best() -> None:
    for result in (samples.one_branch(), samples.many_branches(600)):
        read = viewed(result)
        chart = history_chart(read)
        sign = -1.0 if read.objective.maximised else 1.0
        ends = []
        for line in chart.panels[0].lines:
            if line.name.startswith("best so far"):
                known = line.y[np.isfinite(line.y)]
                assert (np.diff(sign * known) <= 0).all()
                ends += [sign * known[-1]] if len(known) else []
        assert np.isclose(min(ends), np.nanmin(sign * read.scores()))
    nothing = history_chart(viewed(samples.everything_failed()))
    assert all(line.rim for line in nothing.panels[0].lines)


def test_a_front_is_among_its_candidates() -> None:
    chart = front_chart(viewed(samples.two_objectives()))
    (every,), (front,) = (
        [p for p in chart.panels[0].lines if p.name.startswith(n)] for n in ("candidate", "front")
    )
    assert np.isfinite(front.y).all() and len(front.x) < len(every.x)
    assert front_chart(viewed(samples.one_branch())) is None
