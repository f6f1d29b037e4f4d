"""Protocol files of proposed runs, beside a report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pliant.config.study import Study
from pliant.experiments.menu import MenuRun
from pliant.experiments.protocol_file import write_protocol
from pliant.records.measurement import Measurement

NEXT_RUN = "next_run.csv"


def write_runs(
    folder: Path,
    runs: Sequence[tuple[str, MenuRun]],
    outputs: Sequence[str],
    study: Path,
    loaded: Study,
    measurement: Measurement | None = None,
) -> list[Path]:
    """Write each run under its file's name; returns the paths."""
    paths = []
    for file, run in runs:
        path = folder / file
        write_protocol(
            path, run, outputs, measurement=measurement, notes=loaded.measurements, study=str(study)
        )
        paths.append(path)
    return paths
