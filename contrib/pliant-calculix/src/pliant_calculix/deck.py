"""Decks: a model's cards, and how the end section's plane is kept.

Two ways of keeping the plane, of which each deck uses one:

- `plane_cards`, CalculiX only: `*MPC PLANE` through three extra nodes, of which two move along x: the angle is an
  unknown or is held, and may change from step to step.
- `equation_cards`, CalculiX and Abaqus: the plane's normal n(θ) is known, n·(X + u) = c with c the unknown of one
  extra node. `*EQUATION` has no constant, so that n·(X − X_ref) is the coefficient of a second extra node, whose
  displacement goes from 0 to 1 in the step.

Positive θ turns the end toward −z: n = (cos θ, 0, −sin θ).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.records.fem import IntArray
from pliant_calculix.model import MM, Model
from pliant_calculix.plates import PLATE_STIFFNESS, contact_cards

PER_LINE = 15  # node numbers
TERMS_PER_LINE = 4
INCREMENTS = 200
FIRST_INCREMENT = 0.25
PER_TABLE_LINE = 8
NOTHING = 1e-14


@dataclass(frozen=True)
class Target:
    """A point of a path: pressure in Pa, and θ (rad) or the extension (m) of the piece, None where free."""

    pressure_pa: float
    held: float | None


def model_cards(model: Model, heading: Sequence[str]) -> list[str]:
    """Return nodes, elements, sets, surfaces, sections, materials and supports."""
    cards = ["*HEADING", heading[0], *[f"** {line}" for line in heading[1:]]]
    cards += ["*NODE, NSET=BODY_AND_CAPS"]
    cards += [_node(i + 1, MM * model.places_m[i]) for i in model.used]
    cards += _elements(model.element, "BODY", model.cells, 1)
    cards += _elements("C3D15", "CAP", model.wedges, 1 + len(model.cells))
    first_plate = 1 + len(model.cells) + len(model.wedges)
    cards += _elements("C3D8", "PLATES", model.plates.bricks, first_plate)
    for name, nodes in model.node_sets.items():
        cards += _set(name.upper(), nodes)
    cards += _set("SECTION", model.section)
    elements, numbers = model.cavity_faces
    cards.append("*SURFACE, NAME=CAVITY, TYPE=ELEMENT")
    cards += [f"{e + 1}, S{n}" for e, n in zip(elements, numbers, strict=True)]
    cards += [f"{e + 1 + len(model.cells)}, S1" for e in range(len(model.wedges))]
    for number, (cells, law) in enumerate(model.solids):
        cards += [*_rows(f"*ELSET, ELSET=SOLID{number}", cells), f"*MATERIAL, NAME=RUBBER{number}", *law]
        cards += [f"*SOLID SECTION, ELSET=SOLID{number}, MATERIAL=RUBBER{number}"]
    if len(model.wedges):
        cards += ["*MATERIAL, NAME=THIN", *model.cap_law, "*SOLID SECTION, ELSET=CAP, MATERIAL=THIN"]
    if model.plates.planes:
        cards += [
            "*MATERIAL, NAME=PLATE",
            "*ELASTIC",
            f"{PLATE_STIFFNESS * model.contact_stiffness:.10g}, 0.0",
        ]
        cards += ["*SOLID SECTION, ELSET=PLATES, MATERIAL=PLATE"]
    cards += contact_cards(model.plates, model.problem.mesh.cells, first_plate, model.contact_stiffness)
    fixed = model.fixed
    cards += ["*BOUNDARY", *[f"{node + 1}, {c + 1}" for node, c in fixed]]
    for (node, c), weights in model.follows.items():
        if weights:
            leaders = [(n, c, -w) for n, w in weights.items()]
            cards += _equation([(node, c, 1.0), *leaders])
    return cards


def plane_cards(model: Model) -> list[str]:
    """Return cards of extra nodes A and T, and B, C next to A: u_B − u_A = u_T along x tilts the plane, u_A moves it.

    The cap's back is kept in separate planes, parallel to the section: coupled along x to the front, which itself is
    coupled to the plane, it would not follow.
    """
    a = model.reference
    span, height = MM * model.problem.span_m, MM * model.problem.reference_z_m
    nodes: list[str] = []
    cards: list[str] = []
    for k, (depth, members) in enumerate(model.planes.items()):
        first = a if k == 0 else a + 4 + 3 * (k - 1)
        x = span + MM * depth
        nodes += [_node(first + 1, (x, 0.0, height)), _node(first + 2, (x, 0.0, height + span))]
        nodes += [_node(first + 3, (x, span, height))]
        if k == 0:
            nodes += [_node(a + 4, (span, 0.0, height))]
        else:
            cards += _equation([(first, 0, 1.0), (a, 0, -1.0)])
        cards += _equation([(first + 1, 0, 1.0), (a, 0, -1.0), (a + 3, 0, -1.0)])
        cards += _equation([(first + 2, 0, 1.0), (a, 0, -1.0)])
        words = ["PLANE", *[str(n + 1) for n in (first, first + 1, first + 2, *members)]]
        cards += ["*MPC", *_continued(words)]
    fixed = ["*BOUNDARY", *[f"{a + 1 + k}, 2, 3" for k in range(model.extra)]]
    return ["*NODE, NSET=PLANE", *nodes, *fixed, *cards, *_set("PRINTED", np.append(model.used, [a, a + 3]))]


def path_cards(model: Model, targets: Sequence[Target], tolerance: float) -> list[str]:
    """Return a step for `plane_cards` that passes the targets at times 1, 2, … and prints there.

    A step for each target would be plainer, but CalculiX 2.20 loses equilibrium between steps with `*MPC PLANE`.
    """
    moved, tilted = model.reference + 1, model.reference + 4
    prismatic = model.problem.joint == "prismatic"
    cards = _table("PRESSURE", [model.pa * t.pressure_pa for t in targets])
    motion = [f"{tilted}, 1, 1, 0.0"] if prismatic else []
    held = [t.held for t in targets if t.held is not None]
    if held:
        span = MM * model.problem.span_m
        cards += _table("HELD", [MM * h if prismatic else span * float(np.tan(h)) for h in held])
    if len(held) < len(targets) and held:
        raise ValueError("a path holds its coordinate at all targets or at none")
    times = [f"{k + 1:.1f}" for k in range(len(targets))]
    cards += ["*TIME POINTS, NAME=ENDS", *_continued(times, PER_TABLE_LINE)]
    cards += [f"*STEP, NLGEOM=YES, INC={INCREMENTS}", "*CONTROLS, PARAMETERS=FIELD"]
    cards += [f"{tolerance:.6g}, {tolerance:.6g}, 0.01, 0.02, {tolerance:.6g}, 1e-5, 1e-3, 1e-20"]
    cards += ["*STATIC", f"{FIRST_INCREMENT}, {len(targets)}.0, 1e-3, 1.0"]
    cards += ["*BOUNDARY", *motion] if motion else []
    if held:
        driven = moved if prismatic else tilted
        cards += ["*BOUNDARY, AMPLITUDE=HELD", f"{driven}, 1, 1, 1.0"]
    cards += ["*DSLOAD, AMPLITUDE=PRESSURE", "CAVITY, P, 1.0"]
    return [*cards, "*NODE PRINT, NSET=PRINTED, TIME POINTS=ENDS", "U, RF", "*END STEP"]


def contact_path_cards(model: Model, target: Target, tolerance: float) -> list[str]:
    """Return the deck of one prescribed state of a model with contact, printed at the end as in `path_cards`."""
    assert target.held is not None
    cards = [
        *model_cards(model, ["A module whose walls touch, by Pliant"]),
        *equation_cards(model, target.held),
    ]
    cards += [*_set("PRINTED", model.used), "*TIME POINTS, NAME=ENDS", "1.0"]
    cards += [f"*STEP, NLGEOM=YES, INC={INCREMENTS}", "*CONTROLS, PARAMETERS=FIELD"]
    cards += [f"{tolerance:.6g}, {tolerance:.6g}, 0.01, 0.02, {tolerance:.6g}, 1e-5, 1e-3, 1e-20"]
    cards += ["*STATIC", "0.1, 1.0, 1e-4, 0.25", "*BOUNDARY", *equation_motion(model, target.held)]
    cards += ["*DSLOAD", f"CAVITY, P, {model.pa * target.pressure_pa:.12e}"]
    return [*cards, "*NODE PRINT, NSET=PRINTED, TIME POINTS=ENDS", "U, RF", "*END STEP"]


def _table(name: str, values: Sequence[float]) -> list[str]:
    """Return an amplitude that is zero at time 0 and has these values at the times 1, 2, …"""
    words = [f"{x:.12e}" for pair in enumerate([0.0, *values]) for x in pair]
    return [f"*AMPLITUDE, NAME={name}", *_continued(words, PER_TABLE_LINE)]


def equation_cards(model: Model, held: float) -> list[str]:
    """Return extra nodes REFERENCE and TURN, for the angle θ (rad) or the extension (m) `held`."""
    problem, reference = model.problem, model.reference + 1
    theta = 0.0 if problem.joint == "prismatic" else held
    place = MM * np.array([problem.span_m, 0.0, problem.reference_z_m])
    normal = np.array([np.cos(theta), 0.0, -np.sin(theta)])
    cards = [
        "*NODE, NSET=REFERENCE",
        _node(reference, place),
        "*NODE, NSET=TURN",
        _node(reference + 1, place),
    ]
    cards += ["*BOUNDARY", f"{reference}, 2, 3", f"{reference + 1}, 2, 3"]
    for node in [*model.section, *model.cap.behind, *model.plates.back("end")]:
        # nodes behind the section keep their distance along x
        constant = normal[2] * float(MM * model.places_m[node, 2] - place[2])
        # a dependent node may not be independent in another equation
        leaders = model.cap.follows.get((int(node), 2), {int(node): 1.0})
        terms = [(int(node), 0, normal[0]), *[(n, 2, w * normal[2]) for n, w in leaders.items()]]
        terms += [(reference - 1, 0, -normal[0]), (reference, 0, constant)]
        cards += _equation([term for term in terms if abs(term[2]) > NOTHING])
    return cards


def equation_motion(model: Model, held: float) -> list[str]:
    """Return `*BOUNDARY` of the extra nodes of `equation_cards` at the end of the step."""
    reference = model.reference + 1
    lines = [f"{reference + 1}, 1, 1, 1.0"]
    if model.problem.joint == "prismatic":
        lines.append(f"{reference}, 1, 1, {MM * held:.12e}")
    return lines


def step_cards(model: Model, target: Target) -> list[str]:
    """Return the step for `equation_cards` at a prescribed target, in Abaqus' keywords."""
    assert target.held is not None
    cards = [f"*STEP, NLGEOM=YES, INC={INCREMENTS}", "*STATIC", f"{FIRST_INCREMENT}, 1.0, 1e-4, 1.0"]
    cards += ["*BOUNDARY", *equation_motion(model, target.held)]
    return [*cards, "*DSLOAD", f"CAVITY, P, {model.pa * target.pressure_pa:.12e}"]


