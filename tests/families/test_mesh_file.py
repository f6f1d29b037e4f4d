"""Modules from mesh files: accepted files and words, and the sentence for each wrong input."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
import pytest
from tests.slow import slow_among

from pliant.errors import InvalidDesignError, UserError
from pliant.meshing.cells import boundary_faces, cell_volumes
from pliant.meshing.raising import VTK_ORDER, as_quadratic
from pliant.meshing.surfaces import mirrored
from pliant.pipeline.remarks import turned_remarks
from pliant.pipeline.workbench import content
from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.records.law import Domain
from pliant.testing.box import HALF_LENGTH_M, Z, box_mesh, box_problem, spatial_box_mesh, tetrahedral
from pliant.testing.samples import linear_law, sample_chain
from pliant_plugins.families.chambers.two_chamber import TwoChamberConfig, build_mesh
from pliant_plugins.families.mesh_file.family import MeshFile, MeshFileConfig
from pliant_plugins.families.mesh_file.placing import require_sections
from pliant_plugins.families.mesh_file.surfaces import Skin
from pliant_plugins.fem.config import NgsolveConfig, SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

HALF = {"part": "half", "symmetry": "mirror", "unit": "mm"}
# Faces by plane: (axis, place of the box in m).
PLANES = {"base": (0, 0.0), "tip": (0, HALF_LENGTH_M), "mirror": (1, 0.0)}


def outer_faces(mesh: ModuleMesh) -> dict[str, np.ndarray]:
    """Return the quarter box's outer faces by name."""
    named = {}
    for name, (axis, place) in PLANES.items():
        on = np.all(np.abs(mesh.nodes_m[mesh.skin][..., axis] - place) < 1e-9, axis=1)
        named[name] = mesh.skin[on]
    return {**named, "cavity": mesh.cavity}


def written(
    path: Path, mesh: ModuleMesh, faces: dict[str, np.ndarray], unit_m: float = 1e-3, **more: Any
) -> Path:
    """Write tetrahedra with named surfaces as a gmsh file; `more`: `order` 1 or 2, `points`, `extra` blocks."""
    order, points = more.get("order", 2), more.get("points", mesh.nodes_m / unit_m)
    solid = ("tetra", mesh.cells[:, :4]) if order == 1 else ("tetra10", mesh.cells)
    blocks = (
        [solid]
        + [("triangle", f[:, :3]) if order == 1 else ("triangle6", f) for f in faces.values()]
        + more.get("extra", [])
    )
    names = ["solid", *faces]
    tags = [np.full(len(cells), min(k, len(names) - 1) + 1) for k, (_, cells) in enumerate(blocks)]
    data = {name: np.array([k + 1, 3 if k == 0 else 2]) for k, name in enumerate(names)}
    groups = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    out = meshio.Mesh(points, blocks, cell_data=groups, field_data=data)
    meshio.write(path, out, file_format="gmsh22", binary=False)
    return path


@pytest.fixture(scope="module")
def box() -> ModuleMesh:
    return tetrahedral(box_mesh())


def family(path: Path, **config: Any) -> MeshFile:
    return MeshFile(MeshFileConfig.model_validate({"file": path, **HALF, **config}))


def states(problem: ModuleProblem) -> tuple[float, float]:
    """Return the free angle and a blocked torque."""
    solver = Skfem(SkfemConfig(pressure_max_pa=2e3)).solver(
        problem, NeoHookean(NeoHookeanConfig(shear_modulus_pa=1e5))
    )
    rest = solver.rest()
    return solver.free(2e3, rest).angle_rad, solver.constrained(2e3, 0.1, rest).moment_n_m


def test_a_file_is_the_mesh_that_it_was_written_from(tmp_path: Path, box: ModuleMesh) -> None:
    piece = family(written(tmp_path / "box.msh", box, outer_faces(box))).piece
    volume = cell_volumes(box.nodes_m, box.cells).sum()
    assert piece.span_m == pytest.approx(HALF_LENGTH_M, rel=1e-9)
    assert cell_volumes(piece.mesh.nodes_m, piece.mesh.cells).sum() == pytest.approx(volume, rel=1e-9)
    assert len(piece.mesh.cavity) == len(box.cavity)
    assert piece.remarks == ()


