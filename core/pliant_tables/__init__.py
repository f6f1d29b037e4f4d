"""Any lab's table: text, spreadsheets, MATLAB, Parquet and pandas frames, with lines of mistakes.

    import pliant_tables

    table = pliant_tables.read("bench.csv")
    table["Pressure (kPa)"], table.units

`read` returns a table unchanged. For tables of one kind, state its columns in a `Schema`: `open_sheet` opens the
file, `Schema.matched` finds the columns under the names and units of any lab, `read_columns` gives their numbers in SI.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = ["Known", "LabTable", "Schema", "StatedNotes", "UserError", "open_sheet", "read", "read_columns"]

if TYPE_CHECKING:
    from pliant_tables.errors import UserError
    from pliant_tables.notes import StatedNotes
    from pliant_tables.opening import open_sheet
    from pliant_tables.schema import Known, Schema, read_columns
    from pliant_tables.table import LabTable, read

_MODULES = {
    "StatedNotes": "notes",
    "UserError": "errors",
    "open_sheet": "opening",
    "LabTable": "table",
    "read": "table",
}


def __getattr__(name: str) -> Any:
    """Import the names of `__all__` on first access: `pliant.errors` imports this package and needs none of them."""
    if name not in __all__:
        raise AttributeError(f"module 'pliant_tables' has no attribute '{name}'")
    return getattr(import_module(f"pliant_tables.{_MODULES.get(name, 'schema')}"), name)


def __dir__() -> list[str]:
    return list(__all__)
