"""Sensor quantities that a recording leaves undetermined: the rotation of a camera's frame and unknown zeros.

Both are linear in the readings and are refitted for every prediction by least squares:

    positions   y = R p + t,  R = argmin Σ |y − R p|²  (Wahba 1965, SIAM Review 7, 409; solved by the singular value
                decomposition of Σ p yᵀ, Markley 1988, J. Astronaut. Sci. 36, 245)
    pairs       the same in the plane of the module's y and z: bends or curvatures about two axes
    zeros       t = mean(y − R p), over all runs or over each run

so that errors, their derivatives and fits are those after the fit of these numbers (variable projection, Golub and
Pereyra 1973, SIAM J. Numer. Anal. 10, 413).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np

from pliant.config.measurements import PER_RUN
from pliant.errors import UserError
from pliant.formatting import number
from pliant.mechanics.rotations import matrix_from_quaternion, quaternion_from_matrix
from pliant.records.design import Array
from pliant.records.measurement import Measurement, SensorFrame

POSITION = re.compile(r"(tip|marker_\d+)_[xyz]_m")
PAIR = re.compile(r"(angle|joint_\d+_angle|curvature)_[yz]_(rad|1_per_m)")
FLAT = 1e-3  # of the longest extent: thinner positions are collinear, with no unique rotation
RunReadings = dict[str, Array]


@dataclass(frozen=True, eq=False)
class Turns:
    """The rotation of positions (3, 3) and of pairs (2, 2); None where nothing is rotated."""

    positions: Array | None = None
    pairs: Array | None = None


@dataclass(frozen=True, eq=False)
class RecordingSession:
    """Runs that were recorded in one frame."""

    pattern: str
    runs: tuple[int, ...]
    fixed: Turns | None


@dataclass(frozen=True, eq=False)
class Alignment:
    """The transformation of predicted readings into the sensors' frames and zeros.

    Attributes:
        measurement: the readings, with their frames and free zeros.
        sessions: the frames and their runs; empty where nothing is rotated.
    """

    measurement: Measurement
    sessions: tuple[RecordingSession, ...] = ()

    @staticmethod
    def from_measurement(measurement: Measurement) -> Alignment:
        """Return the alignment that a measurement asks for.

        Raises:
            UserError: a frame that does not fit what is read, or a run that has none.
        """
        sessions, taken = [], set[int]()
        for pattern, frame in measurement.frames.items():
            fits = [k for k, run in enumerate(measurement.runs) if fnmatchcase(run.name, pattern)]
            chosen = tuple(k for k in fits if k not in taken)
            taken.update(chosen)
            sessions.append(RecordingSession(pattern, chosen, _fixed(frame)))
            if frame.unknown:
                _check_told(replace(measurement, runs=tuple(measurement.runs[k] for k in chosen)))
        if measurement.frames and len(taken) < len(measurement.runs):
            lost = next(run.name for k, run in enumerate(measurement.runs) if k not in taken)
            raise UserError(
                f"{measurement.source}: run '{lost}' fits none of the patterns of 'frame: {{turn: …}}': "
                f"{', '.join(measurement.frames)}."
            )
        return Alignment(measurement, tuple(sessions))

    @property
    def idle(self) -> bool:
        """Return whether predictions are compared without any transformation."""
        return not self.sessions and not self.measurement.free_zeros

    @property
    def has_readings(self) -> bool:
        return self.measurement.n_samples > 0

    def frozen(self, turns: Sequence[Turns], measurement: Measurement) -> Alignment:
        """Return the alignment for other runs without readings: the first session's rotations, no zeros."""
        every = tuple(range(len(measurement.runs)))
        blank = replace(measurement, free_zeros={})
        return Alignment(blank, tuple(RecordingSession("*", every, one) for one in turns[:1]))

    def turns(self, runs: Sequence[RunReadings]) -> tuple[Turns, ...]:
        """Return the rotations of each session: given, or those that bring predictions closest to the readings."""
        found = []
        for session in self.sessions:
            part = replace(self.measurement, runs=tuple(self.measurement.runs[k] for k in session.runs))
            fixed = session.fixed
            found.append(_estimated(part, [runs[k] for k in session.runs]) if fixed is None else fixed)
        return tuple(found)

    def applied(self, runs: Sequence[RunReadings], own: bool = True) -> tuple[RunReadings, ...]:
        """Return predictions as the sensors read them.

        Args:
            runs: by run, outputs in the frames of the world and the module; all components of what is rotated.
            own: whether they are predictions of the measured runs, to whose readings free zeros can be fitted.
        """
        turned = [dict(run) for run in runs]
        for session, turns in zip(self.sessions, self.turns(runs), strict=True):
            for k in session.runs:
                turned[k] = _turned(runs[k], turns)
        if own:
            for name, how in self.measurement.free_zeros.items():
                if name in turned[0]:
                    _shift(turned, self.measurement, name, how == PER_RUN)
        return tuple(turned)

    def sentences(self, turns: Sequence[Turns]) -> list[str]:
        """Return sentences on what was fitted besides the model, with the lines of notes that fix it."""
        said, lines, numbers = [], {}, 0
        for session, one in zip(self.sessions, turns, strict=True):
            if session.fixed is None:
                text, line, more = _told(one)
                numbers += more
                lines[session.pattern] = line
                where = "" if session.pattern == "*" else f" in the runs {session.pattern}"
                said.append(f"{text}{where}, as fitted to the readings.")
        if lines:
            line = ", ".join(text if name == "*" else f'"{name}": {text}' for name, text in lines.items())
            line = line if "*" in lines else f"{{{line}}}"
            many = "Three numbers were" if numbers == 3 else f"{numbers} numbers were"
            said[-1] += (
                f" {many} fitted beside the model's own; "
                f"to keep them for other runs write 'frame: {{turn: {line}}}'."
            )
        per_run = [n for n, how in self.measurement.free_zeros.items() if how == PER_RUN]
        of_all = [n for n in self.measurement.free_zeros if n not in per_run]
        for names, whose in ((per_run, "each run"), (of_all, "all runs")):
            if names:
                said.append(
                    f"{', '.join(names)}: the zero of {whose} is unknown and was fitted to the readings."
                )
        return said


