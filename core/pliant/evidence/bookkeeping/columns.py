"""Alternative meanings of columns: another unit, another sign, an exchange with a neighbour."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from pliant.evidence.bookkeeping.mistake import Correction, MistakeKind, ReadingsByName
from pliant.formatting import listed, number
from pliant.measurements.columns import column_si_unit
from pliant.measurements.plausible import as_key
from pliant.records.history import FORCES, History
from pliant.records.measurement import Measurement
from pliant_tables.units import conversion, fits

# Units in common use, by SI unit; a column with a wrong unit was probably written in another one of these.
UNITS = {
    "Pa": ("Pa", "mbar", "kPa", "psi", "bar", "MPa"),
    "rad": ("deg", "rad"),
    "m": ("mm", "cm", "inch", "m"),
    "N": ("mN", "gf", "N", "kgf"),
    "N*m": ("N*mm", "N*cm", "N*m"),
    "kg": ("g", "oz", "kg"),
}
# A factor closer to 1 may be a gain, a stiffness or a wrong law.
LEAST_FACTOR = 2.2
SAME = 0.03  # relative: closer factors of two mistakes cannot be distinguished
AXIS = re.compile(r"(tip|marker_\d+)_([xyz])_m")
JOINT = re.compile(r"joint_(\d+)_angle_rad")
MOST_EXCHANGED = 4  # inputs: up to this number, every order is tried


def column_corrections(measurement: Measurement, outputs: Sequence[str]) -> Iterator[Correction]:
    """Yield alternative meanings of the columns of a recording, readings first."""
    yield from _reading_unit_corrections(measurement, outputs)
    yield from _reading_sign_corrections(measurement, outputs)
    yield from _frames(measurement, outputs)
    yield from _joint_order(measurement, outputs)
    histories = [run.history for run in measurement.runs]
    yield from _input_unit_corrections(measurement, tuple(histories[0].actuation))
    yield from _input_sign_corrections(measurement, tuple(histories[0].actuation))
    yield from _exchanged_inputs(measurement, tuple(histories[0].actuation))


def load_corrections(measurement: Measurement) -> Iterator[Correction]:
    """Yield alternative units and signs of the loads of a recording."""
    signals = [run.history.signals() for run in measurement.runs]
    for name in ("payload_kg", "moment_n_m", *FORCES):
        if not any(np.any(table.get(name, np.zeros(1))) for table in signals):
            continue
        heading = headings(measurement, (name,))
        for words, factor, remedy in _other_units(measurement, (name,)):
            yield Correction(
                "unit", heading, words, remedy, partial(_scaled_load, name, factor), of_load=name
            )
        if name != "payload_kg":
            words = f"{heading[0]} has the wrong sign"
            remedy = f"Multiply {heading[0]} by −1 in the file."
            yield Correction("sign", heading, words, remedy, partial(_scaled_load, name, -1.0), of_load=name)


def headings(measurement: Measurement, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of columns as the file writes them."""
    return tuple(measurement.headed.get(name, name) for name in names)


def _reading_unit_corrections(measurement: Measurement, outputs: Sequence[str]) -> Iterator[Correction]:
    for names in _groups(measurement, outputs):
        where = headings(measurement, names)
        for words, factor, remedy in _other_units(measurement, names):
            yield Correction("unit", where, words, remedy, readings=_times(dict.fromkeys(names, factor)))


