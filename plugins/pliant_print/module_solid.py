"""A family's module as closed surfaces: the boundary of the solved mesh, completed by its mirror images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pliant.errors import PluginFailureError, UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.meshing import tetrahedra
from pliant.meshing.cells import boundary_faces, cell_volumes, face_cell_kind
from pliant.meshing.hexahedra import lagrange
from pliant.meshing.surfaces import mirrored
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh, ModuleProblem
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import solid, surface, united
from pliant_print.loops import merged

BODY, LINKS = "body", "links"
PIECES = (
    1,
    3,
    4,
    5,
    6,
    8,
    12,
)  # plane pieces along the edge of a curved quadratic face, until the volume agrees
ENOUGH = 2.5e-3  # of the volume: difference between plane pieces and curved faces
FLAT = 1e-6  # of the module: tolerance of a mirror plane


@dataclass(frozen=True, eq=False)
class ModuleSolid:
    """One module in its own frame, origin at the joint.

    Attributes:
        bodies: closed surfaces by material: `body`, the mesh's regions, `links` for rigid parts outside the mesh.
        volumes_m3: volumes of the same bodies by the FEM's own quadrature.
        cavities: points (n, 3) on the wall of each cavity, by the name of its pressure.
        length_m: of the module.
        offset_m: of the chain's centre line over the joint.
        tendon: (y, z) in m of the straight hole of a tendon, if the module has one.
        notes: what of the FEM model is no solid.
        ribbons: width (m) and EA (N) of the bands along the joint's line that the FEM has without a thickness.
    """

    bodies: Mapping[str, TriangleMesh]
    volumes_m3: Mapping[str, float]
    cavities: Mapping[str, Array]
    length_m: float
    offset_m: float
    tendon: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()
    ribbons: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def module_solid(family: ActuatorFamily, refinement: int = 1) -> ModuleSolid:
    """Return a family's module from the mesh that its FEM solves.

    Raises:
        UserError: the family has no mesh.
        PluginFailureError: the mirror images of its piece do not make the module that its energy represents.
    """
    if not family.has_mesh:
        raise UserError(
            f"family '{family.design.family}' has no mesh, so that there is no solid of it; its law is a closed form."
        )
    problem = family.problem(refinement if family.refines else 1)
    mesh, length = problem.mesh, family.module_length_m
    planes = mirror_planes(problem)
    copies = 2 ** len(planes)
    if abs(copies - problem.energy_scale) > 1e-9:
        raise PluginFailureError(
            f"family '{family.design.family}': its piece has {copies - 1} mirror images, and its energy is "
            f"{problem.energy_scale:g} times that of the piece."
        )
    shift = 0.0 if problem.deformation_scale == 2.0 else -problem.span_m / 2
    regions = {name: cells for name, cells in _regions(mesh).items() if len(cells)}
    volumes = {
        name: copies * float(cell_volumes(mesh.nodes_m, mesh.cells[cells]).sum())
        for name, cells in regions.items()
    }
    bodies = _bodies(mesh, regions, planes, shift, volumes)
    rigid = family.surface()
    if rigid.rigid_start is not None and rigid.rigid_end is not None:
        pair = [solid(merged(part), "a rigid part") for part in (rigid.rigid_start, rigid.rigid_end)]
        bodies[LINKS] = surface(united(pair))
        volumes[LINKS] = enclosed_m3(rigid.rigid_start) + enclosed_m3(rigid.rigid_end)
    ribbons = {
        f"ribbon_{number}": (_whole_width(one.width_m, planes), _whole_width(one.stiffness_n, planes))
        for number, one in enumerate(problem.ribbons, 1)
    }
    return ModuleSolid(
        bodies,
        volumes,
        _cavity_points(mesh, shift),
        length,
        family.offset_m,
        None if problem.tendon is None else (0.0, problem.tendon.z_m),
        tuple(_notes(problem)),
        ribbons,
    )


def _whole_width(value: float, planes: Mapping[int, float]) -> float:
    return 2.0 * value if 1 in planes else value


def mirror_planes(problem: ModuleProblem) -> dict[int, float]:
    """Return axis → coordinate (m) of the planes in which mirror images of the solved piece make the module.

    Across x a piece is half a module if its deformation counts twice. Across y and z they are the node sets with this
    component of v alone fixed, if they are a whole plane side of the mesh.
    """
    mesh = problem.mesh
    found = {0: 0.0} if problem.deformation_scale == 2.0 else {}
    near = FLAT * problem.span_m
    for name, fixed in problem.fixed.items():
        if len(fixed) != 1 or fixed[0] == 0:
            continue
        axis, places = fixed[0], mesh.nodes_m[mesh.node_sets[name]]
        held = np.isin(mesh.skin, mesh.node_sets[name]).all(axis=1)
        if not held.any() or np.ptp(places[:, axis]) > near:
            continue
        level, whole = float(places[0, axis]), mesh.nodes_m[:, axis]
        if min(abs(level - whole.min()), abs(level - whole.max())) < near:
            found[axis] = level
    return found


def _regions(mesh: ModuleMesh) -> dict[str, IntArray]:
    numbers = mesh.region_numbers
    return {BODY: np.flatnonzero(numbers == 0), **{k: np.asarray(v) for k, v in mesh.regions.items()}}


def _bodies(
    mesh: ModuleMesh,
    regions: Mapping[str, IntArray],
    planes: Mapping[int, float],
    shift: float,
    volumes: Mapping[str, float],
) -> dict[str, TriangleMesh]:
    """Return the surfaces of the regions, divided until their volumes agree with the FEM's."""
    for pieces in PIECES:
        made = {name: _whole(mesh, cells, planes, shift, pieces) for name, cells in regions.items()}
        if all(abs(enclosed_m3(made[name]) / volumes[name] - 1) < ENOUGH for name in made):
            break
    return made


