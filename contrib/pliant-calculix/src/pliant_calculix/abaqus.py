"""A deck for people: one module at one pressure and angle, in cards that Abaqus/Standard and CalculiX both read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from pliant.errors import UserError
from pliant.interfaces.material import Material
from pliant.records.fem import ModuleProblem
from pliant_calculix.config import ElementType
from pliant_calculix.deck import Target, equation_cards, model_cards, step_cards
from pliant_calculix.model import MPA, Model, build_model

CAP_STIFFNESS = 1e-6
# Mixed elements that only Abaqus has, in addition to the common ones.
HYBRID = ("C3D20RH", "C3D20H")


def abaqus_model(problem: ModuleProblem, material: Material, element: str = "C3D20R") -> Model:
    """Return the model in mm, N and MPa, the cavity closed at both ends. Raises `UserError`."""
    known = (*get_args(ElementType), *HYBRID)
    if element not in known:
        raise UserError(f"the element '{element}' is none of {', '.join(known)}.")
    return build_model(problem, material, element, CAP_STIFFNESS, MPA, closed_start=True)


def abaqus_deck(model: Model, target: Target, heading: Sequence[str]) -> list[str]:
    """Return the lines of the deck of one prescribed state."""
    assert target.held is not None
    words = [*heading, *_notes(model, target)]
    cards = [*model_cards(model, words), *equation_cards(model, target.held), *step_cards(model, target)]
    return [*cards, "*NODE PRINT, NSET=START", "U, RF", "*NODE PRINT, NSET=SECTION", "U", "*END STEP"]


def _notes(model: Model, target: Target) -> list[str]:
    problem = model.problem
    held = "extension" if problem.joint == "prismatic" else "angle"
    unit = "m" if problem.joint == "prismatic" else "rad"
    assert target.held is not None
    return [
        "Units: mm, N, MPa. x runs along the chain, bending is about y, toward -z.",
        f"The piece: {held} {target.held:.9g} {unit}; module: {problem.deformation_scale:g} times that, "
        f"energy {problem.energy_scale:g} times the piece's.",
        f"Pressure {target.pressure_pa:.9g} Pa on the surface CAVITY, caps included.",
        "Node sets: START, END (the two sections), SYMMETRY and others of the family, SECTION (END and its cap).",
        "Abaqus/Standard: prefer the element types C3D20RH or C3D20H; the rest stands as it is.",
    ]
