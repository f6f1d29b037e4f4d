"""Draw docs/pictures/touching.png: a bellow bent back, with and without contact of its folds.

Run: python docs/figures/touching.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from pliant.records.fem import FemState
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

OUT = Path(__file__).parent.parent / "pictures" / "touching.png"
LENGTHS = {"inner_radius": "2 mm", "average_radius": "6 mm", "wall": "0.8 mm", "module_length": "6 mm"}
ANGLES = np.linspace(0, -0.147, 15)
AROUND = [0, 1, 2, 5, 8, 7, 6, 3]  # a face's nodes along its edge
HOW = {"pass": ("self_contact: pass", "#D55E00"), "solve": ("self_contact: solve", "#0072B2")}


def solved(how: str) -> tuple[SkfemSolver, list[FemState]]:
    """Return the solver and the states of the module bent back step by step, without pressure."""
    problem = BellowBending(BellowBendingConfig.model_validate(LENGTHS)).problem()
    config = SkfemConfig.model_validate({"pressure_max_pa": 15e3, "self_contact": how})
    here = Skfem(config).solver(problem, NeoHookean(NeoHookeanConfig(shear_modulus_pa=240e3)))
    states = [here.rest()]
    for angle in ANGLES[1:]:
        states.append(here.constrained(0.0, float(angle), states[-1]))
    return here, states


def section(ax: Axes, here: SkfemSolver, state: FemState, title: str, color: str) -> None:
    """Draw the cut y = 0 of the piece and its images in both planes: a fold between two others."""
    mesh, half = here.problem.mesh, state.angle_rad / here.problem.deformation_scale
    faces = mesh.skin[np.isin(mesh.skin, mesh.node_sets["symmetry"]).all(axis=1)][:, AROUND]
    at = 1e3 * here.deformed_nodes(state)[:, [0, 2]]
    end = at[mesh.node_sets["end"]].mean(axis=0)
    normal = np.array([np.cos(half), -np.sin(half)])
    beyond = at - 2 * ((at - end) @ normal)[:, None] * normal
    for nodes, shade in ((at, 0.55), (beyond, 0.3), (at * [-1, 1], 0.3)):
        ax.add_collection(
            PolyCollection(nodes[faces], facecolor=color, alpha=shade, edgecolor="white", lw=0.3)
        )
    ax.set(title=title, xlabel="x / mm", aspect="equal")
    ax.autoscale_view()


def main() -> None:
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1, 1, 1.2))
    for ax, (how, (title, color)) in zip((left, middle), HOW.items(), strict=True):
        here, states = solved(how)
        section(ax, here, states[-1], title, color)
        torque = [1e3 * state.moment_n_m for state in states]
        right.plot(ANGLES, torque, ".-", color=color, label=title)
    left.set_ylabel("z / mm")
    right.set(xlabel="angle of the module / rad", ylabel="torque / mN m", title="bent back without pressure")
    right.legend(frameon=False)
    figure.savefig(OUT, dpi=110)


if __name__ == "__main__":
    main()