def _fixed(frame: SensorFrame) -> Turns | None:
    if frame.quaternion is not None:
        return Turns(positions=matrix_from_quaternion(np.asarray(frame.quaternion, float)))
    if frame.angle_rad is not None:
        c, s = np.cos(frame.angle_rad), np.sin(frame.angle_rad)
        return Turns(pairs=np.array([[c, s], [-s, c]]))
    return None


def _told(turns: Turns) -> tuple[str, str, int]:
    """Return the beginning of a sentence on an estimated rotation, its value as in notes, and its count of numbers."""
    if turns.positions is not None:
        q = quaternion_from_matrix(turns.positions)
        angle = 2.0 * np.degrees(np.arccos(np.clip(abs(q[0]), 0.0, 1.0)))
        line = ", ".join(f"{value:.6g}" for value in q)
        return f"The camera's frame is turned by {number(angle, 4)}° against the world", f"[{line}]", 3
    assert turns.pairs is not None
    angle = np.degrees(np.arctan2(turns.pairs[0, 1], turns.pairs[0, 0]))
    return f"The bend sensors are turned by {number(angle, 4)}° about the chain axis", f"{angle:.6g} deg", 1


def _estimated(measurement: Measurement, runs: Sequence[RunReadings]) -> Turns:
    """Return the rotations that bring predictions closest to the readings."""
    stems, pairs = _complete(measurement.outputs, POSITION, "xyz"), _pairs(measurement.outputs)
    return Turns(
        _turn([[f"{s}_{a}_m" for a in "xyz"] for s in stems], measurement, runs) if stems else None,
        _turn(pairs, measurement, runs) if pairs else None,
    )


def _check_told(measurement: Measurement) -> None:
    """Raise `UserError` where the readings of the runs do not determine the rotation of their frame."""
    stems, pairs = _complete(measurement.outputs, POSITION, "xyz"), _pairs(measurement.outputs)
    if not stems and not pairs:
        raise UserError(
            f"{measurement.source}: 'frame: {{turn: unknown}}' needs x, y and z of a position, or y and z of a "
            f"bend or curvature, and the file has {', '.join(measurement.outputs)}."
        )
    for stem in stems:
        _check_spread(measurement, [f"{stem}_{axis}_m" for axis in "xyz"])