def _node(number: int, place: Sequence[float] | np.ndarray) -> str:
    return f"{number}, " + ", ".join(f"{x:.12e}" for x in place)


def _equation(terms: Sequence[tuple[int, int, float]]) -> list[str]:
    """Return Σ coefficient · component of node = 0, nodes and components from 0; the first is eliminated."""
    words = [f"{node + 1}, {c + 1}, {factor:.12e}" for node, c, factor in terms]
    return ["*EQUATION", str(len(terms)), *_continued(words, TERMS_PER_LINE)]


def _elements(kind: str, name: str, nodes: IntArray, first: int) -> list[str]:
    if not len(nodes):
        return []
    cards = [f"*ELEMENT, TYPE={kind}, ELSET={name}"]
    for k, ids in enumerate(nodes):
        cards += _continued([str(i) for i in (first + k, *(ids + 1))], 11)
    return cards


def _set(name: str, nodes: IntArray) -> list[str]:
    return _rows(f"*NSET, NSET={name}", nodes)


def _rows(card: str, numbers: IntArray) -> list[str]:
    """Return a card and its numbers, given from 0."""
    rows = [numbers[k : k + PER_LINE] for k in range(0, len(numbers), PER_LINE)]
    return [card, *[", ".join(str(i + 1) for i in row) for row in rows]]


def _continued(words: Sequence[str], width: int = PER_LINE) -> list[str]:
    """Return words on lines of `width`, each but the last ending in a comma."""
    rows = [", ".join(words[k : k + width]) for k in range(0, len(words), width)]
    return [row + "," for row in rows[:-1]] + rows[-1:]
