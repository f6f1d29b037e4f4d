"""Mesh of a solved piece from a mesher's solid cells."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pliant.errors import ContractError
from pliant.meshing.cells import boundary_faces, cell_volumes
from pliant.meshing.grids import module_sets
from pliant.meshing.raising import SOLID, as_quadratic, other_handed
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh

ON_PLANE = 1e-6  # of the span: rounding of a mesher
Wet = Callable[[Array], NDArray[np.bool_]]


def piece_mesh(
    nodes_m: Array,
    kind: str,
    cells: IntArray,
    span_m: float,
    wet: Wet | Mapping[str, Wet],
    pin_m: Sequence[float] = (0.0, 0.0, 0.0),
) -> ModuleMesh:
    """Return the mesh of a piece from a mesher's solid cells: quadratic, right-handed, with skin, cavity, node sets.

    Args:
        nodes_m: (n, 3) in the module frame; unused nodes are omitted; nodes within 1e-6 of the span of an end section
            or of y = 0 are moved onto it.
        kind: meshio's name of the cells, one of `raising.SOLID`.
        cells: (m, …) node ids in VTK's order, of either orientation.
        span_m: the piece extends from x = 0 to this length.
        wet: selects the outer faces that bound the cavity by their middles (g, 3); for several pressures a function
            for each, by its name. Faces on end sections and on y = 0, where the module continues, are omitted.
        pin_m: the closest node of the start section is the node set `pin`.

    Raises:
        ContractError: cells of a kind that cannot be solved.
    """
    if kind not in SOLID:
        raise ContractError(f"cells are '{kind}'; a piece is meshed with {', '.join(SOLID)}.")
    used, renumbered = np.unique(cells, return_inverse=True)
    nodes = np.array(nodes_m[used], float)
    nodes, quadratic = as_quadratic(nodes, kind, renumbered.reshape(cells.shape).astype(np.int64))
    for axis, place in ((0, 0.0), (0, span_m), (1, 0.0)):
        nodes[np.abs(nodes[:, axis] - place) < ON_PLANE * span_m, axis] = place
    volumes = cell_volumes(nodes, quadratic)
    quadratic = np.where((volumes < 0)[:, None], other_handed(quadratic), quadratic)
    skin, _ = boundary_faces(quadratic)
    inner = ~np.any(
        [np.all(nodes[skin, axis] == place, axis=1) for axis, place in ((0, 0.0), (0, span_m), (1, 0.0))],
        axis=0,
    )
    middles = nodes[skin].mean(axis=1)
    each = wet if isinstance(wet, Mapping) else {"": wet}
    cavities = {name: skin[inner & np.asarray(of(middles), bool)] for name, of in each.items()}
    sets = module_sets(nodes, span_m)
    start = sets["start"]
    distance = np.linalg.norm(nodes[start] - np.asarray(pin_m), axis=1)
    sets["pin"] = start[[np.argmin(distance)]] if len(start) else start
    every = np.concatenate([*cavities.values()])
    return ModuleMesh(nodes, quadratic, every, skin, sets, cavities=cavities if len(cavities) > 1 else {})