def turned(path: Path, box: ModuleMesh) -> dict[str, Any]:
    """Return the mesh with the chain along −y, up along x, in centimetres, the line 3 cm to the side."""
    x, y, z = 1e2 * box.nodes_m.T
    written(path, box, outer_faces(box), points=np.column_stack([z + 3.0, -x, -y]))
    return {"unit": "cm", "along": "-y", "up": "x", "line_height": "30 mm"}


def first_order(path: Path, box: ModuleMesh) -> dict[str, Any]:
    written(path, box, outer_faces(box), order=1)
    return {}


def write_linear_vtk(path: Path, box: ModuleMesh) -> dict[str, Any]:
    """Write VTK's old format, which SOFA uses for meshes: tetrahedra of four nodes, surfaces by node sets."""
    sets = {n: np.isin(np.arange(len(box.nodes_m)), f).astype(int) for n, f in outer_faces(box).items()}
    out = meshio.Mesh(1e3 * box.nodes_m, [("tetra", box.cells[:, :4])], point_data=sets)
    meshio.write(path.with_suffix(".vtk"), out, file_format="vtk42", binary=False)
    return {"file": path.with_suffix(".vtk")}


def write_hexahedra_vtu(path: Path, box: ModuleMesh) -> dict[str, Any]:
    """Write hexahedra of 27 nodes, surfaces by values of a cell array."""
    mesh, faces = box_mesh(), outer_faces(box_mesh())
    quads = [("quad", f[:, [0, 2, 8, 6]]) for f in faces.values()]
    tags = [np.full(len(c), k) for k, (_, c) in enumerate([("", mesh.cells), *quads])]
    blocks = [("hexahedron27", mesh.cells[:, VTK_ORDER]), *quads]
    meshio.write(path.with_suffix(".vtu"), meshio.Mesh(1e3 * mesh.nodes_m, blocks, cell_data={"face": tags}))
    names = {"base": "base", "tip": "tip", "symmetry": "mirror", "cavity": "cavity"}
    return {
        "file": path.with_suffix(".vtu"),
        **{key: f"face={list(faces).index(name) + 1}" for key, name in names.items()},
    }


def hexahedra_writer(nodes: int) -> Callable[[Path, ModuleMesh], dict[str, Any]]:
    def write(path: Path, box: ModuleMesh) -> dict[str, Any]:
        """Write surfaces by node sets, as point arrays in a .vtu."""
        mesh = box_mesh()
        sets = {n: np.isin(np.arange(len(mesh.nodes_m)), f).astype(int) for n, f in outer_faces(mesh).items()}
        kind = {8: "hexahedron", 20: "hexahedron20"}[nodes]
        blocks = [(kind, mesh.cells[:, VTK_ORDER[:nodes]])]
        meshio.write(path.with_suffix(".vtu"), meshio.Mesh(1e3 * mesh.nodes_m, blocks, point_data=sets))
        return {"file": path.with_suffix(".vtu")}

    return write


def abaqus(path: Path, box: ModuleMesh) -> dict[str, Any]:
    """Write a deck: solid cells, two element sets with sides as surfaces, the rest node sets."""
    deck = ["*NODE"] + [
        f"{i + 1}, {x:.9g}, {y:.9g}, {z:.9g}" for i, (x, y, z) in enumerate(1e3 * box.nodes_m)
    ]
    deck += ["*ELEMENT, TYPE=C3D10, ELSET=ALL"]
    deck += [", ".join(str(n) for n in [k + 1, *(cell + 1)]) for k, cell in enumerate(box.cells)]
    faces = outer_faces(box)
    for name in ("base", "tip", "mirror"):
        deck += [f"*NSET, NSET={name}"] + [f"{n + 1}," for n in np.unique(faces[name])]
    sides = [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)]
    deck += ["*SURFACE, NAME=chamber, TYPE=ELEMENT"]
    for face in box.cavity[:, :3]:
        for k, cell in enumerate(box.cells):
            for s, side in enumerate(sides):
                if set(face) == set(cell[list(side)]):
                    deck.append(f"{k + 1}, S{s + 1}")
    path.with_suffix(".inp").write_text("\n".join(deck) + "\n")
    return {"file": path.with_suffix(".inp"), "cavity": "chamber"}


WAYS = {
    "turned": turned,
    "first order": first_order,
    "27-node hexahedra": write_hexahedra_vtu,
    "SOFA's .vtk": write_linear_vtk,
    "20-node hexahedra": hexahedra_writer(20),
    "8-node hexahedra": hexahedra_writer(8),
    "Abaqus": abaqus,
}


