"""Draw docs/pictures/frames.png: module frame, signs, world frame. Run: python docs/figures/frames.py"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

OUT = Path(__file__).parent.parent / "pictures" / "frames.png"
BLUE, ORANGE, GREY, DARK = "#0072B2", "#D55E00", "#9a9a9a", "#222222"


def arrow(
    ax: Axes, start: tuple[float, float], end: tuple[float, float], text: str, color: str = DARK
) -> None:
    """Draw an axis arrow with its name at the tip."""
    ax.add_patch(
        FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=16, lw=1.8, color=color, zorder=5)
    )
    d = np.subtract(end, start)
    ax.annotate(
        text,
        end,
        xytext=tuple(9 * d / np.linalg.norm(d)),
        textcoords="offset points",
        ha="center",
        va="center",
        color=color,
        fontsize=12,
    )


def perpendicular_axis(ax: Axes, at: tuple[float, float], text: str, into: bool, color: str = DARK) -> None:
    """Draw an axis perpendicular to the page."""
    ax.plot(*at, "o", ms=13, mfc="white", mec=color, mew=1.8, zorder=6)
    ax.plot(*at, "x" if into else ".", ms=7, color=color, mew=1.8, zorder=7)
    ax.annotate(
        text, at, xytext=(-16, -14), textcoords="offset points", ha="center", color=color, fontsize=12
    )


def module(ax: Axes) -> None:
    """Draw the side view of one module in its own frame."""
    s = np.linspace(-1, 1, 200)
    top = 1.55 + 0.55 * np.cos(np.pi * s)
    ax.fill_between(s, 0.15, top, color=BLUE, alpha=0.15, lw=0)
    ax.plot(s, top, color=BLUE, lw=2)
    ax.fill_between(s, -0.15, 0.15, color=BLUE, alpha=0.55, lw=0)
    ax.text(-0.95, -0.36, "strain-limiting plate", color=BLUE, fontsize=10, va="center")
    ax.text(0.46, 0.8, "cavity,\npressure p", ha="center", va="center", fontsize=10, color=BLUE)
    arrow(ax, (0, 0), (1.75, 0), "x")
    arrow(ax, (0, 0), (0, 2.6), "z")
    perpendicular_axis(ax, (0, 0), "y", into=True)
    ax.annotate("", (-1, -0.75), (1, -0.75), arrowprops={"arrowstyle": "<->", "color": GREY})
    ax.text(0, -0.9, "module length l, joint in the middle", ha="center", va="top", fontsize=10, color=DARK)
    ax.annotate("toward the tip", (1.75, 0), xytext=(1.72, 0.3), fontsize=10, ha="center", color=GREY)
    ax.set_title("Module frame", fontsize=13, pad=12)
    ax.set_xlim(-1.5, 2.3)
    ax.set_ylim(-1.4, 2.9)


def bending(ax: Axes) -> None:
    """Draw positive angle, effort and opposing moment at one joint."""
    u = 0.7
    half = np.array([[-1.4, 0], [0, 0]])
    child = np.array([[0, 0], [1.4 * np.cos(u), -1.4 * np.sin(u)]])
    ax.plot(*np.array([[0, 0], [1.5, 0]]).T, ls=":", color=GREY, lw=1.5)
    ax.plot(*half.T, color=DARK, lw=6, solid_capstyle="round")
    ax.plot(*child.T, color=BLUE, lw=6, solid_capstyle="round")
    ax.plot(0, 0, "o", ms=11, mfc="white", mec=DARK, mew=2)
    arc = np.linspace(0, -u, 40)
    ax.plot(1.15 * np.cos(arc), 1.15 * np.sin(arc), color=DARK, lw=1.2)
    ax.text(1.32, -0.42, "u > 0", fontsize=12)
    ax.add_patch(
        FancyArrowPatch(
            (0.45, 0.65),
            (0.95, 0.1),
            connectionstyle="arc3,rad=-0.35",
            arrowstyle="-|>",
            mutation_scale=16,
            lw=1.8,
            color=BLUE,
        )
    )
    ax.text(0.98, 0.52, "effort τ(p, u)", color=BLUE, fontsize=11)
    ax.add_patch(
        FancyArrowPatch(
            (0.55, -1.25),
            (1.05, -1.75),
            connectionstyle="arc3,rad=-0.4",
            arrowstyle="<|-",
            mutation_scale=16,
            lw=1.8,
            color=ORANGE,
        )
    )
    ax.text(1.12, -1.35, "opposing\nmoment M", color=ORANGE, fontsize=11, va="center")
    ax.text(-1.45, -2.15, "equilibrium: τ(p, u) = M\nstable: ∂τ/∂u < 0", fontsize=11, va="center")
    ax.set_title("Signs at a joint", fontsize=13, pad=12)
    ax.set_xlim(-1.7, 2.3)
    ax.set_ylim(-2.6, 1.7)


def world(ax: Axes) -> None:
    """Draw the default base pose: the chain hangs and bends toward world +x."""
    ax.fill_between([-1.0, 1.0], 0.0, 0.18, color=GREY, alpha=0.5, lw=0)
    ax.text(0, 0.3, "base", ha="center", fontsize=10)
    length, count, u = 0.5, 6, 0.22
    points, angle = [np.zeros(2), np.array([0, -length / 2])], 0.0
    for i in range(count):
        angle += u
        step = length if i < count - 1 else length / 2
        points.append(points[-1] + step * np.array([np.sin(angle), -np.cos(angle)]))
    path = np.array(points)
    ax.plot([0, 0], [0, -count * length], ls=":", color=GREY, lw=1.5)
    ax.plot(*path.T, "-", color=BLUE, lw=3)
    ax.plot(*path[1:-1].T, "o", color=BLUE, ms=8, mfc="white", mew=2)
    ax.plot(*path[-1], "s", color=BLUE, ms=7)
    ax.text(path[-1, 0] + 0.12, path[-1, 1] - 0.05, "tip", fontsize=11)
    ax.text(path[1, 0] - 0.16, path[1, 1], "joint 1", fontsize=10, ha="right", va="center")
    arrow(ax, (0, -0.02), (0, -0.95), "", DARK)
    ax.text(-0.12, -0.85, "chain x", ha="right", fontsize=11)
    origin = (1.5, -0.6)
    arrow(ax, origin, (origin[0] + 0.75, origin[1]), "X", ORANGE)
    arrow(ax, origin, (origin[0], origin[1] + 0.75), "Z", ORANGE)
    perpendicular_axis(ax, origin, "Y", into=True, color=ORANGE)
    ax.text(origin[0] + 0.35, origin[1] - 0.42, "world", color=ORANGE, fontsize=11, ha="center")
    ax.add_patch(
        FancyArrowPatch((-0.9, -1.6), (-0.9, -2.3), arrowstyle="-|>", mutation_scale=16, lw=1.8, color=DARK)
    )
    ax.text(-1.0, -1.95, "g", fontsize=12, ha="right")
    ax.set_title("World frame, default base pose", fontsize=13, pad=12)
    ax.set_xlim(-1.5, 2.7)
    ax.set_ylim(-3.3, 0.7)


def main() -> None:
    """Write the picture."""
    figure = Figure(figsize=(14, 5), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for ax, draw in zip(figure.subplots(1, 3), (module, bending, world), strict=True):
        draw(ax)
        ax.set_aspect("equal")
        ax.axis("off")
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT, metadata={"Software": None})


if __name__ == "__main__":
    main()
