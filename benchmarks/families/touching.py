"""A bellow driven half as far again as where its folds meet: our contact against CalculiX', and against none.

Beyond first touching the module is held at three states: at the free angle under 1.5 times the pressure of first
touching, 10 % beyond it, and bent against actuation 1.5 times as far as where folds meet on the other side. CalculiX
solves the same cells (20 nodes for 27) at the same pressures and angles, face to face against rigid plates in the
mirror planes. The free angle that its torque means is that of our slope there.

    python -m benchmarks.families.touching [--json FILE]     needs ccx; contrib/pliant-calculix/src is taken as it lies
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

from pliant.records.fem import FemState, ModuleProblem
from pliant.registry.discovery import discover
from pliant_plugins.fem.skfem.backend import SkfemSolver

CONTRIB = Path(__file__).resolve().parents[2] / "contrib" / "pliant-calculix" / "src"
DESIGN = {
    "kind": "bellow_bending",
    "inner_radius": "2 mm",
    "average_radius": "6 mm",
    "wall": "0.8 mm",
    "module_length": "6 mm",
}
RUBBER = {"kind": "neo_hookean", "shear_modulus": "240 kPa"}
BEYOND = 1.5
PRESSURE_STEP_PA, ANGLE_STEP = 1.25e3, -0.05
TOLERANCE, TIMEOUT_S = 1e-5, 3600.0


@dataclass(frozen=True)
class Place:
    """A state to compare: its name, pressure and held angle of the module."""

    name: str
    pressure_pa: float
    angle_rad: float


def built(interface: str, **block: Any) -> Any:
    """A component."""
    registry = discover()
    model = registry.get(interface, block["kind"]).config_model()
    return registry.build(interface, model.model_validate(block))


def solver(problem: ModuleProblem, how: str) -> SkfemSolver:
    """Ours with or without contact."""
    made: SkfemSolver = built("fem", kind="skfem", pressure_max="15 kPa", self_contact=how).solver(
        problem, built("material", **RUBBER)
    )
    return made


def gap_m(here: SkfemSolver, state: FemState) -> float:
    """Smallest distance of the skin's points from the planes that they may meet; negative beyond them."""
    contact = here.assembler.contact
    assert contact is not None
    return -float(contact.depth(state.solution, state.axial_strain).max())


def walk(here: SkfemSolver, by_pressure: bool) -> tuple[float, FemState]:
    """Pressure or angle at which walls first meet, by the gaps on both sides of it, and the state before."""
    step = PRESSURE_STEP_PA if by_pressure else ANGLE_STEP
    state, at = here.rest(), 0.0
    gap = gap_m(here, state)
    while True:
        ahead = here.free(at + step, state) if by_pressure else here.constrained(0.0, at + step, state)
        if ahead.status == "touching":
            return at + step * gap / (gap - gap_m(here, ahead)), state
        state, at, gap = ahead, at + step, gap_m(here, ahead)


def reached(here: SkfemSolver, place: Place) -> FemState:
    """Our state there, in steps."""
    state = here.rest()
    for share in (
        np.linspace(0, 1, 1 + int(np.ceil(place.pressure_pa / 2e3)))[1:] if place.pressure_pa else []
    ):
        state = here.free(float(share * place.pressure_pa), state)
    for share in (0.5, 1.0):
        at = state.angle_rad if place.pressure_pa else 0.0
        state = here.constrained(place.pressure_pa, at + share * (place.angle_rad - at), state)
    return state


def by_calculix(problem: ModuleProblem, place: Place) -> float:
    """Torque of the module that opposes actuation, by CalculiX with contact."""
    sys.path.insert(0, str(CONTRIB))
    from pliant_calculix.deck import Target, contact_path_cards
    from pliant_calculix.model import build_model
    from pliant_calculix.program import run
    from pliant_calculix.reading import Reader

    material = built("material", **RUBBER)
    model = build_model(problem, material, "C3D20R", 1e-6, 1.0, contact=True)
    target = Target(place.pressure_pa, place.angle_rad / problem.deformation_scale)
    deck = contact_path_cards(model, target, TOLERANCE)
    with tempfile.TemporaryDirectory() as folder:
        answer = run("ccx", deck, 1, len(model.places_m) + 2, TIMEOUT_S, Path(folder))
    reaction = Reader(model, material).reaction(answer.points[0], place.pressure_pa, target.held or 0.0)
    return -problem.energy_scale / problem.deformation_scale * reaction.moment_n_m


def places(problem: ModuleProblem) -> tuple[dict[str, float], list[Place]]:
    """Where walls first meet, and the states beyond."""
    here = solver(problem, "solve")
    pressure, before = walk(here, by_pressure=True)
    angle, _ = walk(here, by_pressure=False)
    free = here.free(BEYOND * pressure, here.free(pressure, before))
    held = [
        Place("free angle", free.actuation, free.angle_rad),
        Place("10 % beyond it", free.actuation, 1.1 * free.angle_rad),
        Place("bent back", 0.0, BEYOND * angle),
    ]
    return {"pressure_pa": pressure, "angle_rad": angle, "free_rad": free.angle_rad}, held


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    problem = built("family", **DESIGN).problem()
    first, held = places(problem)
    print(
        f"folds meet at {first['pressure_pa'] / 1e3:.3g} kPa, and at {first['angle_rad']:.3g} rad without pressure"
    )
    with_contact, without = solver(problem, "solve"), solver(problem, "end")
    rows = []
    for place in held:
        ours, none = reached(with_contact, place), reached(without, place)
        begun = time.perf_counter()
        theirs = by_calculix(problem, place)
        scale = max(abs(theirs), abs(ours.dmoment_du * place.angle_rad))
        row = {
            "state": place.name,
            "pressure_pa": place.pressure_pa,
            "angle_rad": place.angle_rad,
            "ours_n_m": ours.moment_n_m,
            "calculix_n_m": theirs,
            "without_contact_n_m": none.moment_n_m,
            "torque_apart_of_range": abs(ours.moment_n_m - theirs) / scale,
            "without_apart_of_range": abs(none.moment_n_m - theirs) / scale,
            "angle_apart": abs((ours.moment_n_m - theirs) / ours.dmoment_du) / abs(place.angle_rad),
            "calculix_s": time.perf_counter() - begun,
        }
        rows.append(row)
        print(
            f"{place.name:16s} {place.pressure_pa / 1e3:6.2f} kPa {place.angle_rad:8.4f} rad  torque mN·m: ours "
            f"{1e3 * ours.moment_n_m:8.4f}, CalculiX {1e3 * theirs:8.4f}, without contact "
            f"{1e3 * none.moment_n_m:8.4f}; apart {row['torque_apart_of_range']:.2%} of the range (without contact "
            f"{row['without_apart_of_range']:.2%}), angle {row['angle_apart']:.2%}",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps({"first_touching": first, "states": rows}, indent=1))


if __name__ == "__main__":
    main()
