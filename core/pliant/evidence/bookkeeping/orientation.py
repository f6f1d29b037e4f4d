"""Gravity that is missing, unwanted (a chain on a table) or rotated; a base that is mounted rotated."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import partial

import numpy as np

from pliant.evidence.bookkeeping.mistake import Correction
from pliant.formatting import number
from pliant.interfaces.effect import Model
from pliant.mechanics.rotations import quaternion_from_matrix
from pliant.records.chain import GRAVITY_M_S2, ChainModel
from pliant.records.design import Array

STANDARD_M_S2 = abs(GRAVITY_M_S2[2])
# Downward first: of equally good corrections the first one is reported.
DIRECTIONS = {
    "−z": (0.0, 0.0, -1.0),
    "+z": (0.0, 0.0, 1.0),
    "−x": (-1.0, 0.0, 0.0),
    "+x": (1.0, 0.0, 0.0),
    "−y": (0.0, -1.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
}


def gravity_corrections(chain: ChainModel) -> Iterator[Correction]:
    """Yield other gravities: zero, the standard one if there was none, or the same magnitude in another direction."""
    gravity = np.asarray(chain.gravity_m_s2, float)
    size = float(np.linalg.norm(gravity))
    if size > 0.0:
        words = "gravity does not act, as if the chain lay on a table"
        remedy = "If it did, write 'chain.gravity: [0, 0, 0]' into the study."
        yield Correction(
            "gravity", ("chain.gravity",), words, remedy, model=partial(_with_gravity, np.zeros(3))
        )
    for name, direction in DIRECTIONS.items():
        other = (size or STANDARD_M_S2) * np.array(direction)
        if np.allclose(other, gravity):
            continue
        value = f"[{', '.join(number(float(g), 4) for g in other)}]"
        words = (
            f"gravity acts along {name}, and the study has none"
            if size == 0.0
            else f"gravity acts along {name}, not where the study has it"
        )
        remedy = (
            "Take 'chain.gravity: [0, 0, 0]' out of the study."
            if size == 0.0 and name == "−z"
            else f"Write 'chain.gravity: {value}' into the study, or the base as it was mounted ('chain.base')."
        )
        yield Correction("gravity", ("chain.gravity",), words, remedy, model=partial(_with_gravity, other))


def base_corrections(chain: ChainModel) -> Iterator[Correction]:
    """Yield the 23 other bases that quarter turns make of the chain's, the simplest turns first."""
    signed = [
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    ]
    turns = [turn for turn in signed if np.linalg.det(turn) > 0.0 and not np.allclose(turn, np.eye(3))]
    for turn in sorted(turns, key=lambda turn: -float(np.trace(turn))):
        base = turn @ chain.base_rotation
        points = _direction(base[:, 0])
        quaternion = ", ".join(number(float(q), 4) for q in quaternion_from_matrix(base))
        words = (
            f"the base is turned: the chain points along {points} and bends toward {_direction(-base[:, 2])}"
        )
        remedy = f"Write the base as it was mounted, as in 'chain.base: {{quaternion: [{quaternion}]}}'."
        yield Correction("orientation", ("chain.base",), words, remedy, model=partial(_turned, turn))


def _direction(vector: Array) -> str:
    """Return a signed world axis, or the components of a direction between the axes."""
    axis = int(np.argmax(np.abs(vector)))
    if abs(vector[axis]) > 1.0 - 1e-6:
        return f"{'−' if vector[axis] < 0.0 else '+'}{'xyz'[axis]}"
    return f"({', '.join(number(float(v), 2) for v in vector)})"


def _with_gravity(gravity: Array, model: Model) -> Model:
    return model.with_(chain=model.chain.with_(gravity_m_s2=gravity))


def _turned(rotation: Array, model: Model) -> Model:
    return model.with_(chain=model.chain.with_(base_rotation=rotation @ model.chain.base_rotation))
