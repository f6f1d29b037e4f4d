"""Several files of one bench as one measurement, in the order in which they were recorded."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.measurements.reading import NEVER_CHANGES, ONE_RUN
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.records.remark import Remark


def together(measurements: Sequence[Measurement]) -> Measurement:
    """All runs in order; outputs that only some files have are missing in the others.

    A specimen that stands in several files goes on from one to the next. A run whose name was taken by an earlier
    file gets its file's name before its own.

    Raises:
        UserError: files that are the same, or that have different inputs or places of their markers.
    """
    if len(measurements) == 1:
        return measurements[0]
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
        _remarks(measurements),
        next(iter(arms), ((), ()))[0],
        digest if any(m.sha256 for m in measurements) else "",
        tuple(dict.fromkeys(doubt for m in measurements for doubt in m.doubts)),
        {name: unit for m in reversed(measurements) for name, unit in m.written.items()},
        {name: heading for m in reversed(measurements) for name, heading in m.headed.items()},
        next(iter(arms), ((), ()))[1],
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
