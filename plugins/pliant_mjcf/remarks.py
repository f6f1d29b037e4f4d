"""Sentences on runs of a MuJoCo model that limit a comparison."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import number
from pliant.interfaces.model import Drive
from pliant_mjcf.channels import Driven
from pliant_mjcf.stepping import NEVER, March

CHATTER = 0.25  # share of the steps at which the number of contacts changes
ROUNDING = 1e-6  # of a range


def run_remarks(march: March, drives: Sequence[Drive], inputs: Sequence[Driven]) -> tuple[str, ...]:
    """Return the remarks on runs before their first step: their inputs, their stability and their contacts."""
    clamped = _clamped(march, drives, inputs)
    changed = np.zeros(len(drives))
    before = np.full(len(drives), -1)
    for piece in march.pieces(("ncon",)):
        counts = piece.records["ncon"].reshape(len(piece.runs), -1)
        inside = np.concatenate([before[piece.runs, None], counts], axis=1)
        changes = np.diff(inside, axis=1) != 0
        changed[piece.runs] += changes.sum(axis=1) - (changes[:, 0] & (inside[:, 0] < 0))
        before[piece.runs] = counts[:, -1]
    return (*clamped, *_diverged(march, drives), *_chattering(march, drives, changed))


def _clamped(march: March, drives: Sequence[Drive], inputs: Sequence[Driven]) -> list[str]:
    """Return a remark on each input that leaves the range of its actuator."""
    said = []
    for one in inputs:
        k = one.actuator
        if not march.model.actuator_ctrllimited[k]:
            continue
        low, high = (float(end) for end in march.model.actuator_ctrlrange[k])
        slack = ROUNDING * (high - low)
        runs = [
            drive.history.run
            for drive, course in zip(drives, march.courses, strict=True)
            if ((course.control[:, k] < low - slack) | (course.control[:, k] > high + slack)).any()
        ]
        if runs:
            said.append(
                f"Input '{one.channel.name}' leaves the range of {one.channel.label}, {number(low)} to {number(high)}, "
                f"in {_runs(runs)}: MuJoCo cuts it off there."
            )
    return said


def _diverged(march: March, drives: Sequence[Drive]) -> list[str]:
    """Return a remark on the runs that diverge, with the earliest time."""
    failed = np.flatnonzero(march.failed_at != NEVER)
    if not len(failed):
        return []
    first = int(failed[np.argmin(march.failed_at[failed])])
    time_s = float(march.failed_at[first]) * float(march.model.opt.timestep)
    runs = _runs([drives[k].history.run for k in failed.tolist()])
    more = f", the first in '{drives[first].history.run}'" if len(failed) > 1 else ""
    return [
        f"The simulation of {runs} diverges from {number(time_s)} s on{more}; what follows is not compared."
    ]


def _chattering(march: March, drives: Sequence[Drive], changed: NDArray[np.float64]) -> list[str]:
    """Return a remark on runs in which contacts are made and broken all the time."""
    steps = [min(course.steps, failed) for course, failed in zip(march.courses, march.failed_at, strict=True)]
    shares = changed / np.maximum(np.array(steps) - 1, 1)
    runs = [drives[k].history.run for k in np.flatnonzero(shares > CHATTER).tolist()]
    if not runs:
        return []
    return [
        f"Contacts chatter in {_runs(runs)}: they are made or broken at {shares.max():.0%} of the steps; softer "
        "contacts (solref) or a smaller timestep give readings that can be compared."
    ]


def _runs(names: Sequence[str]) -> str:
    """Return the runs in words, a few of them by name."""
    if len(names) == 1:
        return f"run '{names[0]}'"
    shown = ", ".join(f"'{name}'" for name in names[:3])
    return f"{len(names)} runs ({shown}{', …' if len(names) > 3 else ''})"
