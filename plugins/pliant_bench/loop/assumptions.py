"""What the model of an experiment assumes about the specimen's place: gravity, how it hangs, what a person has set."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant import api
from pliant.formatting import listed, quantity
from pliant.pipeline.study import build_study_chain
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_bench.loop.person import words

# Directions that differ by less than this many degrees are the same in words.
SAME_DEGREES = 1.0
CHECK = "Compare this with the bench before the first run; 'chain: base' states another orientation."


def assumptions(opened: api.OpenStudy, standing: Mapping[str, float]) -> tuple[str, ...]:
    """Return in sentences what the model assumes; `standing` are the conditions as they are now, SI."""
    now = [words(name, value) for name, value in standing.items()]
    set_now = (f"Set now: {listed(now)}.",) if now else ()
    if opened.study.model is not None:
        return ("Gravity and orientation are those of the study's own model.", *set_now)
    chain = build_study_chain(opened.context, opened.study).chain
    given = set() if opened.study.chain is None else opened.study.chain.model_fields_set
    if not np.any(chain.gravity_m_s2):
        return (
            "The model assumes no gravity (chain: gravity is 0), so that its orientation makes no difference.",
            *set_now,
        )
    return (_gravity(chain, "gravity_m_s2" in given), _orientation(chain, "base" in given), *set_now)


def _gravity(chain: ChainModel, is_stated: bool) -> str:
    size = float(np.linalg.norm(chain.gravity_m_s2))
    if not size:
        return (
            "The model assumes no gravity (chain: gravity is 0), so that its orientation makes no difference."
        )
    origin = "stated" if is_stated else "the default"
    moved = sum(body.mass_kg for body in chain.bodies[1:]) + chain.payload_kg
    return (
        f"The model assumes gravity of {size:.3g} m/s² along {direction(chain.gravity_m_s2)} ({origin}), on "
        f"{quantity(moved, 'kg', 3)} beyond the first joint."
    )


def _orientation(chain: ChainModel, is_stated: bool) -> str:
    along, bent = chain.base_rotation[:, 0], -chain.base_rotation[:, 2]
    origin = "stated" if is_stated else "the default"
    return (
        f"It {_posture(along, chain.gravity_m_s2)}: from base to tip along {direction(along)}, and a positive angle "
        f"bends it toward {direction(bent)} ({origin}). {CHECK}"
    )


def _posture(along: Array, gravity: Array) -> str:
    cosine = float(along @ gravity / np.linalg.norm(gravity))
    degrees = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    for at, words_there in ((0.0, "hangs straight down"), (90.0, "lies level"), (180.0, "stands upright")):
        if abs(degrees - at) < SAME_DEGREES:
            return words_there
    return f"points {degrees:.0f}° away from straight down"


def direction(vector: Array) -> str:
    """Return a direction in the world in words: ``world −z``, or its unit vector."""
    unit = np.asarray(vector, float) / np.linalg.norm(vector)
    axis = int(np.argmax(np.abs(unit)))
    if abs(unit[axis]) > np.cos(np.radians(SAME_DEGREES)):
        return f"world {'+' if unit[axis] > 0.0 else '−'}{'xyz'[axis]}"
    return f"({', '.join(f'{value:.2g}'.replace('-', '−') for value in unit)}) in the world"
