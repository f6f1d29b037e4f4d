"""What `pliant export` does for solids and moulds: files, the bill, sentences and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant import api
from pliant.cli.evidence import write_runs
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError
from pliant.meshing.stl import write_stl
from pliant.records.shape import TriangleMesh
from pliant_print.bill import BillRow, as_json, pressure_rows, write_bill
from pliant_print.boolean import solid, surface, volume_m3
from pliant_print.checks import check_surface
from pliant_print.closing import tip_cap_m
from pliant_print.config import MouldConfig, PrinterConfig
from pliant_print.mould import Mould, mould
from pliant_print.solids import (
    PrintedSolid,
    chain_with_settings,
    printed_chain,
    printed_module,
    printer_settings,
)
from pliant_print.step import write_step
from pliant_print.threemf import write_3mf

FORMATS = ("3mf", "stl", "step")
STEP_MM = 0.01  # by which triangles of a STEP file may deviate from those of the solid
UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # chain x becomes the file's z
WAYS = {
    "pulled": "it is pulled out through the open base",
    "below": "it is undercut along the chain and free below: cast the chamber side alone, pull the core down, then "
    "pour the floor; or make it a lost core",
    "lost": "it is undercut: cast it of wax or print it of a soluble material, and melt or wash it out at the base",
}


def export_solid(
    session: Session, study: Study, out: Path, form: str, part: str, scale: float, protocol: bool
) -> None:
    """Write the robot or a module as 3MF, STL or STEP, with its bill, and print its numbers."""
    context = session.context()
    made = printed_module(context, study) if part == "module" else printed_chain(context, study)
    check_writable(out.parent)
    files = write_solid(made, out, form, scale, study.name)
    if part != "module":
        bill = out.with_suffix(".bill.csv")
        write_bill(solid_bill(made, study), bill)
        files.append(bill)
        files += _protocol(session, study, out.parent) if protocol else []
    triangles = sum(body.check.triangles for body in made.bodies)
    session.result.update({"files": files, "format": form, "triangles": triangles, **solid_json(made, study)})
    for file in files:
        session.say(f"written  {file}")
    for sentence in solid_sentences(made, printer_settings(study), form):
        session.say(sentence)


def write_solid(made: PrintedSolid, out: Path, form: str, scale: float, name: str) -> list[Path]:
    """Write the files of a solid and return their paths: one STL for each material, one file of the other formats.

    STL and STEP have the chain at its pose in the world; 3MF has it upright on the printer's bed.
    """
    if form == "3mf":
        lowest = min(float(body.surface.vertices_m[:, 0].min()) for body in made.bodies)
        lift = np.array([0.0, 0.0, -lowest])
        write_3mf({body.name: body.surface.placed(UP, lift) for body in made.bodies}, out, name)
        return [out]
    placed = {
        body.name: body.surface.placed(made.base_rotation, made.base_position_m) for body in made.bodies
    }
    if form == "step":
        coarse = {label: solid(skin).simplify(STEP_MM) for label, skin in placed.items()}
        write_step(
            {k: [surface(piece) for piece in body.decompose()] for k, body in coarse.items()}, out, name
        )
        return [out]
    if len(placed) == 1:
        write_stl(next(iter(placed.values())), out, scale)
        return [out]
    files = [out.with_name(f"{out.stem}-{label}{out.suffix}") for label in placed]
    for file, skin in zip(files, placed.values(), strict=True):
        write_stl(skin, file, scale)
    return files


def solid_bill(made: PrintedSolid, study: Study) -> list[BillRow]:
    """Return the bill of a printed robot."""
    rows = [BillRow("print", body.name, body.check.volume_m3, body.density_kg_m3) for body in made.bodies]
    return rows + pressure_rows(study)


def solid_json(made: PrintedSolid, study: Study) -> dict[str, Any]:
    """Return the numbers of a solid in SI."""
    printer = printer_settings(study)
    return {
        "bodies": [
            {
                "name": body.name,
                "watertight": body.check.open_edges == 0,
                "crossings": body.check.crossings,
                "volume_m3": body.check.volume_m3,
                "mass_kg": body.mass_kg,
                "triangles": body.check.triangles,
            }
            for body in made.bodies
        ],
        "modules_volume_m3": made.modules_m3,
        "fem_volume_m3": made.fem_m3,
        "module_walls_m": {name: wall.thickness_m for name, wall in made.module_walls.items()},
        "thinnest_wall_m": made.thinnest.thickness_m,
        "thinnest_wall_at_m": list(made.thinnest.point_m),
        "min_wall_m": printer.min_wall_m,
        "overhang_standing": made.standing.share,
        "overhang_best": {"up": made.best.up, "share": made.best.share},
        "notes": list(made.notes),
        "bill": [as_json(row) for row in solid_bill(made, study)],
    }


def solid_sentences(made: PrintedSolid, printer: PrinterConfig, form: str) -> list[str]:
    """Return what a person should know about a solid."""
    names = ", ".join(body.name for body in made.bodies)
    said = [
        f"Bodies: {names}; closed, oriented, without triangles that cross. The "
        f"modules have {1e9 * made.modules_m3:.5g} mm³, the FEM's mesh {1e9 * made.fem_m3:.5g} mm³ "
        f"({100 * made.volume_error:+.2f} %)."
    ]
    if len(made.bodies) > 1 and form == "stl":
        said.append("An STL file has one body: each material has its own, in the same place.")
    if form == "step":
        said.append(
            f"The STEP file (AP214) is a faceted solid: one plane face per triangle, within {STEP_MM:g} mm; it has no "
            "cylinders, no tori and no features."
        )
    wall, least = made.thinnest, printer.min_wall_m
    place = ", ".join(f"{1e3 * x:.3g}" for x in wall.point_m)
    verdict = "is no thinner than" if wall.thickness_m >= least * (1 - 1e-3) else "is thinner than"
    lines = wall.thickness_m / printer.nozzle_m
    said.append(
        f"The thinnest wall, {1e3 * wall.thickness_m:.3g} mm at ({place}) mm, {verdict} the printer's least wall of "
        f"{1e3 * least:.3g} mm: {lines:.3g} lines of its nozzle."
    )
    limit = np.degrees(printer.max_overhang_rad)
    said.append(
        f"Standing on its base, {100 * made.standing.share:.3g} % of the surface hangs over more than {limit:.3g}°; "
        f"with {made.best.up} up it is {100 * made.best.share:.3g} %."
    )
    return said + list(made.notes)


def export_mould(session: Session, study: Study, out: Path, protocol: bool) -> None:
    """Write the mould of the study's chain into a folder, with its bill, and print how to cast."""
    context = session.context()
    chain, walls, closing, density = chain_with_settings(context, study)
    if chain.supplies:
        raise UserError(
            "segments with inputs of their own are closed toward each other and have no core through the base; cast "
            "each segment by itself, or print the robot (--out robot.3mf)."
        )
    config: MouldConfig = study.block("mould") or MouldConfig()
    cap_m = tip_cap_m(chain, closing, min(wall.thickness_m for wall in walls.values()))
    made = mould(chain, config, closing, cap_m)
    parts = mould_parts(made)
    for name, skin in parts.items():
        check = check_surface(skin)
        if not check.sound:
            raise NotReachedError(
                f"the mould's {name} is no sound solid ({check.open_edges} open edges, {check.crossings} crossings); "
                "nothing was written."
            )
    if out.is_file():
        raise UserError(f"--out {out} is a file; a mould is a folder.")
    out.mkdir(parents=True, exist_ok=True)
    check_writable(out)
    files = []
    for name, skin in parts.items():
        files.append(out / f"{name}.3mf")
        write_3mf({name: skin.placed(UP, np.zeros(3))}, files[-1], f"{study.name} {name}")
    rows = mould_bill(made, study, config, density, chain.soft)
    files.append(out / "bill.csv")
    write_bill(rows, files[-1])
    files += _protocol(session, study, out) if protocol else []
    session.result.update({"files": files, "format": "mould", **mould_json(made, rows)})
    for file in files:
        session.say(f"written  {file}")
    for sentence in mould_sentences(made, config, chain.notes):
        session.say(sentence)


