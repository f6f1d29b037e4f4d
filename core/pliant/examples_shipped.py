"""Small studies with their data that ship with Pliant, and functions that write them to a folder."""

from __future__ import annotations

from importlib import resources
from math import degrees
from pathlib import Path

# Name → folder of examples/, its files, and the verb that the first file is for.
EXAMPLES = {
    "hidden-effect": ("hidden_effect", ("finger.yaml", "bench.csv"), "compare"),
    "german-lab": ("hidden_effect", ("finger.yaml", "bench.csv"), "compare"),
    "solver-table": ("elsewhere", ("bellow.csv",), "fit"),
    "experiment": ("experiment", ("finger.yaml", "truth.yaml"), "experiment"),
    "emulated-bench": ("emulated_bench", ("finger.yaml",), "experiment"),
    "first-finger": ("first_finger", ("finger.yaml", "loaded.yaml"), "run"),
}
# Column of a measurement → its name in a German lab, and its unit there in one of ours.
GERMAN = {
    "run": ("Messung", None),
    "specimen": ("Probe", None),
    "time_s": ("Zeit [ms]", 1e3),
    "pressure_pa": ("Druck [mbar]", 1e-2),
    "moment_n_m": ("Drehmoment [mN*m]", 1e3),
    "temperature_c": ("Temperatur [°C]", 1.0),
    "angle_rad": ("Winkel [°]", degrees(1.0)),
}


def copy_example(name: str, target: Path) -> list[str]:
    """Write the files of an example into a folder, overwriting existing ones, and return their names."""
    folder, files, _ = EXAMPLES[name]
    installed = resources.files("pliant") / "examples"
    source = installed if installed.is_dir() else Path(__file__).parents[2] / "examples"
    for file in files:
        content = (source / folder / file).read_bytes()
        changed = german(content.decode()) if (name, file) == ("german-lab", "bench.csv") else content
        (target / file).write_bytes(changed)
    return list(files)


def german(table: str) -> bytes:
    """Return a measurement as a German Excel writes it: semicolons, decimal commas, German names and units, Latin-1."""
    header, *rows = [line.split(",") for line in table.splitlines() if not line.startswith("#")]
    columns = [GERMAN.get(name, (name, 1.0)) for name in header]
    lines = [";".join(name for name, _ in columns)]
    for row in rows:
        cells = [
            cell if k is None else f"{k * float(cell):.6g}" for cell, (_, k) in zip(row, columns, strict=True)
        ]
        lines.append(";".join(cells).replace(".", ","))
    return ("\r\n".join(lines) + "\r\n").encode("latin-1")
