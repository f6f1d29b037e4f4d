"""Surfaces of an Abaqus or CalculiX deck: `*SURFACE, TYPE=ELEMENT`, which meshio leaves out.

A line of such a card is an element's number or the name of an element set, and the side S1, S2, …
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pliant.records.fem import IntArray

Members = list[tuple[int, int]]  # places of solid cells and their sides


def element_surfaces(path: Path, volumes: Mapping[str, IntArray]) -> dict[str, Members]:
    """Surface → (place of the solid cell, number of its side); what is no such line is passed over.

    Args:
        path: the deck.
        volumes: name → places of solid cells, of its element sets.
    """
    sets = {name.upper(): members for name, members in volumes.items()}
    surfaces: dict[str, list[tuple[str, int]]] = {}
    place: dict[int, int] = {}
    current: str | None = None
    kind = ""
    pending: list[str] = []
    for raw in path.read_text(errors="replace").splitlines():
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*"):
            kind, options = _card(line)
            current = (
                options.get("NAME")
                if kind == "SURFACE" and options.get("TYPE", "ELEMENT") == "ELEMENT"
                else None
            )
            solid = kind == "ELEMENT" and options.get("TYPE", "").startswith("C3D")
            kind = "SOLID" if solid else kind
            pending = []
        elif kind == "SOLID":
            pending += line.split(",")
            if not line.endswith(","):
                place[int(pending[0])] = len(place)
                pending = []
        elif current is not None:
            words = [word.strip().upper() for word in line.split(",")]
            if len(words) >= 2 and words[1][:1] == "S" and words[1][1:].isdigit():
                surfaces.setdefault(current, []).append((words[0], int(words[1][1:])))
    return {name: _members(lines, sets, place) for name, lines in surfaces.items()}


def _card(line: str) -> tuple[str, dict[str, str]]:
    """Keyword and options; names of surfaces keep their case, everything else is in capitals."""
    keyword, *options = line[1:].split(",")
    found = {}
    for option in options:
        key, _, value = option.partition("=")
        key = key.strip().upper()
        found[key] = value.strip() if key == "NAME" else value.strip().upper()
    return keyword.strip().upper(), found


def _members(lines: list[tuple[str, int]], sets: Mapping[str, IntArray], place: Mapping[int, int]) -> Members:
    found: Members = []
    for who, side in lines:
        if who.isdigit():
            found += [(place[int(who)], side)] if int(who) in place else []
        else:
            found += [(int(cell), side) for cell in np.asarray(sets.get(who, ()), int)]
    return found
