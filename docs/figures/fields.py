"""Draw docs/pictures/fields.png from VTU files: the section y = 0 of a bellow along its free branch.

Run: pliant fem examples/first_finger/finger.yaml fem.sampling=grid fem.pressures=4 --fields runs/fields
     python docs/figures/fields.py runs/fields
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from pliant.formatting import named_unit, output_unit

OUT = Path(__file__).parents[2] / "docs" / "pictures" / "fields.png"
NEAR = 1e-9
SHOWN_SHARE = 0.995
STRESS = named_unit("von Mises stress", "Pa")


def main(folder: Path) -> None:
    """Draw the free states above zero, side by side at one scale."""
    with (folder / "states.csv").open(newline="") as file:
        rows = [r for r in csv.DictReader(file) if r["branch"] == "free"]
    states = [(row, _section(folder / row["file"])) for row in rows]
    stress = states[-1][1][2]
    norm = Normalize(0, STRESS.factor * float(np.quantile(stress, SHOWN_SHARE)))
    figure = Figure(figsize=(9.6, 3.7), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(states), sharex=True, sharey=True)
    for axes, (row, section) in zip(panels, states, strict=True):
        _draw(axes, section, norm)
        values = ", ".join(
            output_unit(name).text(float(row[name]), 3) for name in ("pressure_pa", "angle_rad")
        )
        axes.set_title(values, fontsize=10)
    bar = figure.colorbar(ScalarMappable(norm, "viridis"), ax=list(panels), extend="max", fraction=0.025)
    bar.set_label(STRESS.axis)
    figure.savefig(OUT, dpi=150, metadata={"Software": None})


def _section(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return deformed points (n, 2), in mm, triangles and stress of the cells' faces in the plane y = 0."""
    mesh = meshio.read(path)
    inside = np.abs(mesh.points[:, 1]) < NEAR
    points = 1e3 * (mesh.points + mesh.point_data["displacement_m"])[:, [0, 2]]
    triangles = []
    for cell in mesh.cells[0].data:
        flat = cell[inside[cell]]
        if len(flat) == 9:  # one face, as a 3 × 3 lattice around its middle
            middle = flat[
                np.argmin(np.linalg.norm(mesh.points[flat] - mesh.points[flat].mean(axis=0), axis=1))
            ]
            around = flat[flat != middle]
            arms = (mesh.points[around] - mesh.points[middle])[:, [0, 2]]
            ring = around[np.argsort(np.arctan2(arms[:, 1], arms[:, 0]))]
            triangles += [(middle, a, b) for a, b in zip(ring, np.roll(ring, -1), strict=True)]
    return points, np.array(triangles), mesh.point_data["von_mises_pa"]


def _draw(axes: Any, section: tuple[np.ndarray, np.ndarray, np.ndarray], norm: Normalize) -> None:
    """Draw the section and its mirror image in x = 0."""
    points, triangles, stress = section
    for side in (1, -1):
        shape = Triangulation(side * points[:, 0], points[:, 1], triangles)
        axes.tripcolor(shape, STRESS.factor * stress, norm=norm, cmap="viridis", shading="gouraud")
    axes.set_aspect("equal")
    axes.set_axis_off()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
