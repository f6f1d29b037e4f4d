"""Sentences on a study that has run: unusual numbers, unused blocks, loads and the side to which it bends."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pliant.config.study import Study, written_name
from pliant.formatting import display_unit, quantity
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.task import TaskConfig
from pliant.pipeline.segments import OF_RODS
from pliant.records.chain import ChainModel
from pliant.units import si_unit

# Usual ranges of a study's quantities, SI.
USUAL: Mapping[str, tuple[float, float]] = {
    "module_length_m": (1e-3, 0.5),
    "module_radius_m": (5e-4, 0.2),
    "inner_radius_m": (2e-4, 0.1),
    "average_radius_m": (3e-4, 0.2),
    "module_mass_kg": (1e-6, 2.0),
    "payload_kg": (1e-6, 20.0),
    "gravity_m_s2": (1.0, 30.0),
    "wall_m": (2e-4, 2e-2),
    "pressure_pa": (100.0, 1e6),
    "shear_modulus_pa": (1e3, 1e8),
    "density_kg_m3": (500.0, 3000.0),
    "tendon_force_n": (1e-2, 500.0),
}


def unusual_numbers(study: Study) -> Iterator[str]:
    """Yield a sentence for each number outside its usual range."""
    blocks = [(head, getattr(study, head)) for head in ("family", "material", "chain", "task")]
    segments = study.chain.segments if study.chain is not None else ()
    blocks += [(f"chain.segments.{k}", segment) for k, segment in enumerate(segments)]
    for head, block in blocks:
        for name in type(block).model_fields if isinstance(block, FrozenModel) else ():
            value = getattr(block, name)
            low, high = USUAL.get(name, (-math.inf, math.inf))
            if name in USUAL and isinstance(value, tuple) and value:
                value = float(np.abs(value).max())
            if isinstance(value, int | float) and value != 0 and not low <= abs(value) <= high:
                span = f"{quantity(low, si_unit(name), 3)} to {quantity(high, si_unit(name), 3)}"
                yield (
                    f"{head}.{written_name(type(block), name)} is {quantity(value, si_unit(name), 4)}; {span} is "
                    "usual. Is its unit right?"
                )


def unused_blocks(study: Study, solved: Sequence[bool]) -> list[str]:
    """Return the blocks that are set but that no stage of a run reads; `solved`: which designs have FEM data."""
    idle = study.fem is not None and not study.read_by() and not any(solved)
    return [*study.unused(), *(["fem"] if idle else []), *_overridden(study)]


def _overridden(study: Study) -> list[str]:
    """Return the chain's keys that every segment or the task overrides."""
    chain = study.chain
    placed = (
        chain is not None and "base" in chain.model_fields_set and getattr(study.task, "places_base", False)
    )
    return [*(["chain.base"] if placed else []), *_overridden_by_segments(study)]


def _overridden_by_segments(study: Study) -> list[str]:
    """Return the chain's dimensions of modules that every segment overrides."""
    chain = study.chain
    owners = [] if chain is None else [one for one in chain.segments if one.rigid is None]
    if chain is None or not owners or study.read_by():
        return []
    return [
        f"chain.{written_name(type(chain), name)}"
        for name in OF_RODS
        if getattr(chain, name) and all(getattr(one, name) is not None for one in owners)
    ]


def turned_remarks(study: Study, chain: ChainModel) -> list[str]:
    """Return a sentence if actuation bends a module from a user's file toward the direction named `up`."""
    law, up = chain.laws[0], getattr(study.family, "up", None)
    if not isinstance(up, str) or law.domain.actuation.shape != (2,) or "y" not in law.axes:
        return []
    at_rest = law.evaluate(law.domain.actuation[1:], np.zeros((1, len(law.axes)))).tau[0]
    if not at_rest[law.axes.index("y")] < 0.0:
        return []
    other = up.removeprefix("-") if up.startswith("-") else f"-{up}"
    return [
        f"Actuation bends the module toward 'family.up: {up}', by negative angles; where it should bend away from it, "
        f"write 'up: {other}', and 'line_height' along it."
    ]


# A payload with a larger ratio to the chain's mass was probably meant in grams.
HEAVY = 100.0


def load_remarks(chain: ChainModel, task: TaskConfig) -> tuple[str, ...]:
    """Return sentences if the payload, the task's or else the chain's, has no weight or far too much."""
    own = getattr(task, "payload_kg", None)
    payload_kg = chain.payload_kg if own is None else float(own)
    mass_kg = sum(body.mass_kg for body in chain.bodies)
    words = display_unit("kg")
    found = []
    if payload_kg > 0.0 and not np.any(chain.gravity_m_s2):
        found.append("The payload weighs nothing: chain.gravity is [0, 0, 0].")
    if np.any(chain.gravity_m_s2) and payload_kg == mass_kg == 0.0:
        found.append("The chain weighs nothing and gravity does nothing: is chain.module_mass missing?")
    if own is not None and chain.payload_kg not in (0.0, payload_kg):
        kept, left = words.text(payload_kg), words.text(chain.payload_kg)
        found.append(f"task.payload of {kept} replaces chain.payload of {left}.")
    if payload_kg > HEAVY * mass_kg > 0.0:
        grams = words.text(payload_kg / 1000.0)
        found.append(f"A payload of {payload_kg:g} kg on a chain of {words.text(mass_kg, 2)}: is it {grams}?")
    return tuple(found)
