"""Bellow and PneuNet driven to 1.5 times the first contact of walls: our contact, CalculiX' and none.

Each is fixed at two states: at our free angle under 1.5 times the pressure of first contact, and 10 % beyond that
angle. The bellow is also bent against actuation, to 1.5 times the angle at which folds meet on the other side. CalculiX
solves the same cells (20 nodes for 27) at the same pressures and angles, face to face against rigid plates in the
mirror planes. The range of torque is our slope there times the whole angle, so that shares of torque and angle are
equal.

    python -m benchmarks.families.touching [--module bellow] [--state 0] [--refinement 3] [--inner-mm 0.5] [--json FILE]

needs ccx; contrib/pliant-calculix/src is imported without installation.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.families.graded import graded_problem

from pliant.interfaces.material import Material
from pliant.records.fem import FemState, ModuleProblem
from pliant.registry.discovery import discover
from pliant_plugins.families.pneunet.family import Pneunet
from pliant_plugins.families.reference import FINGER, PNEUNET
from pliant_plugins.fem.skfem.backend import SkfemSolver

CONTRIB = Path(__file__).resolve().parents[2] / "contrib" / "pliant-calculix" / "src"
# Family, refinement, shear modulus, shear moduli of regions.
MODULES: dict[str, tuple[dict[str, Any], int, str, dict[str, str]]] = {
    "bellow": (
        {"kind": "bellow_bending", **FINGER, "wall": "0.8 mm", "module_length": "6 mm"},
        1,
        "240 kPa",
        {},
    ),
    "pneunet": (
        {"kind": "pneunet", **PNEUNET},
        2,
        "200 kPa",
        {"layer": "2 MPa"},
    ),
}
BEYOND = 1.5
LARGEST_M = 1e-3  # cells where its walls meet: smaller than those of refinement 2
PRESSURE_STEP_PA, ANGLE_STEP = 2.5e3, -0.05
TOLERANCE, TIMEOUT_S = 1e-4, 3600.0


@dataclass(frozen=True)
class Place:
    """A state to compare: its name, pressure and held angle of the module."""

    name: str
    pressure_pa: float
    angle_rad: float


def built(interface: str, **block: Any) -> Any:
    """Return a component."""
    registry = discover()
    model = registry.get(interface, block["kind"]).config_model()
    return registry.build(interface, model.model_validate(block))


def rubber(shear_modulus: str, regions: dict[str, str]) -> Material:
    """Return neo-Hookean body and regions."""
    body: Material = built("material", kind="neo_hookean", shear_modulus=shear_modulus)
    others = {n: built("material", kind="neo_hookean", shear_modulus=mu) for n, mu in regions.items()}
    return body.with_regions(others) if others else body


def solver(problem: ModuleProblem, material: Material, how: str) -> SkfemSolver:
    """Return our solver with or without contact."""
    fem = built("fem", kind="skfem", pressure_max="15 kPa", self_contact=how)
    made: SkfemSolver = fem.solver(problem, material)
    return made


def gap_m(here: SkfemSolver, state: FemState) -> float:
    """Return the smallest distance of the skin's points from the contact planes; negative beyond them."""
    contacts = here.assembler.contacts
    assert contacts is not None and contacts.planes is not None
    return -float(contacts.planes.depth(state.solution, state.axial_strain).max())


def walk(here: SkfemSolver, by_pressure: bool) -> tuple[float, FemState]:
    """Return pressure or angle of first contact, by the gaps on both sides of it, and the state before."""
    step = PRESSURE_STEP_PA if by_pressure else ANGLE_STEP
    state, at = here.rest(), 0.0
    gap = gap_m(here, state)
    while True:
        ahead = here.free(at + step, state) if by_pressure else here.constrained(0.0, at + step, state)
        if ahead.status == "touching":
            return at + step * gap / (gap - gap_m(here, ahead)), state
        state, at, gap = ahead, at + step, gap_m(here, ahead)


def reached(here: SkfemSolver, place: Place) -> FemState:
    """Solve for our state there, in steps."""
    state = here.rest()
    for share in (
        np.linspace(0, 1, 1 + int(np.ceil(place.pressure_pa / 2e3)))[1:] if place.pressure_pa else []
    ):
        state = here.free(float(share * place.pressure_pa), state)
    for share in (0.5, 1.0):
        at = state.angle_rad if place.pressure_pa else 0.0
        state = here.constrained(place.pressure_pa, at + share * (place.angle_rad - at), state)
    return state


