"""Printed solids and moulds of all shipped families: python -m benchmarks.print.solids

For each family a chain of modules: whether each body is closed and free of crossings, the modules' volume against the
FEM's, the thinnest wall against the parameters', and what box less halves, cores and inserts leaves against the part.
`mesh_file` is the module of examples/cad_file, for which Netgen is needed. Writes benchmarks/out/print_solids.json.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import copy
from typing import Any

from benchmarks.output import ROOT, make_parser, write
from benchmarks.print.designs import DESIGNS, mesh_file_text, study_text

from pliant.api import open_study
from pliant_print.boolean import surface
from pliant_print.checks import check_surface
from pliant_print.closing import tip_cap_m
from pliant_print.config import MouldConfig
from pliant_print.mould import Mould, mould
from pliant_print.solids import PrintedSolid, chain_with_settings, printed_chain

MODULES = 2
MESH_FILE = "mesh_file"
CAD_WALLS_M = {"body": 1.5e-3}  # of examples/cad_file/mesh.py
VOLUME_BAR, WALL_BAR, MOULD_BAR = 5e-3, 1e-2, 5e-3


@dataclass(frozen=True, eq=False)
class Case:
    """One family's solid and mould, and the processor seconds of each."""

    name: str
    printed: PrintedSolid
    mould: Mould
    printed_s: float
    mould_s: float


def case(name: str, folder: Path, modules: int = MODULES) -> Case:
    """Return the solid and the mould of a family's chain."""
    path = folder / f"{name}.yaml"
    path.write_text(_cad(folder, modules) if name == MESH_FILE else study_text(name, modules))
    one = open_study(path, store=folder / "store")
    begun = time.process_time()
    printed = printed_chain(one.context, one.study)
    middle = time.process_time()
    chain, walls, closing, _ = chain_with_settings(one.context, one.study)
    cap_m = tip_cap_m(chain, closing, min(wall.thickness_m for wall in walls.values()))
    made = mould(chain, MouldConfig(), closing, cap_m)
    return Case(name, printed, made, middle - begun, time.process_time() - middle)


def _cad(folder: Path, modules: int) -> str:
    script = folder / "mesh.py"
    copy(ROOT / "examples" / "cad_file" / "mesh.py", script)
    subprocess.run([sys.executable, str(script)], check=True, capture_output=True)
    return mesh_file_text(folder / "finger.msh", modules)


def figures(one: Case) -> dict[str, Any]:
    """Return the figures of a case."""
    stated = CAD_WALLS_M if one.name == MESH_FILE else DESIGNS[one.name].walls_m
    walls = {
        material: one.printed.module_walls[material].thickness_m / wall - 1
        for material, wall in stated.items()
    }
    checks = [body.check for body in one.printed.bodies]
    parts = [check_surface(surface(body)) for body in (*one.mould.halves, *one.mould.cores.values())]
    return {
        "bodies": [body.name for body in one.printed.bodies],
        "sound": all(check.sound for check in checks),
        "triangles": sum(check.triangles for check in checks),
        "volume_error": one.printed.volume_error,
        "wall_error": max(walls.values(), key=abs),
        "mould_sound": all(check.sound for check in parts),
        "mould_error": one.mould.recovered_m3 / one.mould.part_m3 - 1,
        "mould_elsewhere": one.mould.differs_m3 / one.mould.part_m3,
        "cores": [core.way for core in one.mould.about_cores],
        "undercut": one.mould.undercut,
        "processor_s": {"solid": one.printed_s, "mould": one.mould_s},
    }


def line(name: str, row: dict[str, Any]) -> str:
    """Return a row of the table."""
    met = (
        row["sound"]
        and row["mould_sound"]
        and abs(row["volume_error"]) <= VOLUME_BAR
        and abs(row["wall_error"]) <= WALL_BAR
        and abs(row["mould_error"]) <= MOULD_BAR
    )
    return (
        f"{name:21} {'closed' if row['sound'] else 'OPEN':6} {row['triangles']:7d} {100 * row['volume_error']:+7.2f} % "
        f"{100 * row['wall_error']:+7.2f} % {100 * row['mould_error']:+7.2f} % {', '.join(row['cores']) or '–':30} "
        f"{'met' if met else 'MISSED'}"
    )


def main(args: Sequence[str] | None = None) -> None:
    make_parser(__doc__).parse_args(args)
    print(f"{'family':21} {'solid':6} {'faces':>7} {'volume':>9} {'wall':>9} {'mould':>9} cores")
    result = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in (*DESIGNS, MESH_FILE):
            result[name] = figures(case(name, Path(folder)))
            print(line(name, result[name]), flush=True)
    write("print_solids", result)


if __name__ == "__main__":
    main()
