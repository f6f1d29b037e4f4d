"""A recording without a study: its measurement, and the `measurements` block that reads it again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pliant.errors import UserError
from pliant.measurements.block import asked
from pliant.measurements.files import read_measurements
from pliant.measurements.header import HalfError
from pliant.records.measurement import Measurement

OWN_MODEL = "A recording for a model of your own has the columns of its study: pliant import {file} --study STUDY.yaml"


def read_recording(files: Any, notes: Mapping[str, Any]) -> tuple[Measurement, dict[str, Any]]:
    """Return the measurement and the keys of the block that reads it, `file` first.

    Args:
        files: a path, a pattern, a pandas frame, or several of them, which are runs in their order.
        notes: keys of a `measurements` block except `file`; they precede the YAML that accompanies each file.

    Raises:
        UserError: unreadable or ambiguous files; for these the message ends in the block with the lines to choose from.
    """
    sources = files if isinstance(files, list | tuple) else [files]
    named = [str(file) for file in sources if isinstance(file, str | Path)]
    block = {**({"file": named[0] if len(named) == 1 else named} if named else {}), **notes}
    try:
        return read_measurements(files, notes), block
    except UserError as error:
        found = asked(error, block)
        if isinstance(error, HalfError) and error.lacks == "inputs":
            found = UserError(f"{found}\n{OWN_MODEL.format(file=named[0] if named else 'FILE')}")
        raise found from None