def _whole(
    mesh: ModuleMesh, cells: IntArray, planes: Mapping[int, float], shift: float, pieces: int
) -> TriangleMesh:
    """Return the closed surface of a set of cells and of their mirror images."""
    faces, _ = boundary_faces(mesh.cells[cells])
    near = FLAT * float(np.ptp(mesh.nodes_m, axis=0).max())
    nodes = mesh.nodes_m.copy()
    for axis, level in planes.items():
        on = np.abs(nodes[:, axis] - level) < near
        nodes[on, axis] = level
        faces = faces[~on[faces].all(axis=1)]
    whole = divided(nodes, faces, pieces)
    for axis, level in planes.items():
        step = np.zeros(3)
        step[axis] = level
        there = TriangleMesh(whole.vertices_m - step, whole.faces)
        image = mirrored(there, axis)
        whole = whole.joined(TriangleMesh(image.vertices_m + step, image.faces))
    return merged(TriangleMesh(whole.vertices_m + np.array([shift, 0.0, 0.0]), whole.faces))


def divided(nodes_m: Array, faces: IntArray, pieces: int) -> TriangleMesh:
    """Return quadratic faces (f, 9) or (f, 6) as plane triangles between points of the curved faces."""
    n = pieces + 1
    line = np.linspace(0.0, 1.0, n)
    if face_cell_kind(faces).nodes == 27:
        values = lagrange(line)[0]
        corner = nodes_m[faces].reshape(-1, 3, 3, 3)  # [face, b, a, component]
        points = np.einsum("qa,rb,fbai->frqi", values, values, corner).reshape(len(faces), n * n, 3)
        ids = np.arange(n * n).reshape(n, n)
        a, b, c, d = ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]
        local = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    else:
        places = [(i, j) for j in range(n) for i in range(n - j)]
        number = {place: k for k, place in enumerate(places)}
        values = tetrahedra.face_shapes(np.array(places, float) / pieces)
        points = np.einsum("qa,fai->fqi", values, nodes_m[faces])
        ups = [((i, j), (i + 1, j), (i, j + 1)) for i, j in places if i + j < pieces]
        downs = [((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i, j in places if i + j < pieces - 1]
        local = np.array([[number[corner] for corner in one] for one in (*ups, *downs)], np.int64)
    starts = points.shape[1] * np.arange(len(faces))[:, None, None]
    return TriangleMesh(points.reshape(-1, 3), (starts + local).reshape(-1, 3).astype(np.int64))


def enclosed_m3(part: TriangleMesh) -> float:
    """Return the volume within a closed surface."""
    a, b, c = (part.vertices_m[part.faces[:, k]] for k in range(3))
    return float(np.einsum("ki,ki->", a, np.cross(b, c)) / 6)


def _cavity_points(mesh: ModuleMesh, shift: float) -> dict[str, Array]:
    named = dict(mesh.cavities) or ({"pressure_pa": mesh.cavity} if len(mesh.cavity) else {})
    move = np.array([shift, 0.0, 0.0])
    return {name: mesh.nodes_m[np.unique(faces)] + move for name, faces in named.items()}


def _notes(problem: ModuleProblem) -> list[str]:
    said = []
    if problem.fibres:
        said.append(
            "The threads of the FEM lie spread in the wall and are no bodies here; wind them on the tube."
        )
    if "wound" in problem.fixed:
        said.append(
            "The FEM holds the outline of each section, as a close winding of thread does; the winding is no body here."
        )
    return said
