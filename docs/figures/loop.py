"""Draw docs/pictures/evidence_loop.png, the order of the commands. Run: python docs/figures/loop.py"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

OUT = Path(__file__).parent.parent / "pictures" / "evidence_loop.png"
BLUE, ORANGE, GREY, DARK = "#0072B2", "#D55E00", "#6a6a6a", "#222222"
WIDTH, HEIGHT = 2.5, 0.95
# Command or thing → centre, the question that it answers, colour of its box.
BOXES = {
    "your bench": ((0.0, 1.0), "a recording, as CSV", GREY),
    "compare": ((3.6, 1.0), "wrong beyond the noise?", BLUE),
    "diagnose": ((7.2, 1.0), "which effect is missing?", BLUE),
    "extend": ((10.8, 1.0), "fit it into a new study", BLUE),
    "plan": ((3.6, -1.35), "which run decides?", ORANGE),
    "done": ((7.2, -1.35), "the error is noise", GREY),
}


def box(ax: Axes, name: str) -> None:
    """Draw a named box with the question that it answers."""
    (x, y), text, color = BOXES[name]
    ax.add_patch(
        FancyBboxPatch(
            (x - WIDTH / 2, y - HEIGHT / 2),
            WIDTH,
            HEIGHT,
            boxstyle="round,pad=0.08",
            fc="white",
            ec=color,
            lw=2,
        )
    )
    command = color != GREY
    title = f"pliant {name}" if command else name
    ax.text(x, y + 0.17, title, ha="center", va="center", color=color, fontsize=12,
            family="monospace" if command else "sans-serif", weight="bold")  # fmt: skip
    ax.text(x, y - 0.22, text, ha="center", va="center", color=DARK, fontsize=9.5)


def arrow(
    ax: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    text: str,
    at: tuple[float, float],
    bend: float = 0.0,
) -> None:
    """Draw an arrow with the answer that leads along it."""
    ax.add_patch(
        FancyArrowPatch(
            start,
            end,
            arrowstyle="-|>",
            mutation_scale=16,
            lw=1.6,
            color=DARK,
            connectionstyle=f"arc3,rad={bend}",
        )
    )
    ax.text(
        *at, text, ha="center", va="center", fontsize=9, color=DARK, style="italic", backgroundcolor="white"
    )


def main() -> None:
    """Draw the loop."""
    figure = Figure(figsize=(10.4, 4.2), dpi=150)
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0, 0, 1, 1))
    for name in BOXES:
        box(ax, name)
    side, top = WIDTH / 2 + 0.1, HEIGHT / 2 + 0.1
    arrow(ax, (side, 1), (3.6 - side, 1), "", (1.8, 1))
    arrow(ax, (3.6 + side, 1), (7.2 - side, 1), "yes", (5.4, 1.2))
    arrow(ax, (7.2 + side, 1), (10.8 - side, 1), "this one", (9.0, 1.2))
    arrow(ax, (10.8, 1 + top), (3.6, 1 + top), "compare the new study", (7.2, 2.5), bend=0.2)
    arrow(ax, (6.5, 1 - top), (4.4, -1.35 + top), "these data\ndo not decide", (5.45, -0.15))
    arrow(ax, (7.2, 1 - top), (7.2, -1.35 + top), "none", (7.6, -0.15))
    arrow(ax, (3.6 - side, -1.35), (0, 1 - top), "its file for the bench", (0.75, -0.75), bend=-0.25)
    ax.text(10.8, -1.35, "improve walks compare, diagnose\nand extend by itself, and scores\non runs that it held out",
            ha="center", va="center", fontsize=9.5, color=GREY)  # fmt: skip
    ax.set(xlim=(-1.6, 12.4), ylim=(-2.15, 2.85), aspect="equal")
    ax.axis("off")
    figure.savefig(OUT)


if __name__ == "__main__":
    main()