def by_calculix(problem: ModuleProblem, material: Material, place: Place, contact: bool = True) -> float:
    """Return the module's torque against actuation, by CalculiX with or without contact."""
    sys.path.insert(0, str(CONTRIB))
    from pliant_calculix.deck import Target, contact_path_cards
    from pliant_calculix.model import build_model
    from pliant_calculix.program import run
    from pliant_calculix.reading import Reader

    model = build_model(problem, material, "C3D20R", 1e-6, 1.0, contact=contact)
    target = Target(place.pressure_pa, place.angle_rad / problem.deformation_scale)
    deck = contact_path_cards(model, target, TOLERANCE)
    with tempfile.TemporaryDirectory() as folder:
        answer = run("ccx", deck, 1, len(model.places_m) + 2, TIMEOUT_S, Path(folder))
    reaction = Reader(model, material).reaction(answer.points[0], place.pressure_pa, target.held or 0.0)
    return -problem.energy_scale / problem.deformation_scale * reaction.moment_n_m


def places(here: SkfemSolver, back: bool) -> tuple[float, list[Place]]:
    """Return the pressure of first contact, the states beyond, and one bent back if folds meet there too."""
    pressure, before = walk(here, by_pressure=True)
    free = here.free(BEYOND * pressure, here.free(1.2 * pressure, before))
    held = [
        Place("free angle", free.actuation, free.angle_rad),
        Place("10 % beyond it", free.actuation, 1.1 * free.angle_rad),
    ]
    if back:
        held.append(Place("bent back", 0.0, BEYOND * walk(here, by_pressure=False)[0]))
    return pressure, held


def compared(
    place: Place, ours: FemState, none: FemState, theirs: float, theirs_without: float
) -> dict[str, Any]:
    """Return one row; the range of torque is the slope times the whole angle.

    What contact changes is compared too: the codes' elements differ without it already.
    """
    reach = abs(ours.dmoment_du * place.angle_rad)
    return {
        "state": place.name,
        "pressure_pa": place.pressure_pa,
        "angle_rad": place.angle_rad,
        "ours_n_m": ours.moment_n_m,
        "calculix_n_m": theirs,
        "without_contact_n_m": none.moment_n_m,
        "calculix_without_n_m": theirs_without,
        "of_contact_apart": abs((ours.moment_n_m - none.moment_n_m) - (theirs - theirs_without))
        / max(abs(theirs), reach),
        "torque_apart": abs(ours.moment_n_m - theirs) / max(abs(theirs), reach),
        "without_apart": abs(none.moment_n_m - theirs) / max(abs(theirs), reach),
        "torque_apart_of_itself": abs(ours.moment_n_m / theirs - 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--module", choices=MODULES, action="append")
    parser.add_argument("--state", type=int, action="append", help="numbers from 0")
    parser.add_argument("--refinement", type=int, help="of the mesh, instead of the module's own")
    parser.add_argument("--inner-mm", type=float, help="the PneuNet on cells of this size at its inner edges")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    report: dict[str, Any] = {}
    for name in options.module or MODULES:
        family, refinement, *moduli = MODULES[name]
        refinement = options.refinement or refinement
        made, material = built("family", **family), rubber(*moduli)
        problem = made.problem(refinement)
        if options.inner_mm and isinstance(made, Pneunet):
            problem = graded_problem(made, 1e-3 * options.inner_mm, LARGEST_M)
        with_contact, without = solver(problem, material, "solve"), solver(problem, material, "end")
        pressure, held = places(with_contact, back=name == "bellow")
        print(f"{name}: walls meet at {pressure / 1e3:.3g} kPa", flush=True)
        report[name] = {"first_pressure_pa": pressure, "states": []}
        for number, place in enumerate(held):
            if options.state and number not in options.state:
                continue
            ours, none = reached(with_contact, place), reached(without, place)
            begun = time.perf_counter()
            theirs, bare = (by_calculix(problem, material, place, contact) for contact in (True, False))
            row = compared(place, ours, none, theirs, bare)
            report[name]["states"].append({**row, "calculix_s": time.perf_counter() - begun})
            print(
                f"  {place.name:15s}{place.pressure_pa / 1e3:7.2f} kPa {place.angle_rad:8.4f} rad, torque mN·m: ours "
                f"{1e3 * ours.moment_n_m:8.4f}, CalculiX {1e3 * row['calculix_n_m']:8.4f}, without contact "
                f"{1e3 * none.moment_n_m:8.4f} and {1e3 * bare:8.4f}; apart {row['torque_apart']:.2%} of the range "
                f"(ours without contact {row['without_apart']:.2%}; what contact changes "
                f"{row['of_contact_apart']:.2%}), {row['torque_apart_of_itself']:.2%} of the torque",
                flush=True,
            )
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
