"""Proposals for missing columns of a recording: by name, unit and content, to paste into its notes."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pliant.errors import closest
from pliant.formatting import plural
from pliant.measurements.columns import EXAMPLES, MEASUREMENT, column_si_unit
from pliant.measurements.plausible import as_key, epoch_unit, likely_unit
from pliant.records.design import Array
from pliant.records.measurement import Doubt
from pliant_tables.cells import looks_numeric, number_in
from pliant_tables.names import bare, is_counter, step_motor_number
from pliant_tables.preamble import rates
from pliant_tables.proposals import (
    Proposed,
    is_command,
    likely,
    lines_to_write,
    plain_words,
    proposed,
)
from pliant_tables.sheet import Sheet
from pliant_tables.side_by_side import group_numbered_names
from pliant_tables.units import stem, unit_at_the_end, unit_in

# Columns that a file may lack: an input, a reading.
DRIVES = ("pressure_pa", "tendon_force_n", "tendon_travel_m")
READ = ("angle_rad", "elongation_strain", "extension_m", "tip_x_m", "tip_y_m", "tip_z_m")
TRAVEL = "tendon_travel"
STEP = "1 mm  # <- what one step pulls in: the file does not say"
FRAME_LINE = "# frame: {turn: unknown}  # where the camera's axes are not the world's: z is up"
# Names of recordings, and of bodies, besides those that are recognised without notes (pliant_tables.names).
RUNS = re.compile(
    r"(trial|test|take|rep|repetition|repeat|experiment|exp|lauf|wiederholung)( (no|nr|number|id|name|#))?"
)
BODIES = re.compile(r"(subject|sample|finger|body|actuator)( (no|nr|number|id|name|#))?")
POSITION = re.compile(r"(.*?)[\s_:.-]*([xyz])(?: ?\[\w+\])?", re.IGNORECASE)
LIKE = 0.6  # likeness of two names, without their units, from which one may be a misspelling of the other
TIP = re.compile(r"\b(tip|end|spitze|distal|effector)", re.IGNORECASE)


def block_to_paste(
    sheet: Sheet, notes_name: str, unknown: Sequence[str], inputs: Sequence[str], outputs: Sequence[str]
) -> str:
    """Return the lines that would identify the unknown columns; an empty text if there is evidence for none.

    Args:
        sheet: the open file.
        notes_name: where the lines belong.
        unknown: columns without a meaning so far.
        inputs, outputs: what the file lacks; an empty list if it has some.
    """
    numbers = {name: values for name in unknown if (values := _numbers(sheet, name)) is not None}
    columns = ["time_s", *inputs, *outputs]
    proposal = proposed(list(numbers), {name: column_si_unit(name) for name in columns})
    for name, meant in proposal.rename.items():
        if near := closest_column(name):
            proposal.rename[name] = (
                near if bare(name).lower() != stem(name).lower() or near == meant else meant
            )
    if any(name in DRIVES or name.startswith(TRAVEL) for name in inputs):
        _motors(proposal, list(numbers))
    if tuple(inputs) == DRIVES:
        _numbered(proposal, list(numbers), "pressure_pa", "pressure_{}_pa")
    if "angle_rad" in outputs:
        _numbered(proposal, list(numbers), "angle_rad", "joint_{}_angle_rad")
    _markers(proposal, list(numbers))
    _by_size(proposal, numbers)
    units = {name: unit for name, unit in proposal.units.items() if MEASUREMENT.find(proposal.rename[name])}
    named = runs_named(sheet, unknown) if proposal.rename else {}
    rename = {
        name: {**named, **proposal.rename}[name] for name in unknown if name in {**named, **proposal.rename}
    }
    reasons = {**dict.fromkeys(named, "by its name, and it stays the same over rows"), **proposal.reasons}
    positions = any(re.match("tip_|marker_", meant) for meant in proposal.rename.values())
    more = [FRAME_LINE] if positions else []
    return lines_to_write(sheet.path, notes_name, rename, units, reasons, more)


def _numbers(sheet: Sheet, name: str) -> Array | None:
    """Return the numbers of a column in the first rows; None for a column of texts."""
    place = sheet.header.index(name)
    cells = [row[place].strip() for row in sheet.sample if place < len(row)]
    filled = [cell for cell in cells if cell]
    if not filled:
        return np.zeros(0)
    if 2 * sum(looks_numeric(cell, replace(sheet.marks, comma=True)) for cell in filled) < len(filled):
        return None
    values = [number_in(cell, sheet.marks) for cell in filled]
    return np.array([np.nan if value is None else value for value in values], float)


def _by_size(proposal: Proposed, numbers: Mapping[str, Array]) -> None:
    """Assign units to columns without one by the size of their values; positions share one unit."""
    for name, meant in proposal.rename.items():
        if meant == "time_s" and name in proposal.units and (unit := epoch_unit(numbers[name])):
            proposal.units[name] = f"{unit}  # by its size: it counts from 1970"
    open_ = {
        name for name in proposal.units if unit_at_the_end(name) is None and proposal.units[name] != STEP
    }
    sizes: dict[str, float] = {}
    kinds = {name: re.sub(r"^(tip|marker_\d+)_[xyz]", "position", proposal.rename[name]) for name in open_}
    for name, kind in kinds.items():
        values = numbers[name][np.isfinite(numbers[name])]
        # Positions have an arbitrary origin: their range indicates how far the tip moves.
        reach = (
            np.ptp(values) if kind.startswith("position") and len(values) else np.abs(values).max(initial=0.0)
        )
        size = float(reach)
        sizes[kind] = max(size, sizes.get(kind, 0.0))
    for name, kind in kinds.items():
        if unit := likely_unit(column_si_unit(proposal.rename[name]), sizes[kind]):
            said = "range" if kind.startswith("position") else "largest value"
            proposal.units[name] = f"{unit}  # by its {said}, {sizes[kind]:.4g}: the file does not say"


def _motors(proposal: Proposed, unknown: Sequence[str]) -> None:
    """Propose motor steps as tendon travels where no other input is identified."""
    for name in unknown:
        if (number := step_motor_number(name)) is not None:
            proposal.rename[name] = f"{TRAVEL}_{number}_m" if number else f"{TRAVEL}_m"
            proposal.units[name] = STEP
            proposal.reasons[name] = "by its name, if the motor pulls a tendon"


def _numbered(proposal: Proposed, unknown: Sequence[str], alone: str, one_of: str) -> None:
    """Propose names that differ only by a number as several chambers or joints, where one was taken for the only one.

    Of two such series of names, as of two boards, the longer one is proposed. Numbers from 0 are shifted to start at 1.
    """
    units = {alone: column_si_unit(alone)}
    speaking = [name for name in unknown if likely(name, units)[0] and not is_command(name)]
    numbered = max(group_numbered_names(speaking).values(), key=len, default={})
    if len(numbered) < 2 or len(set(numbered.values())) < len(numbered):
        return
    for name in speaking:
        for said in (proposal.rename, proposal.units, proposal.reasons):
            said.pop(name, None)
    for name, number in numbered.items():
        proposal.rename[name] = one_of.format(number + (0 in numbered.values()))
        proposal.reasons[name] = likely(name, units)[1]
        if unit_in(name) is None:
            asked = f"{units[alone]}  # or another unit: the file does not say"
            proposal.units[name] = unit_at_the_end(name) or asked


def _markers(proposal: Proposed, unknown: Sequence[str]) -> None:
    """Propose positions of several bodies as markers in their order; the one that is named so is the tip."""
    if not any(meant.startswith("tip_") for meant in proposal.rename.values()):
        return
    bodies: dict[str, dict[str, str]] = {}
    for name in unknown:
        speaks = likely(name, {f"tip_{axis}_m": "m" for axis in "xyz"})[0]
        if speaks and (match := POSITION.fullmatch(name)):
            bodies.setdefault(match[1], {})[name] = match[2].lower()
    if len(bodies) < 2:
        return
    tips = [body for body in bodies if TIP.search(body)]
    number = 0
    for body, axes in bodies.items():
        tip = [body] == tips
        number += not tip
        for name, axis in axes.items():
            proposal.rename[name] = f"tip_{axis}_m" if tip else f"marker_{number}_{axis}_m"
            proposal.reasons[name] = (
                "by its name" if tip else "in the file's order; 'markers' says where each sits"
            )
            if unit_in(name) is None:
                proposal.units.setdefault(
                    name, unit_at_the_end(name) or "m  # or another unit: the file does not say"
                )


def runs_named(sheet: Sheet, unknown: Sequence[str]) -> Mapping[str, str]:
    """Return the columns that may name recordings (as "run") and bodies: by their names, constant over rows.

    A column of bodies without one of recordings is also proposed as the run.
    """
    runs: list[str] = []
    bodies: list[str] = []
    for name in unknown:
        words, place = plain_words(name), sheet.header.index(name)
        cells = [row[place].strip() for row in sheet.sample if place < len(row)]
        changes = sum(a != b for a, b in pairwise(cells))
        if not any(cells) or 2 * changes >= len(cells) - 1:
            continue
        (runs if RUNS.fullmatch(words) else bodies if BODIES.fullmatch(words) else []).append(name)
    if not runs:
        return dict.fromkeys(bodies[:1], "run")
    return {runs[0]: "run", **dict.fromkeys(bodies[:1], "specimen")}


def run_doubts(sheet: Sheet, may_be: Mapping[str, str], notes_name: str) -> list[Doubt]:
    """Return a doubt for each unread column that may name runs, if the first rows have several names."""
    doubts = []
    for name, meant in may_be.items():
        place = sheet.header.index(name)
        kinds = {row[place].strip() for row in sheet.sample if place < len(row)}
        if len(kinds) > 1:
            text = (
                f"{name} has {plural(len(kinds), 'value')}, each over several rows, and is not read; if it names "
                f"{'runs' if meant == 'run' else 'specimens'}, write '{rename_line(name, meant)}' in {notes_name}."
            )
            doubts.append(Doubt(name, "run", text))
    return doubts


def rate_doubts(sheet: Sheet, notes_name: str) -> list[Doubt]:
    """Return a doubt if a table without a clock has the rate of its rows stated above it."""
    stated = sorted(rates(sheet.preamble, sheet.separator))
    text = (
        f"time_s is lacking, and a line above the header states {' and '.join(f'{rate:g}' for rate in stated)} Hz; if "
        f"each row is a sample, write 'rate: {stated[0]:g} Hz' in {notes_name}."
        if stated
        else ""
    )
    return [Doubt("time_s", "rate", text)] if text else []


def rename_line(name: str, meant: str) -> str:
    """Return the line of the notes that renames a column."""
    return f"rename: {{{as_key(name)}: {meant}}}"


def closest_column(name: str) -> str:
    """Return the known column that a name resembles, or an empty text: ``angel_deg`` → angle_deg."""
    near = closest(name.lower(), EXAMPLES)
    stems = [example.rpartition("_")[0] or example for example in EXAMPLES]
    of_stem = difflib.get_close_matches(bare(name).lower(), stems, n=1, cutoff=0.7)
    ending = name[len(bare(name)) :]
    if (
        of_stem
        and unit_at_the_end(name)
        and MEASUREMENT.resolve_column(of_stem[0] + ending, of_stem[0] + ending, None, frozenset())
    ):
        return of_stem[0] + ending
    meant = "" if near == "." else near.split("'")[1]
    alike = difflib.SequenceMatcher(None, plain_words(name), plain_words(meant)).ratio() if meant else 0.0
    unit = unit_in(name)
    fits_unit = (
        unit is None or bool(likely(f"x [{unit}]", {meant: column_si_unit(meant)})[1]) if meant else False
    )
    return meant if alike >= LIKE and fits_unit and not is_counter(name) else ""
