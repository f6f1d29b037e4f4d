"""The verb `pliant calibrate` and its Python functions; nothing that fits is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.command import Command
from pliant.registry.function import Function
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_commands() -> Iterable[Command]:
    """Return the verb that fits constants of a material."""
    return [Command("calibrate", "pliant_calibrate.command:calibrate")]


@hookimpl
def pliant_functions() -> Iterable[Function]:
    """Return the functions that `pliant.api` and `pliant.Study` call."""
    return [
        Function("calibrate", "pliant_calibrate.calibration:calibrate_file"),
        Function("calibration_document", "pliant_calibrate.document:calibration_document"),
        Function("fit_stated_law", "pliant_calibrate.stated_law_fit:fit_stated_law"),
    ]