@pytest.mark.parametrize(
    "way", slow_among(WAYS, *(set(WAYS) - {"20-node hexahedra", "Abaqus", "SOFA's .vtk"}))
)
def test_the_same_module_in_another_file(way: str, tmp_path: Path, box: ModuleMesh) -> None:
    """Cells, units, axes, formats and ways of naming change nothing."""
    path = tmp_path / "box.msh"
    own = WAYS[way](path, box)
    found = family(own.pop("file", path), **own)
    mesh = found.piece.mesh
    assert cell_volumes(mesh.nodes_m, mesh.cells).sum() == pytest.approx(
        cell_volumes(box.nodes_m, box.cells).sum(), rel=1e-7
    )
    tetrahedra = mesh.cells.shape[1] == 10
    wanted = (
        family(written(tmp_path / "plain.msh", box, outer_faces(box))).problem()
        if tetrahedra
        else box_problem()
    )
    assert states(found.problem()) == pytest.approx(states(wanted), rel=1e-6)
    assert any("first order" in remark for remark in found.remarks()) == (
        way in ("first order", "8-node hexahedra", "SOFA's .vtk")
    )


def test_a_whole_module_is_its_halves(tmp_path: Path, box: ModuleMesh) -> None:
    """The whole length and width, uncut, has the law and the masses of the quarter."""
    whole = tetrahedral(spatial_box_mesh())
    along = whole.nodes_m[whole.skin][..., 0]
    ends = {"base": 0.0, "tip": 2 * HALF_LENGTH_M}
    faces = {name: whole.skin[np.all(np.abs(along - place) < 1e-9, axis=1)] for name, place in ends.items()}
    faces["cavity"] = whole.cavity
    uncut = family(written(tmp_path / "whole.msh", whole, faces), part="whole", symmetry=None)
    quarter = family(written(tmp_path / "box.msh", box, outer_faces(box)))
    assert uncut.module_length_m == pytest.approx(quarter.module_length_m, rel=1e-9)
    # the whole body and the quarter have different, coarse meshes
    assert states(uncut.problem())[1] == pytest.approx(states(quarter.problem())[1], rel=2e-2)
    for mine, own in (
        (uncut.mass(1e3).end, quarter.mass(1e3).end),
        (uncut.mass(1e3).start, quarter.mass(1e3).start),
    ):
        assert mine.mass_kg == pytest.approx(own.mass_kg, rel=1e-9)
        assert mine.com_m == pytest.approx(own.com_m, abs=1e-9)
        assert mine.inertia_kg_m2 == pytest.approx(own.inertia_kg_m2, rel=1e-6, abs=1e-15)
    low, high = uncut.surface().end.vertices_m.min(axis=0), uncut.surface().end.vertices_m.max(axis=0)
    assert low[0] == pytest.approx(0.0, abs=1e-12)
    assert high == pytest.approx(quarter.surface().end.vertices_m.max(axis=0), abs=1e-9)


def test_the_other_half_width_is_the_same(tmp_path: Path, box: ModuleMesh) -> None:
    """A mesh of y ≤ 0 is mirrored: right-handed cells, the same law."""
    x, y, z = 1e3 * box.nodes_m.T
    cells = box.cells[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    other = ModuleMesh(np.column_stack([x, -y, z]) / 1e3, cells, box.cavity, boundary_faces(cells)[0], {})
    found = family(written(tmp_path / "other.msh", other, outer_faces(other)))
    assert found.piece.mesh.nodes_m[:, 1].min() == 0.0
    own = family(written(tmp_path / "box.msh", box, outer_faces(box)))
    assert states(found.problem()) == pytest.approx(states(own.problem()), rel=1e-9)


def test_volumes_in_the_file_are_regions(tmp_path: Path, box: ModuleMesh) -> None:
    floor = box.nodes_m[box.cells[:, :4], 2].max(axis=1) < Z[1] + 1e-9
    blocks = [("tetra10", box.cells[floor]), ("tetra10", box.cells[~floor])]
    blocks += [("triangle6", f) for f in outer_faces(box).values()]
    names = {"floor": 3, "body": 3, **dict.fromkeys(outer_faces(box), 2)}
    tags = [np.full(len(cells), k + 1) for k, (_, cells) in enumerate(blocks)]
    mesh = meshio.Mesh(
        1e3 * box.nodes_m,
        blocks,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array([k + 1, d]) for k, (name, d) in enumerate(names.items())},
    )
    meshio.write(tmp_path / "two.msh", mesh, file_format="gmsh22", binary=False)
    plain, two = family(tmp_path / "two.msh"), family(tmp_path / "two.msh", regions=["floor"])
    assert any("body, floor" in remark for remark in plain.remarks())
    assert two.regions == ("floor",)
    assert len(two.piece.mesh.regions["floor"]) == floor.sum()
    light = two.mass(1e3, {"floor": 1e3})
    heavy = two.mass(1e3, {"floor": 3e3})
    share = cell_volumes(box.nodes_m, box.cells)[floor].sum() / cell_volumes(box.nodes_m, box.cells).sum()
    assert heavy.end.mass_kg == pytest.approx((1 + 2 * share) * light.end.mass_kg, rel=1e-9)
    with pytest.raises(InvalidDesignError, match="no volume 'flor'.*did you mean 'floor'"):
        _ = family(tmp_path / "two.msh", regions=["flor"]).piece