def _check_spread(measurement: Measurement, names: Sequence[str]) -> None:
    """Raise `UserError` where positions lie on a line through zero, so that the rotation about it is undetermined."""
    how = [measurement.free_zeros.get(name) for name in names]
    if len(set(how)) > 1:
        raise UserError(
            f"{measurement.source}: 'zero' leaves only some of {', '.join(names)} open, and in a frame whose "
            "turn is unknown they belong together: say the same of each."
        )
    read = [np.stack([run.outputs[name] for name in names], axis=1) for run in measurement.runs]
    read = [rows[np.isfinite(rows).all(axis=1)] for rows in read]
    whole = np.concatenate([np.zeros((0, len(names))), *_centred(read, how[0])])
    sizes = np.linalg.svd(whole, compute_uv=False) if len(whole) > 1 else np.zeros(2)
    if sizes[0] > 0.0 and sizes[1] < FLAT * sizes[0]:
        raise UserError(
            f"{measurement.source}: {', '.join(names)} lie on one line in all readings, which do not determine the "
            "rotation of their frame about it: write 'frame: {turn: [w, x, y, z]}'."
        )


def _centred(tables: Sequence[Array], how: str | None) -> list[Array]:
    """Return vectors (t, 3) of each run minus their mean: of each run, of all runs, or unchanged."""
    if how is None or not any(map(len, tables)):
        return list(tables)
    if how == PER_RUN:
        return [rows - rows.mean(axis=0) if len(rows) else rows for rows in tables]
    mean = np.concatenate(tables).mean(axis=0)
    return [rows - mean for rows in tables]


def components(name: str) -> list[str]:
    """Return the outputs that are rotated together with one: x, y and z of a position, y and z of a pair."""
    if POSITION.fullmatch(name):
        return [f"{name[:-3]}{axis}_m" for axis in "xyz"]
    if match := PAIR.fullmatch(name):
        return [f"{match[1]}_{axis}_{match[2]}" for axis in "yz"]
    return []


def _complete(outputs: Sequence[str], pattern: re.Pattern[str], axes: str) -> list[str]:
    """Return the stems of which all axes are read."""
    stems = dict.fromkeys(match[1] for name in outputs if (match := pattern.fullmatch(name)))
    return [stem for stem in stems if all(f"{stem}_{axis}_m" in outputs for axis in axes)]


def _pairs(outputs: Sequence[str]) -> list[list[str]]:
    pairs = [components(name) for name in outputs if PAIR.fullmatch(name)]
    return [list(pair) for pair in dict.fromkeys(map(tuple, pairs)) if all(name in outputs for name in pair)]


def _turn(vectors: Sequence[Sequence[str]], measurement: Measurement, runs: Sequence[RunReadings]) -> Array:
    """Return the proper rotation R that minimizes Σ |y − R p|², each term scaled by its unit's size."""
    width = len(vectors[0])
    product = np.zeros((width, width))
    for names in vectors:
        read = [np.stack([run.outputs[n] for n in names], axis=1) for run in measurement.runs]
        said = [np.stack([run[n] for n in names], axis=1) for run in runs]
        there = [
            np.isfinite(y).all(axis=1) & np.isfinite(p).all(axis=1) for y, p in zip(read, said, strict=True)
        ]
        y, p = ([v[keep] for v, keep in zip(table, there, strict=True)] for table in (read, said))
        how = measurement.free_zeros.get(names[0])
        blank = np.zeros((0, width))
        ys, ps = (np.concatenate([blank, *_centred(table, how)]) for table in (y, p))
        scale = float((ys**2).sum())
        if scale > 0.0:
            product += ps.T @ ys / scale
    left, sizes, right = np.linalg.svd(product)
    if sizes[0] <= 0.0:  # nothing was read, or the prediction has no value
        return np.eye(width)
    signs = np.ones(width)
    signs[-1] = np.sign(np.linalg.det(right.T @ left.T))
    return np.asarray(right.T @ np.diag(signs) @ left.T)


def _turned(run: RunReadings, turns: Turns) -> RunReadings:
    turned = dict(run)
    for pattern, turn in ((POSITION, turns.positions), (PAIR, turns.pairs)):
        if turn is None:
            continue
        for name in run:
            if pattern.fullmatch(name):
                names = components(name)
                row = turn[names.index(name)]
                turned[name] = np.asarray(sum(row[k] * run[other] for k, other in enumerate(names)))
    return turned


def _shift(runs: Sequence[RunReadings], measurement: Measurement, name: str, per_run: bool) -> None:
    """Add to an output's predictions the offset, per run or over all, that brings them closest to the readings."""
    misses = [m.outputs[name] - run[name] for m, run in zip(measurement.runs, runs, strict=True)]
    finite = [miss[np.isfinite(miss)] for miss in misses]
    whole = np.concatenate(finite)
    for run, own in zip(runs, finite, strict=True):
        chosen = own if per_run else whole
        if len(chosen):
            run[name] = run[name] + chosen.mean()
