"""The recordings on the page are read with the notes printed below them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pliant.measurements.reading import read_measurement
from pliant.records.measurement import Measurement

PAGE = (Path(__file__).parents[2] / "docs" / "import_a_recording.md").read_text(encoding="utf-8")
SECTIONS = {
    title: (table, notes)
    for title, table, notes in re.findall(
        r"^### (.+?)\n.*?```csv\n(.*?)```\n\n```yaml\n(.*?)```", PAGE, re.MULTILINE | re.DOTALL
    )
}


def _curvatures(found: Measurement) -> None:
    assert found.outputs == ("curvature_y_1_per_m", "curvature_z_1_per_m")
    assert found.frames["*"].unknown
    assert set(found.free_zeros.values()) == {"unknown"}


def _steps(found: Measurement) -> None:
    np.testing.assert_allclose(found.runs[0].input("tendon_travel_3_m"), [0, -1e-5, -1e-5])
    assert found.runs[0].history.time_s is None
    assert found.outputs == ("tip_x_m", "tip_y_m", "tip_z_m")


def _laser(found: Measurement) -> None:
    np.testing.assert_allclose(found.runs[0].history.payload_kg, 0.3)
    assert found.free_zeros == {"extension_m": "per run"}
    np.testing.assert_allclose(found.runs[0].outputs["extension_m"], [1.3232e-3, 1.3193e-3, 0.22e-3])


def _swing(found: Measurement) -> None:
    assert found.runs[0].history.let_go.bend_rad == pytest.approx(np.deg2rad(16.9))
    np.testing.assert_array_equal(found.runs[0].input("pressure_pa"), [0, 0, 0])


WHAT: dict[str, Callable[[Measurement], None]] = {
    "Two curvatures of one ball joint": _curvatures,
    "Steps of motors": _steps,
    "A laser with another zero in each run": _laser,
    "A free swing": _swing,
}


def test_every_recording_on_the_page_is_read_here() -> None:
    assert set(SECTIONS) == set(WHAT)


@pytest.mark.parametrize("title", WHAT)
def test_a_recording_is_read_by_its_notes(title: str, tmp_path: Path) -> None:
    table, notes = SECTIONS[title]
    (tmp_path / "bench.csv").write_text(table, encoding="utf-8")
    (tmp_path / "bench.yaml").write_text(notes, encoding="utf-8")
    WHAT[title](read_measurement(tmp_path / "bench.csv"))