def mould_parts(made: Mould) -> dict[str, TriangleMesh]:
    """Return the surfaces of a mould's parts by the names of their files."""
    halves = {f"half_{number}": body for number, body in enumerate(made.halves, 1)}
    inserts = {f"insert_{name}": body for name, body in made.inserts.items()}
    every = {**halves, **made.cores, **inserts, "flange": made.flange, "part": made.part}
    return {name: surface(body) for name, body in every.items()}


def mould_bill(
    made: Mould, study: Study, config: MouldConfig, density: Mapping[str, float], soft: str
) -> list[BillRow]:
    """Return the bill of a cast robot: the part, what to mix, cores, inserts, the mould, test pressures."""
    mixed = (1 + config.allowance) * made.poured_m3
    rows = [
        BillRow("cast part", soft, made.part_m3, density.get(soft)),
        BillRow(
            "mix",
            soft,
            mixed,
            density.get(soft),
            note=f"part, sprue, vents and {100 * config.allowance:.3g} %",
        ),
    ]
    rows += [
        BillRow("core", name, volume_m3(body), note=WAYS[about.way])
        for (name, body), about in zip(made.cores.items(), made.about_cores, strict=True)
    ]
    rows += [
        BillRow("insert", name, volume_m3(body), density.get(name)) for name, body in made.inserts.items()
    ]
    rows.append(BillRow("flange", "rigid", volume_m3(made.flange), note="glued on after casting"))
    rows += [
        BillRow("half", "mould", volume_m3(body), note=f"half_{n}") for n, body in enumerate(made.halves, 1)
    ]
    return rows + pressure_rows(study)


