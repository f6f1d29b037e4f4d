"""What ccx answers, held against laws: the material's own stress, beam and rod theory, another code, another way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pliant_calculix.abaqus import abaqus_deck, abaqus_model
from pliant_calculix.backend import Calculix, CalculixSolver
from pliant_calculix.config import CalculixConfig
from pliant_calculix.deck import Target
from pliant_calculix.program import run
from pliant_calculix.reading import Reader

from pliant.interfaces.fem import StateNotConvergedError
from pliant.testing.box import BoxModule

pytestmark = pytest.mark.usefixtures("needs_ccx")
PRESSURE_PA, ANGLE_RAD = 8e3, 0.15
LAWS = (
    {"kind": "neo_hookean", "shear_modulus": "100 kPa", "poisson_ratio": 0.45},
    {"kind": "mooney_rivlin", "c10": "30 kPa", "c01": "20 kPa", "poisson_ratio": 0.45},
    {"kind": "yeoh", "c10": "50 kPa", "c20": "-5 kPa", "c30": "1 kPa", "poisson_ratio": 0.45},
    {"kind": "ogden", "mu": ["60 kPa", "40 kPa"], "alpha": [1.3, -2.0], "poisson_ratio": 0.45},
)


def solver(problem: Any, material: Any, **options: Any) -> CalculixSolver:
    return Calculix(CalculixConfig(**options)).solver(problem, material)


@pytest.mark.parametrize("law", LAWS, ids=[str(law["kind"]) for law in LAWS])
def test_the_decks_law_is_the_material(box: Any, build: Any, law: dict[str, Any]) -> None:
    """Nodal forces that ccx prints are those of Pliant's own material at the same displacements."""
    here = solver(box, build("material", **law))
    answer = here._run([Target(PRESSURE_PA, ANGLE_RAD / 2)], "constrained").points[0]
    count = len(here.model.places_m)
    ours = here.reader.internal_forces(answer.displacement[:count] / 1e3)
    body = np.unique(here.model.cells)
    theirs = answer.force[body] / here.model.newton
    assert np.abs(ours[body] - theirs).max() < 5e-5 * np.abs(theirs).max()


def test_equilibrium_and_thrust(box: Any, rubber: Any) -> None:
    """Free nodes carry no force, and the section needs no net force: the cap's thrust is included."""
    here = solver(box, rubber)
    target = Target(PRESSURE_PA, ANGLE_RAD / 2)
    answer = here._run([target], "constrained").points[0]
    reaction = here.reader.reaction(answer, target.pressure_pa, ANGLE_RAD / 2)
    thrust = PRESSURE_PA * 12e-6
    assert reaction.residual_n < 1e-5 * thrust
    assert abs(reaction.force_n) < 1e-4 * thrust


def test_cap_has_no_stiffness(box: Any, rubber: Any) -> None:
    soft, stiff = (
        solver(box, rubber, cap_stiffness=c)._run([Target(PRESSURE_PA, 0.05)], "constrained").points[0]
        for c in (1e-6, 1e-3)
    )
    moved = np.abs(soft.displacement).max()
    assert np.abs(soft.displacement - stiff.displacement).max() < 1e-3 * moved


def test_people_s_deck_gives_the_same_moment(box: Any, rubber: Any) -> None:
    """Linear equations with n(θ) and ccx's own nonlinear plane hold the same section; and the moment is Σ −z R₁."""
    here, target = solver(box, rubber), Target(PRESSURE_PA, ANGLE_RAD / 2)
    answer = here._run([target], "constrained").points[0]
    wanted = here.reader.reaction(answer, target.pressure_pa, ANGLE_RAD / 2).moment_n_m

    model = abaqus_model(box, rubber)
    nodes = len(model.places_m) + 2
    deck = abaqus_deck(model, target, ["a box"])
    deck = [line.replace("NSET=START", "NSET=BODY_AND_CAPS") if "PRINT" in line else line for line in deck]
    there = run("ccx", deck, 1, nodes, 100.0).points[0]
    reader = Reader(model, rubber)
    moment = reader.reaction(there, target.pressure_pa, ANGLE_RAD / 2).moment_n_m
    # ccx' standard tolerance in the people's deck
    assert moment == pytest.approx(wanted, rel=2e-3)

    # what Abaqus prints as RF: the internal forces less those of the pressure
    places = 1e3 * model.places_m + there.displacement[: len(model.places_m)]
    held = there.force[: len(places)] - reader._pressure_forces(places, 1e-6 * target.pressure_pa)
    start = model.node_sets["start"]
    assert -1e-3 * float(held[start, 0] @ places[start, 2]) == pytest.approx(moment, rel=2e-3)


def test_same_elements_same_answer_as_skfem(box: Any, rubber: Any, build: Any) -> None:
    """27-node cells against their 20-node shadows, five in all: they differ by discretisation only."""
    here = solver(box, rubber, element="C3D20")
    there = build("fem", kind="skfem", pressure_max="8 kPa", dilatation="point").solver(box, rubber)
    ours = here.constrained(PRESSURE_PA, ANGLE_RAD, here.rest())
    theirs = there.constrained(PRESSURE_PA, ANGLE_RAD, there.rest())
    assert ours.moment_n_m == pytest.approx(theirs.moment_n_m, rel=5e-3)
    assert ours.axial_strain == pytest.approx(theirs.axial_strain, rel=2e-2)
    assert ours.travel == pytest.approx(theirs.travel, rel=5e-2)


def test_prismatic_box_is_a_rod(box: Any, rubber: Any) -> None:
    rod = replace(box, axes=("x",), main_axis="x", joint="prismatic")
    theory = BoxModule(2.6e5, 0.3)
    here = solver(rod, rubber)
    rest = here.rest()
    assert rest.dmoment_du == pytest.approx(-theory.axial_stiffness_n_m, rel=1e-4)
    assert rest.dmoment_dp == pytest.approx(theory.thrust_m2, rel=1e-4)
    small_pa = 20.0  # the walls bulge soon
    free = here.free(small_pa, rest)
    assert free.angle_rad == pytest.approx(small_pa * theory.thrust_m2 / theory.axial_stiffness_n_m, rel=1e-2)
    assert abs(free.moment_n_m) < 1e-4 * small_pa * theory.thrust_m2


def test_runs_are_kept_where_asked_and_stopped_in_time(box: Any, rubber: Any, tmp_path: Path) -> None:
    here = solver(box, rubber, keep=tmp_path, timeout_s=0.001)
    with pytest.raises(StateNotConvergedError, match="stopped after 0.001 s"):
        here.rest()
    solver(box, rubber, keep=tmp_path).rest()
    assert {f.name for f in tmp_path.glob("*/deck.*")} >= {"deck.inp", "deck.dat", "deck.log"}
