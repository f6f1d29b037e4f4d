"""The blocks `printer`, `solid` and `mould`, and the functions that `pliant export` and a search call."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.block import Block
from pliant.registry.function import Function
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3
HERE = "pliant_print"


@hookimpl
def pliant_blocks() -> Iterable[Block]:
    """Return the blocks about the thing in the hand; simulations do not read them."""
    return [
        Block("printer", f"{HERE}.config:PrinterConfig", description="limits of the printer, for `export`"),
        Block("solid", f"{HERE}.config:SolidConfig", description="cap, flange and inlets that `export` adds"),
        Block("mould", f"{HERE}.config:MouldConfig", description="the mould of `export --mould`"),
    ]


@hookimpl
def pliant_functions() -> Iterable[Function]:
    """Return the functions that other packages call."""
    return [
        Function("export_solid", f"{HERE}.export:export_solid"),
        Function("export_mould", f"{HERE}.export:export_mould"),
        Function("thinnest_wall", f"{HERE}.solids:thinnest_wall_m"),
    ]
