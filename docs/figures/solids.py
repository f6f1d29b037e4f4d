"""Draw docs/pictures/print_solids.png, print_moulds.png and print_arm.png: python docs/figures/solids.py [--arm]

Solids cut open, moulds, and the arm of docs/studies/reach_around.md (`--arm`: it alone).

A depth buffer over triangles in parallel projection; each body has its own colour. Needs ngsolve for `mesh_file`.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numba
import numpy as np
from benchmarks.print.designs import DESIGNS
from benchmarks.print.solids import MESH_FILE, Case, case

from pliant.api import open_study
from pliant.records.design import Array
from pliant_print.boolean import solid, surface
from pliant_print.solids import PrintedSolid, printed_chain

PICTURES = Path(__file__).parents[1] / "pictures"
ARM = Path(__file__).parents[2] / "examples" / "three_chamber_arm" / "best.yaml"
SIZE = 420
LIGHT = np.array([0.35, -0.75, 0.55]) / np.linalg.norm([0.35, -0.75, 0.55])
COLOURS = {
    "body": (0.86, 0.66, 0.32), "layer": (0.25, 0.45, 0.68), "sheet": (0.25, 0.45, 0.68), "links": (0.55, 0.57, 0.6),
    "ribbon": (0.75, 0.25, 0.2), "half": (0.66, 0.74, 0.8), "core": (0.8, 0.45, 0.35), "flange": (0.55, 0.57, 0.6),
}  # fmt: skip
Drawn = Sequence[tuple[str, Any]]


@numba.njit
def _fill(corners: Array, shade: Array, depth: Array, image: Array) -> None:
    """Draw triangles (n, 3, 3) in pixels, depth last, nearer is larger."""
    size = depth.shape[0]
    for k in range(len(corners)):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[k]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0.0:
            continue
        for row in range(max(0, int(min(ay, by, cy))), min(size, int(max(ay, by, cy)) + 2)):
            for col in range(max(0, int(min(ax, bx, cx))), min(size, int(max(ax, bx, cx)) + 2)):
                u = ((bx - col) * (cy - row) - (cx - col) * (by - row)) / area
                v = ((cx - col) * (ay - row) - (ax - col) * (cy - row)) / area
                w = 1.0 - u - v
                if u < 0 or v < 0 or w < 0:
                    continue
                z = u * az + v * bz + w * cz
                if z > depth[row, col]:
                    depth[row, col] = z
                    for c in range(3):
                        image[row, col, c] = shade[k, c]


def drawn(bodies: Drawn, look: Array) -> Array:
    """Return a picture (SIZE, SIZE, 3) of manifolds seen along `look`, chain x upward."""
    view = look / np.linalg.norm(look)
    up = np.array([1.0, 0.0, 0.0]) - view[0] * view
    up /= np.linalg.norm(up)
    right = np.cross(view, up)
    skins = [(name, surface(body)) for name, body in bodies]
    every = np.concatenate([skin.vertices_m for _, skin in skins])
    flat = np.stack([every @ right, every @ up], axis=1)
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
    scale = 0.92 * SIZE / float(np.ptp(flat, axis=0).max())
    depth, image = np.full((SIZE, SIZE), -np.inf), np.ones((SIZE, SIZE, 3))
    for name, skin in skins:
        corners = skin.vertices_m[skin.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        light = 0.45 + 0.55 * np.clip(normal @ LIGHT, 0, 1) + 0.12 * np.clip(-(normal @ view), 0, 1)
        shade = np.clip(light[:, None] * np.array(COLOURS[name.split("_")[0]]), 0, 1)
        pixels = np.stack(
            [
                (corners @ right - middle[0]) * scale + SIZE / 2,
                SIZE / 2 - (corners @ up - middle[1]) * scale,
                -(corners @ view),
            ],
            axis=-1,
        )
        _fill(pixels, shade, depth, image)
    return image


def cut_open(printed: PrintedSolid) -> Drawn:
    """Return the robot's bodies, the half y ≥ 0."""
    return [(body.name, solid(body.surface).trim_by_plane((0.0, 1.0, 0.0), 0.0)) for body in printed.bodies]


def opened_mould(one: Case) -> Drawn:
    """Return one half with its cores and inserts in it, and the other half beside it, its inside visible."""
    made = one.mould
    first, second = made.halves
    depth = second.bounding_box()[5] - second.bounding_box()[2]
    over = second.rotate((180.0, 0.0, 0.0)).translate((0.0, 0.0, 1.15 * depth + first.bounding_box()[5]))
    inside = [*((name, body) for name, body in made.cores.items())]
    inserts = [*((name, body) for name, body in made.inserts.items())]
    return [("half_1", first), ("half_2", over), *inside, *inserts]


def draw_grid(pictures: Mapping[str, Array], path: Path) -> None:
    """Draw pictures with titles in rows of three."""
    columns = 3
    rows = -(-len(pictures) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(3.1 * columns, 3.3 * rows), squeeze=False)
    for axis in axes.ravel():
        axis.axis("off")
    for axis, (name, image) in zip(axes.ravel(), pictures.items(), strict=False):
        axis.imshow(image)
        axis.set_title(name, fontsize=10)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw(cases: Sequence[Case]) -> None:
    """Draw both pictures."""
    draw_grid(
        {one.name: drawn(cut_open(one.printed), np.array([0.25, 1.0, 0.3])) for one in cases},
        PICTURES / "print_solids.png",
    )
    draw_grid(
        {one.name: drawn(opened_mould(one), np.array([-0.15, 1.0, -0.25])) for one in cases},
        PICTURES / "print_moulds.png",
    )


def draw_arm() -> None:
    """Draw the arm whole, cut open, and its middle cut open: the piece between both segments."""
    opened = open_study(ARM)
    printed = printed_chain(opened.context, opened.study)
    half = cut_open(printed)
    segments = opened.study.need("chain", "a picture").as_segments()
    middle = 10.0 * (segments[0].modules or 0) + 3.0  # mm
    near = [
        (name, body.trim_by_plane((1.0, 0.0, 0.0), middle - 15).trim_by_plane((-1.0, 0.0, 0.0), -middle - 15))
        for name, body in half
    ]
    look = np.array([0.15, 1.0, 0.2])
    whole = [(body.name, solid(body.surface)) for body in printed.bodies]
    pictures = {"the arm": whole, "cut open": half, "between the segments": near}
    draw_grid({name: drawn(bodies, look) for name, bodies in pictures.items()}, PICTURES / "print_arm.png")


if __name__ == "__main__":
    draw_arm()
    if "--arm" in sys.argv:
        sys.exit()
    with tempfile.TemporaryDirectory() as place:
        draw([case(name, Path(place)) for name in (*DESIGNS, MESH_FILE)])
