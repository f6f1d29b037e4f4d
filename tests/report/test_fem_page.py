"""The page of FEM data, from small invented data of each kind of joint: its text and its completeness."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.report.pages import check_sound
from tests.slow import slow_among

from pliant.records.design import Design
from pliant.records.fem import ModuleData, ModuleShape
from pliant.records.law import Domain
from pliant.report.fem import fem_document, fem_json, fem_lines, free_reach, stated_error
from pliant.report.fem_page import (
    DesignStates,
    cost_table,
    coupling_table,
    data_sections,
    failed_place,
    failed_table,
    foretold_axes,
    sampling_table,
    shape_section,
    solved_rows,
    states_chart,
    states_table,
)
from pliant.report.figures import body
from pliant.report.figures.module import can_show, free_title, has_stress, stress_caption, stretch_limits
from pliant.report.fit_page import axes_table
from pliant.report.render import page
from pliant.report.still import still
from pliant_plugins.materials.neo_hookean import NeoHookeanConfig

LEVELS, ANGLES = (0.0, 4e3, 8e3), (-0.1, 0.0, 0.1, 0.2)
TOLD = ("actuation", "deformation", "foretold", "found", "deviation", "miss")
TESTS = [
    dict(zip(TOLD, values, strict=True))
    for values in ((2e3, 0.05, 0.01, 0.0101, 1e-3, 8e-4), (6e3, 0.15, 0.02, 0.02, 4e-4, 1e-4))
]
ADAPTIVE = {
    "n_states": 14, "error": 2e-4, "stated_error": 1.5e-4, "reached": True, "tests": TESTS, "check_error": 9e-5,
}  # fmt: skip


def module(axes: tuple[str, ...] = ("y",), joint: Any = "revolute", **changes: Any) -> ModuleData:
    """Return a linear module τ = p/40 − K u: free and grid states, a check state, one in contact, one failed."""
    main = "x" if joint == "prismatic" else "y"
    k, m = len(axes), axes.index(main)
    stiffness = np.diag(0.5 + np.arange(k))
    rows: list[tuple[float, np.ndarray, str, str, str, str]] = []
    for p in LEVELS:
        u = np.zeros(k)
        u[m] = 2.5e-5 * p / stiffness[m, m]
        rows.append((p, u, "free", "ok", "fit", main))
    for axis in (main, *(a for a in axes if a != main)):
        for p in LEVELS:
            for value in ANGLES:
                u = np.zeros(k)
                u[axes.index(axis)] = value
                role = "check" if (p, value) == (4e3, 0.1) else "fit"
                status = "self_contact" if (p, value) == (8e3, -0.1) else "ok"
                rows.append((p, u, "constrained", status, role, axis))
    if k > 1:
        rows.append((5e3, np.full(k, 0.1), "constrained", "ok", "fit", "coupling"))
    actuation, u = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    tau = -u @ stiffness
    tau[:, m] += 2.5e-5 * actuation
    n = len(rows)
    coupling = {
        "n_states": 7, "largest": 0.071, "between": ["y", "z"], "actuation": 8e3, "deformation": [0.0, 0.2, -0.3],
        "largest_asymmetry": 1e-14, "pieces_differ": 2e-15,
    }  # fmt: skip
    sampling: dict[str, object] = {
        "kind": "adaptive",
        "axes": dict.fromkeys(axes, ADAPTIVE),
        "pieces": {"main": {"n_cells": 24, "n_nodes": 315}},
        **({"coupling": coupling} if k > 1 else {}),
    }
    branch, status, role, explored = (np.array([r[j] for r in rows]) for j in range(2, 6))
    slopes = np.tile(2.5e-5 * np.eye(k)[m], (n, 1)), np.tile(-stiffness, (n, 1, 1))
    effort = (np.arange(n) % 5 + 1).astype(np.float64), np.full(n, 0.25)
    failed = ({"branch": "constrained", "actuation": 8e3, "angle_rad": -0.2, "cause": "diverged <here>"},)
    data = ModuleData(
        Design("made_up", {}), joint, axes, main, "pressure_pa", actuation, u, tau, *slopes, np.zeros(n), np.zeros(n),
        *effort, explored=explored, branch=branch, status=status, role=role, failed=failed, sampling=sampling,
    )  # fmt: skip
    return replace(data, **changes)


KINDS = {
    "revolute": module(),
    "spherical": module(("x", "y", "z"), "spherical"),
    "prismatic": module(("x",), "prismatic"),
    "tendon": replace(module(), actuation_name="tendon_force_n"),
}


def artifact(data: ModuleData) -> Any:
    manifest = {"wall_s": 2.0, "stage": "fem", "digest": "d"}
    return SimpleNamespace(value=data, cached=False, manifest=manifest, key="k")


def document(*data: ModuleData, material: Any = None) -> Any:
    study = SimpleNamespace(
        name="a", material=material, canonical=lambda: {"name": "a", "fem": {"kind": "skfem"}}
    )
    return fem_document(study, [artifact(one) for one in data], ["fem.csv"] * len(data))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", slow_among(["spherical", "prismatic", "tendon"], "spherical", "prismatic"))
def test_the_page_holds_everything_and_nothing_from_outside(kind: str) -> None:
    made = page(document(KINDS[kind]))
    text = check_sound(made)
    assert set(made.pictures) == {"fem_states", "fem_sampling", "fem_cost"}
    assert "diverged &lt;here&gt;" in made.html
    assert "stated error 0.015 % of the effort's range" in text
    first, second = (still(states_chart(KINDS[kind])).tobytes() for _ in range(2))
    assert first == second


def test_units_match_the_joint() -> None:
    assert free_reach(KINDS["revolute"]) == "bends 22.92° at 8 kPa"
    assert free_reach(KINDS["prismatic"]) == "extends by 400.00 mm at 8 kPa"
    assert free_reach(KINDS["tendon"]) == "bends 22.92° at 8000 N"
    row = states_table(KINDS["prismatic"]).rows[0]
    assert row[4:] == ["0 to 8 kPa", "−100 to 400 mm", "−0.1 to 0.25 N"]
    row = states_table(KINDS["revolute"]).rows[0]
    assert row[4:] == ["0 to 8 kPa", "−5.73 to 22.92°", "−100 to 250 mN·m"]


def test_states_are_counted_by_axis() -> None:
    rows = states_table(KINDS["spherical"]).rows
    assert [row[0] for row in rows] == ["y", "x", "z", "all axes held"]
    counts = [["13", "1", "1"], ["10", "1", "1"], ["10", "1", "1"], ["1", "0", "0"]]
    assert [row[1:4] for row in rows] == counts
    total = sum(int(cell) for row in rows for cell in row[1:4])
    assert total == len(KINDS["spherical"])


def test_coupling_stands_beside_three_axes_only() -> None:
    table = coupling_table(KINDS["spherical"])
    assert table is not None
    assert table.rows[0][1] == "0.071 between y and z"
    assert "z −17.2°" in table.rows[1][1]
    assert coupling_table(KINDS["revolute"]) is None


@pytest.mark.parametrize(
    ("record", "says"),
    [
        ({}, "stated error 0.015 % of the effort's range (wanted 0.02 %)"),
        ({"reached": False}, "NOT TESTED"),
        ({"stated_error": 6e-4, "reached": False}, "NOT REACHED (wanted 0.02 %)"),
        ({"stated_error": None, "reached": False}, "error not stated"),
    ],
)
def test_the_same_words_on_the_stated_error_everywhere(record: dict[str, Any], says: str) -> None:
    data = replace(module(), sampling={"kind": "adaptive", "axes": {"y": {**ADAPTIVE, **record}}})
    assert says in stated_error(ADAPTIVE | record) and says in fem_lines([artifact(data)])[1]
    assert (sampling_table(data).rows[0][5] == "yes") == (not record)
    assert (says in document(data).sentence) == (record.get("stated_error", 1) is not None)


@pytest.mark.parametrize("kind", ["grid", "study"])
def test_other_strategies_state_no_error(kind: str) -> None:
    data = replace(module(), sampling={"kind": kind, "axes": {"y": {}}})
    row = sampling_table(data).rows[0]
    assert row[2:6] == ["–"] * 4
    assert foretold_axes(data) == []
    sections = data_sections([DesignStates("a", data)])
    assert [len(s.pictures) for s in sections] == [1, 0, 1]


def test_copies_cost_nothing() -> None:
    data = module()
    wall, steps = data.wall_s.copy(), data.iterations.copy()
    wall[5:9], steps[5:9] = 0.0, 0
    copied = replace(data, wall_s=wall, iterations=steps)
    assert solved_rows(copied).sum() == len(data) - 4
    cost = {row[0]: row[1] for row in cost_table(copied, "skfem").rows}
    assert cost["states solved"] == str(len(data) - 4)
    assert cost["time of all states"] == "2.8 s"
    assert "24 elements" in cost["mesh"]
    assert "4 states are copies" in states_table(copied).note


def test_failures_say_what_was_held() -> None:
    table = failed_table(KINDS["revolute"])
    assert table is not None
    assert list(table.rows[0]) == ["8 kPa", "−11.5°", "diverged <here>"]
    assert failed_place({"actuation": 1e3, "angle_rad": 0.002}, KINDS["prismatic"]) == ("1 kPa", "2 mm")
    assert failed_place({"actuation": 1e3, "angle_rad": None}, KINDS["revolute"]) == ("1 kPa", "free")
    of_several = {"actuation": 1e3, "angle_rad": None, "held": {"z": 0.1}}
    assert failed_place(of_several, KINDS["spherical"]) == ("1 kPa", "z 5.73°")
    assert failed_place({"actuation": 1e3, "effort": {"y": 0.01}}, KINDS["spherical"])[1] == "τ y 10 mN·m"
    assert failed_table(replace(module(), failed=())) is None


class Linear:
    """The law of the invented states, its axes in another order, one slope off by a tenth."""

    axes, joint = ("z", "y", "x"), "spherical"
    domain = Domain(np.array([0.0, 8e3]), np.array([[-0.5, 0.5]] * 3))

    def evaluate(self, actuation: np.ndarray, deformation: np.ndarray) -> Any:
        tau = -deformation * [1.1 * 2.5, 1.5, 0.5]
        tau[:, 1] += 2.5e-5 * actuation
        return SimpleNamespace(tau=tau)


def test_what_the_law_misses_is_told_by_axis() -> None:
    table = axes_table(KINDS["spherical"], Linear())  # type: ignore[arg-type]
    assert table is not None
    rows = {row[0]: row[1:] for row in table.rows}
    assert [*rows] == ["z", "y", "x", *(f"all held: {a}" for a in "zyx"), "every axis in every state"]
    # z from −0.1 to 0.2: a tenth of the slope misses 2/30 of the range at its end, 1/30 at the check state
    assert rows["z"] == ["6.7 % (10)", "3.3 % (1)", "3.3 % (1)", "50"]
    assert rows["all held: z"] == ["3.3 % (1)", "–", "–", "25"]
    assert all(float(rows[axis][3]) < 1e-9 for axis in ("x", "y"))


def test_the_command_says_the_same() -> None:
    lines = fem_lines([artifact(KINDS["spherical"])])
    assert lines[0].startswith(
        "FEM      40 states (3 never fitted, 3 with self-contact, 1 failed), bends 7.64° at 8 kPa"
    )
    heads = [line.split(":")[0].strip() for line in lines[1:5]]
    assert heads == ["axis y", "axis x", "axis z", "all axes held"]
    assert lines[5].split()[:1] + lines[5].split()[2:5] == ["0.25", "and", "3", "Newton"]
    result = fem_json([artifact(KINDS["spherical"])], ["fem.csv"])
    assert list(result["axes"]) == ["y", "x", "z"]
    assert result["axes"]["y"]["stated_error"] == 1.5e-4
    assert result["newton_steps"] == int(KINDS["spherical"].iterations.sum())


@pytest.mark.slow
def test_each_design_in_a_study_has_a_picture() -> None:
    sections = data_sections([DesignStates("one", module()), DesignStates("two", module())])
    assert [p.name for p in sections[0].pictures] == ["fem_states", "fem_states_2"]
    assert [t.title for t in sections[2].tables] == ["one: Cost", "two: Cost"]
    assert data_sections([]) == []


def block(stretch: float, mirrors: tuple[str, ...], stress: bool = False) -> ModuleShape:
    """Return an eighth of a solid block 4 × 4 × 4 mm whose x is stretched; six faces of 9 nodes."""
    s = np.array([0.0, 0.5, 1.0])
    grid = np.stack(np.meshgrid(s, s, s, indexing="ij"), axis=-1)  # (x, y, z)
    ids = np.arange(27).reshape(3, 3, 3)
    faces = []
    for axis in range(3):
        for end in (0, 2):
            face = np.take(ids, end, axis=axis)  # over the other two axes, in order
            outward = (end == 2) == (axis != 1)
            faces.append((face.T if outward else face).ravel())
    points = 0.002 * grid.reshape(-1, 3) * [stretch, 1.0, 1.0]
    values = np.linspace(0, 1e5, 27) if stress else None
    return ModuleShape(1e3 * (stretch - 1), 0.004 * (stretch - 1), points, np.array(faces), values, mirrors)


@pytest.mark.slow
def test_mirror_images_from_a_sliding_piece_make_the_block() -> None:
    shapes = (block(1.0, ("x", "y", "z")), block(1.5, ("x", "y", "z"), stress=True))
    data = replace(KINDS["prismatic"], shapes=shapes).axis("x")
    assert can_show(data)
    assert has_stress(data)
    free = body.unrolled(shapes, slides=True)[1]
    assert body.piece_angle(shapes[1], slides=True) == 0.0
    whole = body.module(free, 0.0)
    assert np.ptp(whole.points, axis=0) == pytest.approx([0.006, 0.004, 0.004])
    cut = body.cut_module(free, 0.0)
    assert np.ptp(cut.points, axis=0) == pytest.approx([0.006, 0.002, 0.004])
    assert stretch_limits([free])[1] == 1.5
    # 6 sides of 4 images each are outside, each of one face; those in mirror planes are left out
    assert len(whole.faces) == 24
    assert len(cut.faces) == 2 * (4 + 4)  # + the section
    assert _volume(whole) == pytest.approx(96e-9)
    assert free_title(data, shapes[1]) == "Free at 0.5 kPa: u = 2.00 mm"
    assert "100 kPa" in stress_caption(data)
    section = shape_section([("a", data, None)])
    assert section is not None
    assert [p.name for p in section.pictures] == ["module_shape", "module_stress"]
    assert "an eighth is solved" in section.pictures[0].caption


def test_a_piece_without_mirror_planes_is_the_module() -> None:
    shapes = (block(1.0, ()), block(1.5, ()))
    free = body.unrolled(shapes, slides=True)[1]
    assert np.ptp(body.module(free, 0.0).points, axis=0) == pytest.approx([0.003, 0.002, 0.002])
    assert body.piece_angle(replace(shapes[1], angle_rad=0.3)) == 0.3
    assert body.piece_angle(replace(shapes[1], angle_rad=0.3, mirrors=("x",))) == 0.15
    assert not has_stress(replace(KINDS["prismatic"], shapes=shapes).axis("x"))


def _volume(surface: Any) -> float:
    """Return the volume by the divergence theorem over the faces' corners, which are flat here."""
    corners = surface.points[surface.faces[:, [0, 2, 8, 6]]]
    a, b, c, d = (corners[:, k] for k in range(4))
    normal = np.cross(c - a, d - b) / 2
    return float(np.sum(np.einsum("fc,fc->f", corners.mean(axis=1), normal)) / 3)


def test_the_result_says_whether_poissons_ratio_was_stated() -> None:
    """The ratio 0.49 is a default, not a measurement."""
    for keys, ratio, stated in (({}, 0.49, False), ({"poisson_ratio": 0.49}, 0.49, True)):
        material = NeoHookeanConfig(shear_modulus_pa=2e5, **keys)
        result = document(module(), material=material).data["material"]
        assert result == {"kind": "neo_hookean", "poisson_ratio": ratio, "poisson_ratio_stated": stated}
