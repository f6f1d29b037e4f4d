"""Reader of one or several files, a pattern, or tables in memory as one measurement."""

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
from pliant.config.problems import at_place, sentences
from pliant.errors import UserError, closest
from pliant.execution.progress import Progress
from pliant.measurements.header import HalfError
from pliant.measurements.notes import effective_notes
from pliant.measurements.reading import NEVER_CHANGES, ONE_RUN, read_measurement
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.records.remark import Remark
from pliant_tables.columns import is_frame

PATTERN = re.compile(r"[*?\[]")
QUANTITY = re.compile(r"[-+]?\d+([.,p]\d+)?(g|kg|mN|N|mNm|Nm|C|degC|K|kPa|mbar|bar|deg)")
# Tables to read: a path, a pattern, a pandas frame, or several of these.
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

    A file that another one joins (`join` in its notes) adds its columns to that one and is no separate measurement.

    Args:
        files: a path, a pattern such as ``runs/*.csv`` (its files in natural order), a pandas frame, or several.
        notes: what the files do not contain; they override the YAML next to each (docs/measurement_files.md).
        actuation, expected, progress: as of `read_measurement`.
        exclude_from_first: the spans of `notes` apply to the first file alone.

    Raises:
        UserError: a file that cannot be read, or an ambiguity that only the user can resolve.
    """
    stated = as_notes(notes)
    try:
        sources = expand_sources(files)
        for source in sources:
            if not is_frame(source) and not source.exists():
                raise UserError(f"{source}: the table cannot be read (no such file).")
    except UserError as error:
        raise UserError(f"{at_place(stated.at('', 'file'))}{error}") from None
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
        raise _two_loggers_error(own, stated, actuation) or error from None
    for number, span in enumerate(stated.exclude) if seen else ():
        if span.run not in seen:
            raise UserError(
                f"{at_place(stated.at('', 'exclude', number))}'exclude' names run '{span.run}', which is not there"
                f"{closest(span.run, sorted(seen))}"
            )
    for key, name in sorted(set.intersection(*absent)):
        names = sorted({heading for m in measurements for heading in m.headed.values()})
        raise UserError(
            f"{at_place(stated.at('', key, name))}'{key}' has '{name}', which is not a column of any of the files"
            f"{closest(name, names)}"
        )
    found = together(measurements)
    if not exclude_from_first:
        _check_runs(found, stated)
    if stated.name_pattern is None and (hint := _said_by_names([s for s in own if not is_frame(s)])):
        found = replace(found, remarks=(*found.remarks, hint))
    return found


def _check_runs(measurement: Measurement, stated: MeasurementNotes) -> None:
    """Raise `UserError` where the notes name a run that does not exist."""
    names = [run.name for run in measurement.runs]
    gone = {span.run for span in stated.exclude if span.whole_run}
    for key, name in [("let_go", one) for one in stated.let_go] + [("runs", one) for one in stated.runs]:
        if name not in gone and not any(run == name or run.startswith(f"{name} cycle ") for run in names):
            raise UserError(
                f"{at_place(stated.at('', key, name))}'{key}' names run '{name}', which is not there"
                f"{closest(name, names)}"
            )


def _two_loggers_error(
    sources: Sequence[Any], stated: MeasurementNotes, actuation: Sequence[str] | None
) -> UserError | None:
    """Return the error where one file has inputs alone and another readings alone; None otherwise."""
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
    _, notes_name = effective_notes(camera, None)
    name = os.path.relpath(logger, camera.parent).replace(os.sep, "/")
    return UserError(
        f"{camera} has readings and no input, {logger} inputs and no reading. Where two loggers recorded one run, name "
        f"{camera.name} alone and write 'join: {{file: {name}, shift: 0 s}}' into {notes_name}; 'shift' is added to "
        f"the clock of {logger.name}."
    )


def _said_by_names(files: Sequence[Path]) -> str:
    """Return a sentence if the names of several files contain a quantity that differs and is not read."""
    if any(effective_notes(file, None)[0].name_pattern for file in files):
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


def expand_sources(files: Sources) -> list[Any]:
    """Return paths and frames, patterns expanded to their files; raise `UserError` for a pattern without a match."""
    if is_frame(files):
        return [files]
    if isinstance(files, str | Path):
        return list(_expanded(Path(files)))
    found = [source for file in files for source in expand_sources(file)]
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
    """Return a key that sorts run_2 before run_10."""
    return [int(part) if part.isdigit() else part.lower() for part in re.split(r"(\d+)", name)]


def as_notes(notes: Mapping[str, Any] | MeasurementNotes | None) -> MeasurementNotes:
    """Return validated notes; raise `UserError` for an unknown key or an invalid value."""
    if isinstance(notes, MeasurementNotes):
        return notes
    try:
        return MeasurementNotes.model_validate(dict(notes or {}))
    except ValidationError as error:
        raise UserError(
            sentences(error, MeasurementNotes, lambda at: "the notes").replace("of a study", "of notes")
        ) from None


def _joined_by(source: Any, stated: MeasurementNotes) -> Path | None:
    """Return the file that a file's notes join."""
    if is_frame(source):
        return None
    notes, _ = effective_notes(source, stated)
    return None if notes.join is None else (source.parent / notes.join.file).resolve()


def together(measurements: Sequence[Measurement]) -> Measurement:
    """Return all runs in order; outputs that only some files have are missing in the others.

    A specimen that occurs in several files continues from one to the next. A run whose name is taken by an earlier file
    gets its file's name as a prefix.

    Raises:
        UserError: files that are the same, or that have different inputs or marker positions.
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
    """Return the remarks on the files; identical remarks on several files are merged."""
    said: dict[str, list[tuple[Remark, str]]] = {}
    for m in measurements:
        for remark in m.remarks:
            if remark != ONE_RUN and not remark.endswith(NEVER_CHANGES):
                said.setdefault(remark, []).append((Remark.from_text(remark), m.source))
    return tuple(_remark_on_files(same[0][0], [source for _, source in same]) for same in said.values())


def _remark_on_files(remark: Remark, sources: Sequence[str]) -> Remark:
    """Return the remark with the files that it concerns."""
    more = len(sources) - 1
    return remark.from_file(f"{sources[0]} and {more} more file{'s' * (more > 1)}" if more else sources[0])


def _joined(run: MeasuredRun, outputs: Sequence[str], taken: set[str], stem: str) -> MeasuredRun:
    """Return the run with every output, and a unique name."""
    missing = np.full(len(run), np.nan)
    name, number = run.name if run.name not in taken else f"{stem} {run.name}", 2
    while name in taken:
        name, number = f"{stem} {run.name} ({number})", number + 1
    return replace(
        run.with_outputs({output: run.outputs.get(output, missing) for output in outputs}),
        history=run.history.with_(run=name),
    )