def test_two_chambers_are_driven_by_two_pressures(tmp_path: Path) -> None:
    """Two opposed chambers in tetrahedra, with a name and a pressure each."""
    sizes = {"width_m": 20e-3, "height_m": 20e-3, "wall_m": 2e-3, "web_m": 2e-3, "module_length_m": 10e-3}
    whole = build_mesh(TwoChamberConfig.model_validate(sizes))
    mesh = tetrahedral(whole)
    names = {"high": whole.cavities["pressure_1_pa"], "low": whole.cavities["pressure_2_pa"]}
    faces = {name: mesh.skin[np.isin(mesh.skin, wall).all(axis=1)] for name, wall in names.items()}
    for name, (axis, place) in {"base": (0, 0.0), "tip": (0, 5e-3), "mirror": (1, 0.0)}.items():
        faces[name] = mesh.skin[np.all(np.abs(mesh.nodes_m[mesh.skin][..., axis] - place) < 1e-9, axis=1)]
    found = family(written(tmp_path / "two.msh", mesh, faces), cavity=["high", "low"])
    assert found.actuation == "pressure_1_pa, pressure_2_pa"
    assert found.design.parameters["cavity"] == "high,low"
    material = NeoHookean(NeoHookeanConfig(shear_modulus_pa=1e5))
    slopes = Skfem(SkfemConfig(pressure_max_pa=2e3)).solver(found.problem(), material).rest().dtau_dp
    assert slopes.shape == (1, 2)
    assert slopes[0, 0] > 0
    # the body is symmetric about its web, its mesh of tetrahedra is not quite
    assert slopes[0, 1] == pytest.approx(-slopes[0, 0], rel=0.05)


def test_the_key_holds_the_file_s_content_not_its_place(tmp_path: Path, box: ModuleMesh) -> None:
    first = written(tmp_path / "a.msh", box, outer_faces(box))
    second = tmp_path / "b.msh"
    second.write_bytes(first.read_bytes())
    keys = [content(family(path).config) for path in (first, second)]
    assert keys[0] == keys[1]
    assert family(first).design.parameters["file_sha256"] == family(second).design.parameters["file_sha256"]
    finer = written(
        second, tetrahedral(box_mesh(refinement=2)), outer_faces(tetrahedral(box_mesh(refinement=2)))
    )
    assert content(family(finer).config) != keys[0]
    assert len(family(finer).piece.mesh.cells) == 8 * len(box.cells)  # the former content is not read again


def without(faces: dict[str, np.ndarray], name: str) -> dict[str, np.ndarray]:
    return {key: value for key, value in faces.items() if key != name}


def nose(points: np.ndarray, share: float) -> np.ndarray:
    """Return the points with the tip scaled to this share of its width and height."""
    drawn, end = points.copy(), points[:, 0] > points[:, 0].max() - 1e-6
    middle = points[end].mean(axis=0)
    drawn[end, 1] *= share  # the mirror plane is y = 0
    drawn[end, 2] = middle[2] + share * (points[end, 2] - middle[2])
    return drawn


