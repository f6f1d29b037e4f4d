"""`pliant-calculix-deck STUDY.yaml --pressure '15 kPa' [--angle 0.3] --out FILE.inp`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pliant.api import open_study
from pliant.errors import PliantError, UserError
from pliant.records.fem import ModuleProblem
from pliant.units import UnitError, parse_quantity
from pliant_calculix.abaqus import abaqus_deck, abaqus_model
from pliant_calculix.backend import Calculix
from pliant_calculix.config import CalculixConfig
from pliant_calculix.deck import Target


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the deck; exit codes are those of `pliant`."""
    options = _parser().parse_args(arguments)
    try:
        print(write(options))
    except PliantError as error:
        print(f"pliant-calculix-deck: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def write(options: argparse.Namespace) -> str:
    """Write the deck and describe it. Raises `PliantError`."""
    opened = open_study(options.study, options.overrides)
    study, context = opened.study, opened.context
    if study.family is None or study.material is None:
        raise UserError(f"{options.study} has no blocks 'family' and 'material'; a deck needs both.")
    refinement = study.fem.refinement if study.fem is not None else 1
    problem: ModuleProblem = context.build("family", study.family).problem(refinement)
    material = context.build("material", study.material)
    pressure = _quantity(options.pressure, "Pa", "--pressure")
    unit = "m" if problem.joint == "prismatic" else "rad"
    model = abaqus_model(problem, material, options.element)
    if options.angle is None:
        config = study.fem if isinstance(study.fem, CalculixConfig) else CalculixConfig()
        solver = Calculix(config).solver(problem, material)
        u = solver.free(pressure, solver.rest()).angle_rad
    else:
        u = _quantity(options.angle, unit, "--angle")
    target = Target(pressure, u / problem.deformation_scale)
    heading = f"{study.name}: a module of family {study.family.kind}, by Pliant"
    deck = abaqus_deck(model, target, [heading])
    try:
        options.out.write_text("\n".join(deck) + "\n", encoding="ascii", errors="replace")
    except OSError as error:
        raise UserError(f"{options.out} cannot be written: {error.strerror}.") from error
    free = " (free: no moment)" if options.angle is None else ""
    return (
        f"{options.out}: {len(model.cells)} elements {model.element}, {len(model.used)} nodes, "
        f"{pressure:g} Pa, u = {u:.6g} {unit}{free}"
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pliant-calculix-deck",
        description="Writes one state of a study's module for Abaqus or CalculiX.",
    )
    parser.add_argument("study", type=Path, metavar="STUDY.yaml")
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help="changes to the study")
    parser.add_argument("--pressure", required=True, help="in the cavity, such as '15 kPa'")
    parser.add_argument(
        "--angle",
        help="the module's held angle, rad, or extension, m; the free one where left out (needs ccx)",
    )
    parser.add_argument("--element", default="C3D20R", help="C3D20R, C3D20, or for Abaqus C3D20RH, C3D20H")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.inp")
    return parser


def _quantity(text: str, unit: str, option: str) -> float:
    try:
        return parse_quantity(text, unit)
    except UnitError as error:
        raise UserError(f"{option}: {error}.") from None


if __name__ == "__main__":
    sys.exit(main())
