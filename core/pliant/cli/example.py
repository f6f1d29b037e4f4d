"""`pliant example`: a small study with its data, to try where no checkout is."""

from __future__ import annotations

from importlib import resources
from math import degrees
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import verb
from pliant.cli.session import Session, check_writable
from pliant.errors import UserError, closest

# Name → folder of examples/, its files, and the verb that the first of them is for.
EXAMPLES = {
    "hidden-effect": ("hidden_effect", ("finger.yaml", "bench.csv"), "compare"),
    "german-lab": ("hidden_effect", ("finger.yaml", "bench.csv"), "compare"),
    "solver-table": ("elsewhere", ("bellow.csv",), "fit"),
    "first-finger": ("first_finger", ("finger.yaml", "loaded.yaml"), "run"),
}
# Column of a measurement → how a German lab calls it, and its unit there in one of ours.
GERMAN = {
    "run": ("Messung", None),
    "specimen": ("Probe", None),
    "time_s": ("Zeit [ms]", 1e3),
    "pressure_pa": ("Druck [mbar]", 1e-2),
    "moment_n_m": ("Drehmoment [mN*m]", 1e3),
    "temperature_c": ("Temperatur [°C]", 1.0),
    "angle_rad": ("Winkel [°]", degrees(1.0)),
}


@verb(store=False)
def example(
    here: Session,
    name: Annotated[str, typer.Argument(metavar="NAME", help=", ".join(EXAMPLES))],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="By default ./NAME.")] = None,
) -> None:
    """Write a small study with its data, to try the other commands on."""
    if name not in EXAMPLES:
        raise UserError(f"unknown example '{name}'{closest(name, EXAMPLES)} Examples: {', '.join(EXAMPLES)}.")
    folder, files, command = EXAMPLES[name]
    target = out or Path(name)
    check_writable(target)
    if there := [str(target / file) for file in files if (target / file).exists()]:
        raise UserError(f"{' and '.join(there)}: there already; choose another --out folder.")
    installed = resources.files("pliant") / "examples"
    source = installed if installed.is_dir() else Path(__file__).parents[3] / "examples"
    for file in files:
        content = (source / folder / file).read_bytes()
        changed = german(content.decode()) if (name, file) == ("german-lab", "bench.csv") else content
        (target / file).write_bytes(changed)
        here.say(str(target / file))
    here.result["files"] = [str(target / file) for file in files]
    here.say(f"\nnext: pliant {command} {target / files[0]}")


def german(table: str) -> bytes:
    """A measurement as a German Excel writes it: semicolons, decimal commas, German names and units, Latin-1."""
    header, *rows = [line.split(",") for line in table.splitlines() if not line.startswith("#")]
    columns = [GERMAN.get(name, (name, 1.0)) for name in header]
    lines = [";".join(name for name, _ in columns)]
    for row in rows:
        cells = [
            cell if k is None else f"{k * float(cell):.6g}" for cell, (_, k) in zip(row, columns, strict=True)
        ]
        lines.append(";".join(cells).replace(".", ","))
    return ("\r\n".join(lines) + "\r\n").encode("latin-1")