def _groups(measurement: Measurement, outputs: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield groups of outputs that share a unit in the file, each group as a whole and then one by one."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in outputs:
        si = column_si_unit(name)
        groups.setdefault((si, measurement.written.get(name, si)), []).append(name)
    for names in groups.values():
        yield tuple(names)
        if len(names) > 1:
            yield from ((name,) for name in names)


def _other_units(measurement: Measurement, names: Sequence[str]) -> Iterator[tuple[str, float, str]]:
    """Yield every other unit of these columns in words, the factor that it means, and what to write.

    Other units of the column come first, then pairs of units that may have been confused when the column was
    converted.
    """
    si = column_si_unit(names[0])
    written, known = measurement.written.get(names[0], si), UNITS.get(si, ())
    if not known or not fits(written, si):
        return
    where = headings(measurement, names)
    sizes = {unit: conversion(unit, si, names[0])[0] for unit in known}
    here = conversion(written, si, names[0])[0]
    told: list[float] = []
    for other, size in sizes.items():
        factor = size / here
        if max(factor, 1.0 / factor) >= LEAST_FACTOR:
            told.append(factor)
            keys = ", ".join(f"{as_key(name)}: {other}" for name in where)
            words = f"{listed(where)} {_are(where)} in {other}, not in {written} (a factor of {number(factor, 4)})"
            yield words, factor, f"Write 'units: {{{keys}}}' into the notes of the recording."
    for (one, size), (other, another) in itertools.permutations(sizes.items(), 2):
        factor = size / another
        if max(factor, 1.0 / factor) >= LEAST_FACTOR and not any(abs(factor / f - 1.0) < SAME for f in told):
            told.append(factor)
            names_text, times = listed(where), number(factor, 4)
            words = f"{names_text} {_are(where)} {one} that {_were(where)} taken for {other} (a factor of {times})"
            yield (
                words,
                factor,
                f"Look at how {names_text} {_were(where)} converted, and multiply by {times}.",
            )


def _reading_sign_corrections(measurement: Measurement, outputs: Sequence[str]) -> Iterator[Correction]:
    for name in outputs:
        if not AXIS.fullmatch(name):
            where = headings(measurement, (name,))
            words = f"{where[0]} has the wrong sign"
            remedy = f"Multiply {where[0]} by −1 in the file, or look at which chamber is which in 'chain.actuators'."
            yield Correction("sign", where, words, remedy, readings=_times({name: -1.0}))
    angles = [name for name in outputs if not AXIS.fullmatch(name)]
    if len(angles) > 1:
        where = headings(measurement, angles)
        words = f"{listed(where)} have the wrong sign"
        remedy = f"Multiply {listed(where)} by −1 in the file."
        yield Correction("sign", where, words, remedy, readings=_times(dict.fromkeys(angles, -1.0)))


def _frames(measurement: Measurement, outputs: Sequence[str]) -> Iterator[Correction]:
    """Yield other axes of the camera: every order of the axes that were read, with every sign."""
    axes = sorted({match[2] for name in outputs if (match := AXIS.fullmatch(name))})
    bodies = sorted({match[1] for name in outputs if (match := AXIS.fullmatch(name))})
    whole = all(f"{body}_{axis}_m" in outputs for body in bodies for axis in axes)
    if not axes or not whole:
        return
    for order in itertools.permutations(axes):
        for signs in itertools.product((1.0, -1.0), repeat=len(axes)):
            if order == tuple(axes) and min(signs) > 0.0:
                continue
            moved = [(a, s, b) for a, s, b in zip(axes, signs, order, strict=True) if a != b or s < 0.0]
            table = {f"{body}_{a}_m": (s, f"{body}_{b}_m") for body in bodies for a, s, b in moved}
            where = headings(measurement, sorted({source for _, source in table.values()}))
            what = ", ".join(f"{a} = {'−' * (s < 0.0)}{b} of the file" for a, s, b in moved)
            kind: MistakeKind = "sign" if order == tuple(axes) else "exchanged"
            words = f"the positions have other axes: {what}"
            remedy = (
                "Rename the columns of positions, or multiply them by −1, so that their axes are the world's."
            )
            yield Correction(kind, where, words, remedy, readings=partial(_in_frame, table))


def _joint_order(measurement: Measurement, outputs: Sequence[str]) -> Iterator[Correction]:
    joints = sorted((name for name in outputs if JOINT.fullmatch(name)), key=_joint_number)
    if len(joints) > 1:
        table = {name: (1.0, other) for name, other in zip(joints, reversed(joints), strict=True)}
        where = headings(measurement, joints)
        words = "the joints are counted from the tip"
        remedy = "Number the joints from the base on."
        yield Correction("exchanged", where, words, remedy, readings=partial(_in_frame, table))
    if len(joints) > 2:
        for a, b in itertools.combinations(joints, 2):
            yield _exchanged_readings(measurement, a, b)


def _exchanged_readings(measurement: Measurement, a: str, b: str) -> Correction:
    where = headings(measurement, (a, b))
    words = f"{where[0]} and {where[1]} are exchanged"
    remedy = f"Exchange the columns {where[0]} and {where[1]}, or rename them."
    table = {a: (1.0, b), b: (1.0, a)}
    return Correction("exchanged", where, words, remedy, readings=partial(_in_frame, table))


def _input_unit_corrections(measurement: Measurement, inputs: Sequence[str]) -> Iterator[Correction]:
    for names in _groups(measurement, inputs):
        where = headings(measurement, names)
        for words, factor, remedy in _other_units(measurement, names):
            change = partial(_mapped, dict.fromkeys(names, factor))
            yield Correction("unit", where, words, remedy, inputs=change, drive=factor)


def _input_sign_corrections(measurement: Measurement, inputs: Sequence[str]) -> Iterator[Correction]:
    where = headings(measurement, inputs)
    words = f"{listed(where)} {'has' if len(where) == 1 else 'have'} the wrong sign"
    remedy = f"Multiply {listed(where)} by −1 in the file, or look at the signs in 'chain.actuators'."
    change = partial(_mapped, dict.fromkeys(inputs, -1.0))
    yield Correction("sign", where, words, remedy, inputs=change)


def _exchanged_inputs(measurement: Measurement, inputs: Sequence[str]) -> Iterator[Correction]:
    if len(inputs) < 2:
        return
    pairs = [{a: b, b: a} for a, b in itertools.combinations(inputs, 2)]
    cycles = (
        [dict(zip(inputs, order, strict=True)) for order in itertools.permutations(inputs)]
        if 2 < len(inputs) <= MOST_EXCHANGED
        else []
    )
    cycles = [cycle for cycle in cycles if sum(a != b for a, b in cycle.items()) > 2]
    for order in (*pairs, *cycles):
        moved = {a: b for a, b in order.items() if a != b}
        where = headings(measurement, tuple(moved))
        words = f"{listed(where)} are exchanged"
        pairs_text = ", ".join(
            f"{as_key(mine)}: {other}"
            for other, mine in zip(moved, headings(measurement, tuple(moved.values())), strict=True)
        )
        remedy = (
            f"Look at which chamber is which: write 'rename: {{{pairs_text}}}' into the notes of the recording, or "
            "exchange the inputs and their signs in 'chain.actuators'."
        )
        yield Correction("exchanged", where, words, remedy, inputs=partial(_reordered, moved))


def _are(where: Sequence[str]) -> str:
    return "is" if len(where) == 1 else "are"


def _were(where: Sequence[str]) -> str:
    return "was" if len(where) == 1 else "were"


def _joint_number(name: str) -> int:
    match = JOINT.fullmatch(name)
    assert match is not None
    return int(match[1])


def _times(factors: Mapping[str, float]) -> Callable[[ReadingsByName], ReadingsByName]:
    return lambda readings: {name: factors.get(name, 1.0) * values for name, values in readings.items()}


def _in_frame(table: Mapping[str, tuple[float, str]], readings: ReadingsByName) -> ReadingsByName:
    """Return the readings, with those named in `table` replaced by a sign times another reading."""
    moved = {name: sign * readings[source] for name, (sign, source) in table.items()}
    return {**readings, **moved}


def _mapped(factors: Mapping[str, float], history: History) -> History:
    return history.with_actuation(**{n: f * history.actuation[n] for n, f in factors.items()})


def _reordered(order: Mapping[str, str], history: History) -> History:
    return history.with_actuation(**{name: history.actuation[other] for name, other in order.items()})


def _scaled_load(name: str, factor: float, history: History) -> History:
    if name == "moment_n_m":
        return history.with_(moment_n_m=factor * history.moment_n_m)
    if name == "payload_kg":
        return (
            history if history.payload_kg is None else history.with_(payload_kg=factor * history.payload_kg)
        )
    scale = np.ones(3)
    scale[FORCES.index(name)] = factor
    return history.with_(tip_force_n=history.tip_force_n * scale)
