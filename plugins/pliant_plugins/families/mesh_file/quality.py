"""Whether a mesh can be solved on: cells neither inverted nor collapsed, one body without cracks."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from pliant.errors import InvalidDesignError
from pliant.meshing.cells import kind_of
from pliant.records.design import Array
from pliant.records.fem import IntArray

WORST = 1e-3  # scaled Jacobian below which a cell is refused
POOR = 0.05  # and below which it is remarked upon
COINCIDENT = 1e-7  # of the body's size


def scaled_jacobians(nodes_m: Array, cells: IntArray) -> Array:
    """(m,) smallest det ∂x/∂ξ of each cell over the product of its edges there: 1 for a cube or a corner's tetrahedron.

    (Knupp, Int. J. Numer. Meth. Engng 48 (2000) 1165–1185.)
    """
    kind = kind_of(cells)
    slopes = np.einsum("qnj,mni->mqij", kind.shape_slopes(kind.sample_points()), nodes_m[cells])
    lengths = np.linalg.norm(slopes, axis=2).prod(axis=-1)
    return np.asarray((np.linalg.det(slopes) / np.maximum(lengths, np.finfo(float).tiny)).min(axis=1))


def require_sound(nodes_m: Array, cells: IntArray, places: Array, name: str) -> str | None:
    """Raise `InvalidDesignError` for a mesh that cannot be solved on; a sentence where it is only poor.

    Args:
        nodes_m: (n, 3), all of them used.
        cells: quadratic.
        places: (m, 3) of the cells in the file.
        name: of the file.
    """
    quality = scaled_jacobians(nodes_m, cells)
    inverted = np.flatnonzero(quality <= 0)
    if len(inverted) == len(cells):
        raise InvalidDesignError(
            f"all {len(cells)} cells of '{name}' are inverted: their nodes run the other way round; export the mesh "
            "with right-handed cells."
        )
    if len(inverted):
        where = _place(places, inverted)
        raise InvalidDesignError(
            f"{len(inverted)} of {len(cells)} cells of '{name}' are inverted, the first at {where}; "
            "use a finer mesh where curved walls are thin, or cells of first order."
        )
    flat = np.flatnonzero(quality < WORST)
    if len(flat):
        raise InvalidDesignError(
            f"{len(flat)} of {len(cells)} cells of '{name}' are flat (scaled Jacobian {quality.min():.2g}, at least "
            f"{WORST:g} is needed), the first at {_place(places, flat)}; let the mesher optimise "
            "the volume mesh."
        )
    _require_one_body(nodes_m, cells, name)
    poor = int((quality < POOR).sum())
    if not poor:
        return None
    return (
        f"{poor} of {len(cells)} cells of '{name}' are of poor shape (scaled Jacobian down to {quality.min():.2g}): "
        "stresses there are rough."
    )


def _place(places: Array, chosen: IntArray) -> str:
    return "({:.4g}, {:.4g}, {:.4g}) in the file".format(*places[chosen[0]])


def _require_one_body(nodes_m: Array, cells: IntArray, name: str) -> None:
    grid = COINCIDENT * float(np.ptp(nodes_m, axis=0).max())
    double = len(nodes_m) - len(np.unique(np.round(nodes_m / grid).astype(np.int64), axis=0))
    if double:
        raise InvalidDesignError(
            f"{double} nodes of '{name}' coincide with others: the body has a crack there; merge coincident nodes."
        )
    rows, columns = np.repeat(cells[:, 0], cells.shape[1]), cells.ravel()
    links = sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(nodes_m),) * 2)
    bodies, _ = connected_components(links, directed=False)
    if bodies > 1:
        raise InvalidDesignError(
            f"'{name}' holds {bodies} bodies that share no nodes; a module is one body: fuse them, or mesh them as one."
        )