def mould_json(made: Mould, rows: Sequence[BillRow]) -> dict[str, Any]:
    """Return the numbers of a mould in SI."""
    return {
        "part_volume_m3": made.part_m3,
        "recovered_volume_m3": made.recovered_m3,
        "differs_m3": made.differs_m3,
        "poured_volume_m3": made.poured_m3,
        "undercut": made.undercut,
        "scale": made.scale,
        "cores": [{"name": one.name, "way": one.way, "wider": one.wider} for one in made.about_cores],
        "inserts": list(made.inserts),
        "bill": [as_json(row) for row in rows],
    }


def mould_sentences(made: Mould, config: MouldConfig, notes: Sequence[str]) -> list[str]:
    """Return how to cast, and what the mould's check found."""
    error = 100 * (made.recovered_m3 / made.part_m3 - 1)
    said = [
        f"The box less halves, cores and inserts gives the part to {error:+.2f} % of its volume; it lies elsewhere in "
        f"{100 * made.differs_m3 / made.part_m3:.2g} %, which is the draft of {np.degrees(config.draft_rad):.2g}°."
    ]
    for core in made.about_cores:
        said.append(f"{core.name}, {core.wider:.3g} times as wide as its opening: {WAYS[core.way]}.")
    if made.undercut > 1e-3:
        said.append(
            f"{100 * made.undercut:.2g} % of the part's outside holds the halves back; the rubber has to give way."
        )
    for name in made.inserts:
        said.append(f"'{name}' is laid into the mould before the rubber is poured.")
    said.append("The part is cast open at the base; flange.3mf is glued on.")
    return said + list(notes)


def _protocol(session: Session, study: Study, folder: Path) -> list[Path]:
    """Write the protocol of the first bench run, as `pliant plan` does."""
    first = api.plan_first_runs(api.OpenStudy(study, session.context()), runs=1)
    named = [(f"run_{n}_{run.name}.csv".replace(" ", "_"), run) for n, run in enumerate(first.chosen, 1)]
    return [
        Path(file) for file in write_runs(folder, named, first.outputs, Path(f"{study.name}.yaml"), study)
    ]
