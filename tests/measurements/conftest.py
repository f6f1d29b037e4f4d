"""A function that reads a text as a measurement, with notes."""

import pytest

from pliant.measurements.reading import read_measurement
from pliant.records.measurement import Measurement


@pytest.fixture
def read(tmp_path):
    def reading(text: str | bytes, notes: str = "", **arguments) -> Measurement:
        path = tmp_path / "bench.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        if notes:
            (tmp_path / "bench.yaml").write_text(notes)
        return read_measurement(path, **arguments)

    return reading
