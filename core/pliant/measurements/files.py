"""Files as people name them: one, several, a pattern, tables in memory; read together as one measurement."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from pliant.config.measurements import MeasurementNotes
from pliant.config.problems import sentences
from pliant.errors import UserError, closest
from pliant.execution.progress import Progress
from pliant.measurements.header import HalfError
from pliant.measurements.notes import notes_of
from pliant.measurements.reading import NEVER_CHANGES, ONE_RUN, read_measurement
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.records.remark import Remark
from pliant.tabular.opening import is_frame

PATTERN = re.compile(r"[*?\[]")
QUANTITY = re.compile(r"[-+]?\d+([.,p]\d+)?(g|kg|mN|N|mNm|Nm|C|degC|K|kPa|mbar|bar|deg)")
# What names tables: a path, a pattern, a pandas frame, or several of these.
Sources = Any


def read_measurements(
    files: Sources,
    notes: Mapping[str, Any] | MeasurementNotes | None = None,
    *,
    actuation: Sequence[str] | None = None,
    expected: Mapping[str, tuple[float, float]] | None = None,
    progress: Progress | None = None,
    exclude_from_first: bool = False,
) -> Measurement:
    """Read tables as one measurement, in their order; one without a column `run` is a run named after its file.

    A file that another one joins (`join` in its notes) gives its columns to that one and is no measurement itself.

    Args:
        files: a path, a pattern such as ``runs/*.csv`` (its files in natural order), a pandas frame, or several.
        notes: what the files do not say of themselves, before the YAML beside each (docs/measurement_files.md).
        actuation, expected, progress: as of `read_measurement`.
        exclude_from_first: the spans of `notes` are of the first file alone.

    Raises:
        UserError: what cannot be read, or cannot be decided without being asked.
    """
    sources = sources_of(files)
    stated = as_notes(notes)
    seen: set[str] = set()
    joined = {path for source in sources if (path := _joined_by(source, stated)) is not None}
    own = [s for s in sources if is_frame(s) or s.resolve() not in joined]
    absent: list[set[tuple[str, str]]] = [set() for _ in own]
    try:
        measurements = [
            read_measurement(
                source,
                settings=stated.model_copy(update={"exclude": ()})
                if number and exclude_from_first
                else stated,
                actuation=actuation,
                expected=expected,
                progress=progress,
                runs_seen=seen if len(own) > 1 and not exclude_from_first else None,
                elsewhere_noted=absent[number] if len(own) > 1 else None,
            )
            for number, source in enumerate(own)
        ]
    except HalfError as error:
        raise _of_two_loggers(own, stated, actuation) or error from None
    for span in stated.exclude if seen else ():
        if span.run not in seen:
            raise UserError(
                f"'exclude' names run '{span.run}', which is not there{closest(span.run, sorted(seen))}"
            )
    for key, name in sorted(set.intersection(*absent)):
        names = sorted({heading for m in measurements for heading in m.headed.values()})
        raise UserError(
            f"'{key}' has '{name}', which is not a column of any of the files{closest(name, names)}"
        )
    found = together(measurements)
    if not exclude_from_first:
        _check_runs(found, stated)
    if stated.name_pattern is None and (hint := _said_by_names([s for s in own if not is_frame(s)])):
        found = replace(found, remarks=(*found.remarks, hint))
    return found


def _check_runs(measurement: Measurement, stated: MeasurementNotes) -> None:
    """Raise `UserError` where the notes say something of a run that is not there."""
    names = [run.name for run in measurement.runs]
    gone = {span.run for span in stated.exclude if span.whole_run}
    for key, name in [("let_go", one) for one in stated.let_go] + [("runs", one) for one in stated.runs]:
        if name not in gone and not any(run == name or run.startswith(f"{name} cycle ") for run in names):
            raise UserError(f"'{key}' names run '{name}', which is not there{closest(name, names)}")


def _of_two_loggers(
    sources: Sequence[Any], stated: MeasurementNotes, actuation: Sequence[str] | None
) -> UserError | None:
    """The error where one of the files has inputs alone and another readings alone; None where none does."""
    half: dict[str, Path] = {}
    for source in sources if len(sources) > 1 else ():
        try:
            read_measurement(source, settings=stated, actuation=actuation)
        except HalfError as error:
            half.setdefault(error.lacks, source)
        except UserError:
            continue
    if len(half) < 2:
        return None
    camera, logger = half["inputs"], half["readings"]
    _, notes_name = notes_of(camera, None)
    name = os.path.relpath(logger, camera.parent).replace(os.sep, "/")
    return UserError(
        f"{camera} has readings and no input, {logger} inputs and no reading. Where two loggers recorded one run, name "
        f"{camera.name} alone and write 'join: {{file: {name}, shift: 0 s}}' into {notes_name}; 'shift' is added to "
        f"the clock of {logger.name}."
    )


def _said_by_names(files: Sequence[Path]) -> str:
    """A sentence where the names of several files have a quantity in them that differs, and nobody reads it."""
    if any(notes_of(file, None)[0].name_pattern for file in files):
        return ""
    said = dict.fromkeys(
        part for file in files for part in re.split(r"[_\s]+", file.stem) if QUANTITY.fullmatch(part)
    )
    if len(files) < 2 or len(said) < 2:
        return ""
    return (
        f"The files' names say {', '.join(list(said)[:5])}, which is not read; if it is a load or a condition, write "
        f"'name_pattern: finger_{{payload_g}}g_{{run}}', as the names are, into the notes."
    )


def sources_of(files: Sources) -> list[Any]:
    """Paths and frames, patterns replaced by their files; raises `UserError` for a pattern that fits none."""
    if is_frame(files):
        return [files]
    if isinstance(files, str | Path):
        return list(_expanded(Path(files)))
    found = [source for file in files for source in sources_of(file)]
    if not found:
        raise UserError("no file is given; name one, or a pattern such as 'runs/*.csv'.")
    return found


def _expanded(path: Path) -> Iterable[Path]:
    if path.exists() or not PATTERN.search(str(path)):
        return [path]
    found = sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))), key=lambda p: natural(str(p)))
    if not (tables := [p for p in found if p.is_file() and p.suffix not in (".yaml", ".yml")]):
        raise UserError(f"{path}: no file fits the pattern.")
    return tables


def natural(name: str) -> list[Any]:
    """A key that sorts run_2 before run_10."""
    return [int(part) if part.isdigit() else part.lower() for part in re.split(r"(\d+)", name)]


def as_notes(notes: Mapping[str, Any] | MeasurementNotes | None) -> MeasurementNotes:
    """Notes as they are validated; raises `UserError` for a key that is not one, or a value that cannot be."""
    if isinstance(notes, MeasurementNotes):
        return notes
    try:
        return MeasurementNotes.model_validate(dict(notes or {}))
    except ValidationError as error:
        raise UserError(
            sentences(error, MeasurementNotes, lambda at: "the notes").replace("of a study", "of notes")
        ) from None


def _joined_by(source: Any, stated: MeasurementNotes) -> Path | None:
    """The file that a file's notes join."""
    if is_frame(source):
        return None
    notes, _ = notes_of(source, stated)
    return None if notes.join is None else (source.parent / notes.join.file).resolve()


def together(measurements: Sequence[Measurement]) -> Measurement:
    """All runs in order; outputs that only some files have are missing in the others.

    A specimen that stands in several files goes on from one to the next. A run whose name was taken by an earlier
    file gets its file's name before its own.

    Raises:
        UserError: files that are the same, or that have different inputs or places of their markers.
    """
    if len(measurements) == 1:
        return measurements[0]
    remarks = _remarks(measurements)
    measurements = [m for m in measurements if m.runs]
    if not measurements:
        raise UserError("no run is left of any of the files: 'exclude' leaves all of them out.")
    if len(measurements) == 1:
        return replace(measurements[0], remarks=remarks)
    first = measurements[0]
    inputs = set(first.runs[0].history.actuation)
    arms = {(m.marker_arms_m, m.marker_offsets_m) for m in measurements if m.marker_arms_m}
    for other in measurements[1:]:
        theirs = set(other.runs[0].history.actuation)
        if theirs != inputs:
            raise UserError(
                f"{other.source} is driven by {', '.join(sorted(theirs))}, and {first.source} by "
                f"{', '.join(sorted(inputs))}; files that are read together need the same inputs."
            )
    digests = [m.sha256 for m in measurements]
    for number, other in enumerate(measurements):
        if other.sha256 and other.sha256 in digests[:number]:
            twin = measurements[digests.index(other.sha256)].source
            raise UserError(
                f"{other.source} holds the same as {twin}: its runs would pass for repeats without noise; give it once."
            )
    if len(arms) > 1:
        raise UserError(
            f"{' and '.join(m.source for m in measurements)} state different places of their markers; "
            "files that are read together need the same 'markers'."
        )
    outputs = tuple(dict.fromkeys(name for m in measurements for name in m.outputs))
    runs: list[MeasuredRun] = []
    for measurement in measurements:
        taken = {run.name for run in runs}
        runs += [_joined(run, outputs, taken, Path(measurement.source).stem) for run in measurement.runs]
    digest = hashlib.sha256("".join(m.sha256 for m in measurements).encode()).hexdigest()
    return Measurement(
        tuple(runs),
        outputs,
        " + ".join(m.source for m in measurements),
        remarks,
        next(iter(arms), ((), ()))[0],
        digest if any(m.sha256 for m in measurements) else "",
        tuple(dict.fromkeys(doubt for m in measurements for doubt in m.doubts)),
        {name: unit for m in reversed(measurements) for name, unit in m.written.items()},
        {name: heading for m in reversed(measurements) for name, heading in m.headed.items()},
        next(iter(arms), ((), ()))[1],
        first.frames,
        {name: zero for m in measurements for name, zero in m.free_zeros.items()},
    )


def _remarks(measurements: Sequence[Measurement]) -> tuple[Remark, ...]:
    """What is said of the files, once where it is said of several."""
    said: dict[str, list[tuple[Remark, str]]] = {}
    for m in measurements:
        for remark in m.remarks:
            if remark != ONE_RUN and not remark.endswith(NEVER_CHANGES):
                said.setdefault(remark, []).append((Remark.of(remark), m.source))
    return tuple(_of_files(same[0][0], [source for _, source in same]) for same in said.values())


def _of_files(remark: Remark, sources: Sequence[str]) -> Remark:
    """The remark with the files that it is about."""
    more = len(sources) - 1
    return remark.from_file(f"{sources[0]} and {more} more file{'s' * (more > 1)}" if more else sources[0])


def _joined(run: MeasuredRun, outputs: Sequence[str], taken: set[str], stem: str) -> MeasuredRun:
    """The run with every output, and a name of its own."""
    missing = np.full(len(run), np.nan)
    name, number = run.name if run.name not in taken else f"{stem} {run.name}", 2
    while name in taken:
        name, number = f"{stem} {run.name} ({number})", number + 1
    return replace(
        run.with_outputs({output: run.outputs.get(output, missing) for output in outputs}),
        history=run.history.with_(run=name),
    )