def wrong(case: str, path: Path, box: ModuleMesh) -> dict[str, Any]:
    """Write a file that is wrong in one way; return the config's keys for it."""
    faces, points = outer_faces(box), 1e3 * box.nodes_m
    if case == "missing":
        written(path, box, without(faces, "tip"))
    elif case == "leaks":
        written(path, box, {**faces, "cavity": faces["cavity"][1:]})
    elif case == "unit":
        written(path, box, faces)
        return {"unit": "m"}
    elif case == "tiny":
        written(path, box, faces, points=box.nodes_m)
    elif case == "inverted":
        middle = points.copy()
        inner = np.setdiff1d(box.cells[:, :4], box.skin)
        corner = box.cells[0, 0] if not len(inner) else inner[0]
        middle[corner] += np.array([50.0, 0, 0]) if len(inner) else np.array([0, 0, 12.0])
        written(path, box, faces, points=middle)
    elif case == "mixed":
        written(path, box, faces, extra=[("wedge", np.arange(6)[None])])
    elif case == "left-handed":
        flipped = ModuleMesh(
            box.nodes_m, box.cells[:, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]], box.cavity, box.skin, {}
        )
        written(path, flipped, faces)
    elif case == "along":
        written(path, box, faces)
        return {"along": "y", "up": "z"}
    elif case == "backwards":
        written(path, box, faces)
        return {"along": "-x"}
    elif case == "one line":
        written(path, box, faces)
        return {"along": "z"}
    elif case == "half a section":
        written(path, box, {**faces, "base": faces["base"][1:]})
    elif case == "skin":
        cavity = {tuple(face) for face in box.cavity.tolist()}
        outer = [f for f in box.skin.tolist() if tuple(f) not in cavity]
        planes = {tuple(f) for name in ("base", "tip", "mirror") for f in faces[name].tolist()}
        written(path, box, {**faces, "cavity": np.array([f for f in outer if tuple(f) not in planes])})
    elif case == "shared":
        written(path, box, {**faces, "cavity": np.concatenate([faces["cavity"], faces["tip"][:1]])})
    elif case == "inside":
        cell = box.cells[:, [0, 1, 2, 4, 5, 6]]
        written(path, box, {**faces, "cavity": np.concatenate([faces["cavity"], cell])})
    elif case == "crack":
        twice = np.concatenate([points, points[box.cells[0]]])
        cells = box.cells.copy()
        cells[0] = len(points) + np.arange(10)
        written(path, ModuleMesh(twice / 1e3, cells, box.cavity, box.skin, {}), {})
    elif case == "touching":  # two solids that were not fused before they were meshed: gmsafir/gmsafir#14
        drawn, count = box.nodes_m.copy(), len(box.nodes_m)
        drawn[:, 0] += np.ptp(drawn[:, 0]) + 1e-7  # on the plane of the tip, within what a mesher rounds
        cells = np.concatenate([box.cells, box.cells + count])
        ends = {"base": faces["base"], "tip": faces["tip"] + count}
        sides = {name: np.concatenate([faces[name], faces[name] + count]) for name in ("mirror", "cavity")}
        both = ModuleMesh(np.concatenate([box.nodes_m, drawn]), cells, box.cavity, box.skin, {})
        written(path, both, {**ends, **sides})
    elif case == "surface only":
        meshio.write(path, meshio.Mesh(points, [("triangle6", box.skin)]), file_format="gmsh22", binary=False)
    elif case == "no mesh":
        path.write_text("$MeshFormat\n4.1 0 8\n$EndMesh")
    return {}


SENTENCES = {
    "missing": "has no surface 'tip', which family.tip names.* Its surfaces: base, cavity, mirror",
    "leaks": r"cavity 'cavity' leaks: \d edges",
    "unit": "8.5 m long with 'unit: m'.*were mm meant. Write 'unit: mm'",
    "tiny": "with 'unit: mm'.*were m meant|with 'unit: mm'.*Write 'unit",
    "inverted": r"cells of 'box.msh' are inverted, the first at",
    "mixed": "holds tetra10 and wedge; a module is meshed with cells of one kind",
    "left-handed": "all .* cells of 'box.msh' are inverted: their nodes run the other way round",
    "along": "surface 'base' is no plane across the chain.*it looks along module",
    "backwards": "the tip 'tip' lies before the base 'base'",
    "one line": "'along: z' and 'up: z' lie on one line",
    "half a section": "surface 'base' misses 1 of the",
    "skin": "surface 'cavity' encloses no hollow",
    "shared": "surfaces 'tip' and 'cavity' of 'box.msh' share 1 faces",
    "inside": "of its .* faces are no outer faces of the solid",
    "crack": "nodes of 'box.msh' coincide with others",
    "touching": "holds 2 bodies that share no nodes; a module is one body",
    "surface only": "holds no solid cells, only triangle6",
    "no mesh": "mesh file 'box.msh' could not be read as gmsh",
}


