"""Draw docs/pictures/engines_scaling.png and engines_ablation.png from the results of `make bench-physics`.

Run: python docs/figures/engines.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[2]
OUT = ROOT / "docs" / "pictures"
COLOURS = {"quasistatic": "#0072B2", "mujoco": "#D55E00", "pybullet": "#009E73"}
SHADES = ("#FDB863", "#E66101", "#B2182B", "#67001F", "#0072B2")
GREYS = ("#BBBBBB", "#888888", "#444444")
MARKERS = "os^Dv"


def main() -> None:
    """Draw both pictures."""
    _scaling(_result("physics_scaling"))
    _ablation(_result("physics_ablation"))


def _result(name: str) -> dict[str, Any]:
    path = ROOT / "benchmarks" / "out" / f"{name}.json"
    if not path.exists():
        raise SystemExit(f"{path} is not there: run `make bench-physics` first")
    result: dict[str, Any] = json.loads(path.read_text())
    return result


def _scaling(result: dict[str, Any]) -> None:
    """Draw the time to a settled helix over its modules, each line named at its end."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    for kind, colour in COLOURS.items():
        rows = [row for row in result["modules"] if row["engine"] == kind and "cpu_s" in row]
        x, y = [row["modules"] for row in rows], [1e3 * row["cpu_s"] for row in rows]
        axes.plot(x, y, marker="o", color=colour)
        axes.annotate(
            kind, (x[-1], y[-1]), xytext=(6, 0), textcoords="offset points", color=colour, va="center"
        )
    axes.set(xscale="log", yscale="log", xlabel="modules", ylabel="CPU time to a settled helix, ms")
    sizes = sorted({row["modules"] for row in result["modules"]})
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.set_xlim(7, 600)
    axes.minorticks_off()
    _save(figure, [axes], "engines_scaling")


def _ablation(result: dict[str, Any]) -> None:
    """Draw the distance from equilibrium after the 2 s run over the step size, one line per damping."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    panels = (
        (left, "mujoco", SHADES, "MuJoCo, joint damping (N·m·s/rad)"),
        (right, "published", GREYS, "published formulation, motor friction (N·m)"),
    )
    for axes, key, colours, title in panels:
        rows = result[key]
        for damping, colour, marker in zip(
            dict.fromkeys(row["damping"] for row in rows), colours, MARKERS, strict=False
        ):
            line = [row for row in rows if row["damping"] == damping and row["away_mm"] is not None]
            axes.plot(
                [1e3 * row["step_s"] for row in line],
                [row["away_mm"] for row in line],
                marker=marker,
                color=colour,
                lw=2.2 if damping == "default" else 1.5,
                label="default, with drag" if damping == "default" else f"{damping:g}",
            )
        axes.axhline(0.1, color="#222222", lw=0.8, ls=":")
        axes.set(xscale="log", yscale="log", xlabel="step, ms", title=title)
        ticks = sorted({1e3 * row["step_s"] for row in rows})
        axes.set_xticks(ticks, [f"{tick:.2g}" for tick in ticks])
        axes.minorticks_off()
        axes.legend(frameon=False, ncols=2, fontsize="small", loc="upper center")
    left.set_ylim(1e-3, 3e3)
    left.set_ylabel("from equilibrium after 2 s, mm")
    right.annotate("0.1 mm", (0.45, 0.1), xytext=(0, 3), textcoords="offset points", fontsize="small")
    _save(figure, [left, right], "engines_ablation")


def _save(figure: Figure, panels: list[Axes], name: str) -> None:
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
    FigureCanvasAgg(figure)
    figure.savefig(OUT / f"{name}.png", dpi=130)


if __name__ == "__main__":
    main()
