"""Protocol files of proposed runs, beside a report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pliant.config.study import Study
from pliant.experiments.planned_run import PlannedRun
from pliant.experiments.protocol_file import write_protocol
from pliant.records.measurement import Measurement

NEXT_RUN = "next_run.csv"


def write_runs(
    folder: Path,
    runs: Sequence[tuple[str, PlannedRun]],
    outputs: Sequence[str],
    study: Path,
    loaded: Study,
    measurement: Measurement | None = None,
    data: Sequence[Path] | None = None,
) -> list[Path]:
    """Write each run under its file's name; returns the paths. `data`: the measurement's files, if not the study's."""
    notes, paths = loaded.measurements, []
    old = [_from_here(file) for file in data or ([Path(notes.file)] if notes is not None else [])]
    for file, run in runs:
        path = folder / file
        write_protocol(path, run, outputs, measurement=measurement, notes=notes, study=str(study), data=old)
        paths.append(path)
    return paths


def _from_here(file: Path) -> str:
    """The file as one would type it in this folder."""
    here = Path.cwd()
    return str(file.relative_to(here) if file.is_relative_to(here) else file)