@pytest.mark.parametrize("case", SENTENCES)
def test_wrong_files_get_one_sentence(case: str, tmp_path: Path, box: ModuleMesh) -> None:
    path = tmp_path / "box.msh"
    own = wrong(case, path, box)
    with pytest.raises(UserError, match=SENTENCES[case]) as caught:
        _ = family(path, **own).piece
    assert "\n" not in str(caught.value)


def test_a_neck_at_the_end_is_remarked_upon(tmp_path: Path, box: ModuleMesh) -> None:
    path = tmp_path / "box.msh"
    written(path, box, outer_faces(box), points=nose(1e3 * box.nodes_m, 0.4))
    assert any("'tip' is" in remark and "this neck" in remark for remark in family(path).piece.remarks)


def test_an_end_with_one_percent_area_is_refused() -> None:
    """A frustum from 10 × 10 to 1 × 1 mm: V / L = (100 + 10 + 1) / 3 mm², of which 1 mm² is 2.7 %."""
    square = np.array([[-5, -5], [5, -5], [5, 5], [-5, 5]])
    nodes = np.array([[x, *(s * yz)] for x, s in ((0.0, 1.0), (20.0, 0.1)) for yz in square])
    nodes, cells = as_quadratic(1e-3 * nodes, "hexahedron", np.arange(8)[None])
    skin = Skin.from_cells(nodes, cells)
    tip = skin.faces[np.all(np.isclose(nodes[skin.faces, 0], 20e-3), axis=1)]
    with pytest.raises(
        InvalidDesignError, match=r"'tip' is 1 mm² large, 2\.7\s?% of the solid's mean section"
    ):
        require_sections(nodes, cells, [("tip", tip)])


def test_wrong_studies_get_one_sentence(tmp_path: Path, box: ModuleMesh) -> None:
    path = written(tmp_path / "box.msh", box, outer_faces(box))
    with pytest.raises(UserError, match="is no file; did you mean 'box.msh'"):
        family(tmp_path / "bx.msh")
    with pytest.raises(UserError, match="none of .msh, .vtu, .vtk, .inp"):
        family(tmp_path / "box.step")
    with pytest.raises(UserError, match="each chamber's wall has its own name"):
        family(path, cavity=["cavity", "cavity"])
    with pytest.raises(InvalidDesignError, match="leave line_across out"):
        family(path, line_across="1 mm")
    with pytest.raises(UserError, match="cannot refine"):
        family(path).problem(refinement=2)


def test_a_code_without_tetrahedra_refuses_them(tmp_path: Path, box: ModuleMesh) -> None:
    ngsolve = pytest.importorskip("pliant_plugins.fem.ngsolve.backend")
    problem = family(written(tmp_path / "box.msh", box, outer_faces(box))).problem()
    with pytest.raises(UserError, match="does not know tetrahedra|does not know 'tetrahedra'"):
        ngsolve.Ngsolve(NgsolveConfig(pressure_max_pa=1e3)).solver(
            problem, NeoHookean(NeoHookeanConfig(shear_modulus_pa=1e5))
        )


def test_mirrored_skin_is_the_other_side(tmp_path: Path, box: ModuleMesh) -> None:
    """The halves' surfaces are mirror images in x = 0."""
    surfaces = family(written(tmp_path / "box.msh", box, outer_faces(box))).surface()
    assert mirrored(surfaces.end, 0).vertices_m == pytest.approx(surfaces.start.vertices_m)


@pytest.mark.parametrize(
    ("up", "sign", "said"), [("z", 1.0, ""), ("-z", -1.0, "write 'up: z'"), ("y", -1.0, "'up: -y'")]
)
def test_a_module_that_bends_the_other_way_is_told_to_be_turned(up: str, sign: float, said: str) -> None:
    domain = Domain(np.array([0.0, 1e4]), np.array([[-0.5, 0.5]]))
    chain = sample_chain(linear_law(sign * 8e-7, domain=domain))
    study: Any = SimpleNamespace(family=SimpleNamespace(up=up))
    remarks = turned_remarks(study, chain)
    assert (said in " ".join(remarks)) and bool(remarks) == bool(said)
