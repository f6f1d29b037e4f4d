"""One run on the bench: samples to disk as they come in, the stop file, the watches, and the recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant_bench.bench import (
    Bench,
    BenchProtocol,
    BenchRecording,
    BenchSample,
    Ending,
    RunStoppedError,
    Watch,
)
from pliant_bench.loop.folder import ExperimentFolder, RoundFolder, SampleLog, write_recording
from pliant_bench.performed import performed_minutes, performed_words

STOP_BUTTON = "The stop button was pressed."
# A run with fewer samples says nothing, and is left out of the measurement.
FEWEST_SAMPLES = 5
CUT_OFF = "The program was stopped during this run."


def perform(
    bench: Bench,
    protocol: BenchProtocol,
    experiment: ExperimentFolder,
    folder: RoundFolder,
    watches: Sequence[Watch],
) -> BenchRecording:
    """Perform a run whose plan is on disk; every sample is written before it is looked at.

    Raises:
        KeyboardInterrupt: after the bench has vented and the recording is written.
    """
    log = SampleLog(folder.samples, protocol, tuple(channel.name for channel in bench.outputs))

    def watch(sample: BenchSample) -> None:
        log.write(sample)
        if experiment.stop_file.exists():
            raise RunStoppedError(STOP_BUTTON)
        for one in watches:
            one(sample)

    try:
        recording = bench.run(protocol, watch)
    except BaseException:
        log.close()
        record_from_samples(folder)
        raise
    log.close()
    finish(folder, recording)
    return recording


def finish(folder: RoundFolder, recording: BenchRecording) -> None:
    """Write the measurement file of a run, then how it ended."""
    plan = folder.read("plan") or {}
    conditions = {**plan.get("setting", {}), **plan["conditions"]}
    usable = np.isfinite(recording.commanded_s).sum() >= FEWEST_SAMPLES
    if usable:
        write_recording(folder.recording, recording, plan["name"], plan.get("specimen", "1"), conditions)
    delay = recording.read_s - recording.commanded_s
    folder.write(
        "recording",
        {
            "ending": recording.ending,
            "reason": recording.reason,
            "words": performed_words(recording),
            "minutes": performed_minutes(recording, plan["minutes"]),
            "samples": len(recording),
            "planned_samples": len(recording.protocol),
            "late": np.flatnonzero(recording.late).tolist(),
            "unread": int(sum(np.isnan(v).sum() for v in recording.readings.values())),
            "read_delay_s": float(np.nanmedian(delay)) if np.isfinite(delay).any() else None,
            "duration_s": float(np.nanmax(recording.commanded_s)) if usable else 0.0,
            "is_data": bool(usable),
        },
    )


def record_from_samples(folder: RoundFolder, ending: Ending = "lost", reason: str = CUT_OFF) -> None:
    """Write the recording of a run that was cut off, from the samples on disk."""
    finish(folder, replace(folder.read_recording(), ending=ending, reason=reason))
