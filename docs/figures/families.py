"""Draw docs/pictures/family_*.png: sections of the families with the names of their keys.

Run: python docs/figures/families.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from pliant_plugins.families.bellow.profile import BellowProfile
from pliant_plugins.families.bellow_bending.mesh import BellowGeometry
from pliant_plugins.families.bellow_helical.family import OFFSET, BellowHelical, BellowHelicalConfig
from pliant_plugins.families.fibre_reinforced.family import TubeGeometry
from pliant_plugins.families.pneunet.family import ChamberGeometry
from pliant_plugins.families.tendon_joint.family import JointGeometry

OUT = Path(__file__).parent.parent / "pictures"
BLUE, ORANGE, GREY, DARK = "#0072B2", "#D55E00", "#9a9a9a", "#222222"
BELLOW = "section y = 0: mid-trough, mid-crest with the joint, mid-trough"
SOFT = {"facecolor": "#bcd6ea", "edgecolor": BLUE, "lw": 1.2}
RIGID = {"facecolor": "#d9d9d9", "edgecolor": "#555555", "lw": 1.2}
Point = tuple[float, float]


def dimension(
    ax: Axes, start: Point, end: Point, text: str, at: Point, feet: bool = True, **how: str
) -> None:
    """Draw a dimension line between two points, shifted to `at`'s x or y, with its name at `at`."""
    flat = abs(start[1] - end[1]) < 1e-9
    a = (start[0], at[1]) if flat else (at[0], start[1])
    b = (end[0], at[1]) if flat else (at[0], end[1])
    if feet:
        for foot, line in ((start, a), (end, b)):
            ax.plot(*zip(foot, line, strict=True), color=GREY, lw=0.6, zorder=2)
    arrow = {"arrowstyle": "<->", "color": DARK, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", b, a, arrowprops=arrow, zorder=6)
    place = ((a[0] + b[0]) / 2, at[1]) if flat else (at[0], (a[1] + b[1]) / 2)
    shift, alignment = ((0, 3), ("center", "bottom")) if flat else ((5, 0), ("left", "center"))
    if how.get("side") == "left":
        shift, alignment = (-5, 0), ("right", "center")
    if how.get("side") == "below":
        shift, alignment = (0, -3), ("center", "top")
    ax.annotate(
        text, place, shift, textcoords="offset points", ha=alignment[0], va=alignment[1], fontsize=9, zorder=7
    )


def note(ax: Axes, text: str, at: Point, of: Point, color: str = DARK) -> None:
    """Draw a text with a thin line to the named part."""
    line = {"arrowstyle": "-", "color": color, "lw": 0.7, "shrinkA": 1, "shrinkB": 0}
    ax.annotate(text, of, at, arrowprops=line, color=color, fontsize=9, ha="center", va="center", zorder=7)


def frame(ax: Axes, across: str, length: float) -> None:
    """Draw the module frame at the joint."""
    for end, name in (((length, 0.0), across), ((0.0, length), "z")):
        ax.annotate("", end, (0, 0), arrowprops={"arrowstyle": "-|>", "color": ORANGE, "lw": 1.5}, zorder=8)
        ax.annotate(
            name,
            end,
            (3, 3),
            textcoords="offset points",
            color=ORANGE,
            fontsize=10,
            fontweight="bold",
            zorder=8,
        )
    ax.plot(0, 0, "o", ms=4, color=ORANGE, zorder=9)


def wall(profile: BellowProfile, inner: float, outer: float) -> tuple[np.ndarray, np.ndarray]:
    """Return x and radius around the wall's section between two offsets, from mid-trough to mid-trough."""
    arc, flank = np.linspace(0, np.pi / 2, 40), np.linspace(0, 1, 5)

    def half(depth: float) -> tuple[np.ndarray, np.ndarray]:
        d = np.array(depth)
        parts = [profile.crest(arc, d), profile.flank(flank, d), profile.trough(arc, d)]
        x, radius = (np.concatenate(part) for part in zip(*parts, strict=True))
        return np.concatenate([-x[::-1], x]), np.concatenate([radius[::-1], radius])

    (xi, ri), (xo, ro) = half(inner), half(outer)
    return np.concatenate([xi, xo[::-1]]), np.concatenate([ri, ro[::-1]])


def page(ax: Axes, x: Point, z: Point, title: str) -> None:
    """Set equal scale, limits and title of the axes, and hide their frame."""
    ax.set_aspect("equal")
    ax.set_xlim(*x)
    ax.set_ylim(*z)
    ax.set_title(title, fontsize=10, color=DARK)
    ax.axis("off")


def sheet(widths: Point, height: float = 5.4) -> tuple[Figure, Axes, Axes]:
    """Return a figure and two axes side by side, the lengthwise section first."""
    figure = Figure(figsize=(11.5, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=widths)
    return figure, left, right


def tube_sections(ax: Axes, profile: BellowProfile, inner: float, outer: float, height: float) -> None:
    """Draw the wall seen along x: the circles of crest and trough."""
    crest, trough = profile.crest_radius_m, profile.inner_radius_m
    ax.add_patch(Circle((0, height), crest + outer, **SOFT))
    ax.add_patch(Circle((0, height), crest + inner, facecolor="white", edgecolor=BLUE, lw=0.8))
    ax.add_patch(Circle((0, height), trough + outer, facecolor="#dfeaf4", edgecolor=BLUE, lw=0.8, ls="--"))
    ax.add_patch(Circle((0, height), trough + inner, facecolor="white", edgecolor=BLUE, lw=0.8, ls="--"))


def bellow(ax: Axes, profile: BellowProfile, inner: float, outer: float, height: float) -> None:
    """Draw the lengthwise section of a module with its axis."""
    x, radius = wall(profile, inner, outer)
    for sign in (1, -1):
        ax.fill(x, height + sign * radius, **SOFT, zorder=3)
    ends = 0.62 * profile.module_length_m
    ax.plot([-ends, ends], [height, height], color=GREY, lw=0.8, ls="-.", zorder=2)


def bellow_bending() -> Figure:
    g = BellowGeometry(2.0, 6.0, 1.5, 11.0)
    t, l, height, crest = g.wall_m, g.module_length_m, g.axis_height_m, g.crest_radius_m  # noqa: E741
    figure, ax, end = sheet((1.25, 1))
    bellow(ax, g, 0.0, t, height)
    ax.add_patch(Rectangle((-l / 2, -t), l, 2 * t, facecolor="#8fb8d8", edgecolor=BLUE, lw=1.2, zorder=4))
    frame(ax, "x", 4.2)
    dimension(ax, (-l / 2, -t), (l / 2, -t), "module_length  l", (0, -t - 2.2), side="below")
    dimension(
        ax,
        (-l / 2, height),
        (-l / 2, height + g.inner_radius_m),
        "inner_radius  r",
        (-l / 2 - 1.2, 0),
        side="left",
    )
    dimension(ax, (0, height), (0, height + crest), "", (0, 0), feet=False)
    note(ax, "2R − r", (1.8, height + 0.9), (1.8, height + 0.9))
    middle = height + g.average_radius_m
    dimension(ax, (l / 2, height), (l / 4, middle), "average_radius  R", (l / 2 + 1.0, 0))
    dimension(ax, (0, height + crest), (0, height + crest + t), "wall  t", (l / 2 + 1.0, 0))
    dimension(ax, (l / 2, -t), (l / 2, t), "2t", (l / 2 + 1.0, 0))
    note(ax, "strain-limiting\nplate", (-l / 2 - 3.0, 0), (-l / 2 + 0.8, 0), BLUE)
    note(ax, "cavity, p", (0, height - 0.9), (0, height - 0.9), BLUE)
    page(
        ax,
        (-11.5, 13),
        (-6, height + crest + 4),
        BELLOW,
    )
    tube_sections(end, g, 0.0, t, height)
    R = g.average_radius_m
    end.add_patch(Rectangle((-R, -t), 2 * R, 2 * t, facecolor="#8fb8d8", edgecolor=BLUE, lw=1.2))
    frame(end, "y", 4.2)
    dimension(end, (-R, -t), (R, -t), "2R", (0, -t - 2.2), side="below")
    note(end, "trough", (0, height), (0, height), BLUE)
    note(end, "crest", (0, height + crest - 1.4), (0, height + crest - 1.4), BLUE)
    page(end, (-14, 14), (-6, height + crest + 4), "seen along x")
    return figure


def bellow_translational() -> Figure:
    g = BellowProfile(5.0, 8.0, 1.5, 10.0)
    t, l, crest = g.wall_m, g.module_length_m, g.crest_radius_m  # noqa: E741
    figure, ax, end = sheet((1.1, 1), 5.6)
    bellow(ax, g, -t / 2, t / 2, 0.0)
    x, z = wall(g, 0.0, 0.0)
    half = len(x) // 2
    for sign in (1, -1):
        ax.plot(x[:half], sign * z[:half], color=BLUE, lw=0.8, ls="--", zorder=5)
    frame(ax, "x", 3.2)
    dimension(
        ax,
        (-l / 2, -g.inner_radius_m),
        (l / 2, -g.inner_radius_m),
        "module_length  l",
        (0, -crest - 2.4),
        side="below",
    )
    dimension(ax, (-l / 2, 0), (-l / 2, g.inner_radius_m), "inner_radius  r", (-l / 2 - 1.2, 0), side="left")
    dimension(ax, (l / 2, 0), (l / 4, g.average_radius_m), "average_radius  R", (l / 2 + 1.2, 0))
    dimension(ax, (0, 0), (0, -crest), "", (0, 0), feet=False)
    note(ax, "2R − r", (1.7, -2.0), (1.7, -2.0))
    dimension(ax, (0, crest - t / 2), (0, crest + t / 2), "wall  t", (l / 2 + 1.2, 0))
    note(ax, "mid-surface", (-l / 2 - 3.0, -crest + 0.6), (-l / 4, -g.average_radius_m), BLUE)
    page(
        ax,
        (-11.5, 12),
        (-crest - 5, crest + 2.5),
        BELLOW,
    )
    tube_sections(end, g, -t / 2, t / 2, 0.0)
    frame(end, "y", 3.2)
    note(end, "trough", (0, -g.inner_radius_m - 1.5), (0, -g.inner_radius_m - 1.5), BLUE)
    note(end, "crest", (0, crest - 1.5), (0, crest - 1.5), BLUE)
    page(end, (-14, 14), (-crest - 5, crest + 2.5), "seen along x")
    return figure


def bellow_helical() -> Figure:
    config = BellowHelicalConfig(
        inner_radius_m=3.09e-3, average_radius_m=5.66e-3, wall_m=1.51e-3, module_length_m=4.72e-3
    )
    family = BellowHelical(config)
    height, width = 1e3 * family.offset_m, 1e3 * family.constraint_width_m
    g = BellowProfile(3.09, 5.66, 1.51, 4.72)
    t, l, crest = g.wall_m, g.module_length_m, g.crest_radius_m  # noqa: E741
    figure, ax, end = sheet((1, 1), 5.8)
    bellow(ax, g, -t / 2, t / 2, height)
    ax.plot([-l / 2, l / 2], [0, 0], color=ORANGE, lw=3, zorder=4, solid_capstyle="butt")
    frame(ax, "x", 3.4)
    low = height - crest - t / 2
    dimension(ax, (-l / 2, low + 4), (l / 2, low + 4), "module_length  l", (0, low - 1.2), side="below")
    dimension(
        ax,
        (-l / 2, height),
        (-l / 2, height + g.inner_radius_m),
        "inner_radius  r",
        (-l / 2 - 1.0, 0),
        side="left",
    )
    dimension(
        ax,
        (-l / 2, 0),
        (-l / 2, height),
        f"constraint_offset\n({OFFSET} r unless given)",
        (-l / 2 - 1.0, 0),
        side="left",
    )
    dimension(
        ax, (l / 2, height), (l / 4, height + g.average_radius_m), "average_radius  R", (l / 2 + 1.0, 0)
    )
    dimension(ax, (0, height + crest - t / 2), (0, height + crest + t / 2), "wall  t", (l / 2 + 1.0, 0))
    note(ax, "constraint", (l / 2 + 2.6, -1.8), (l / 2 - 0.1, 0), ORANGE)
    note(ax, "tube's axis", (l / 2 + 2.6, height - 0.9), (l / 2 + 0.4, height), GREY)
    page(
        ax,
        (-9.5, 8.5),
        (low - 3, height + crest + 2),
        BELLOW,
    )
    tube_sections(end, g, -t / 2, t / 2, height)
    end.plot([-width / 2, width / 2], [0, 0], color=ORANGE, lw=3, zorder=6, solid_capstyle="butt")
    frame(end, "y", 2.6)
    dimension(end, (-width / 2, 0), (width / 2, 0), "constraint_width", (0, low - 1.2), side="below")
    note(end, "crest", (0, height + crest - 1.3), (0, height + crest - 1.3), BLUE)
    note(end, "trough", (0, height + 1.2), (0, height + 1.2), BLUE)
    page(end, (-10, 10), (low - 3, height + crest + 2), "seen along x")
    return figure


def tendon_joint() -> Figure:
    g = JointGeometry(28.0, 5.0, 1.0, 20.0, 6.591, 11.1485, 18.0, 20.0, 0.92, 0.02)
    H, t, c, back = g.link_height_m, g.flexure_thickness_m, g.flexure_length_m, g.module_length_m / 2
    figure, ax, end = sheet((1.75, 1), 5.4)
    x = np.array([back, g.lower_edge_x_m, g.span_m, g.span_m, g.upper_edge_x_m, back])
    z = np.array([-H / 2, -H / 2, -t / 2, t / 2, H / 2, H / 2])
    for sign in (1, -1):
        ax.fill(sign * x, z, **RIGID)
    ax.add_patch(Rectangle((-c / 2, -t / 2), c, t, **SOFT, zorder=3))
    h = g.tendon_offset_m
    ax.plot([-g.hole_x_m, g.hole_x_m], [-h, -h], color=ORANGE, lw=1.6, zorder=4)
    for sign in (1, -1):
        ax.plot(sign * g.hole_x_m, -h, "o", ms=5, mfc="white", mec=ORANGE, zorder=5)
    frame(ax, "x", 4.2)
    dimension(ax, (-back, -H / 2), (back, -H / 2), "module_length  l", (0, -H / 2 - 4.6), side="below")
    dimension(ax, (-c / 2, 0.5), (c / 2, 0.5), "flexure_length", (0, H / 2 + 1.6))
    dimension(ax, (g.span_m, -h), (g.hole_x_m, -h), "tendon_setback", (0, -H / 2 - 1.6), side="below")
    dimension(ax, (-g.hole_x_m, 0), (-g.hole_x_m, -h), "tendon_offset", (-g.hole_x_m + 0.8, 0), feet=False)
    dimension(ax, (back, -H / 2), (back, H / 2), "link_height", (back + 1.2, 0))
    note(ax, "flexure_thickness", (-8.5, 3.2), (-c / 2 + 0.4, 0.2), BLUE)
    note(ax, "tendon, T", (5.5, -h + 1.4), (5.5, -h), ORANGE)
    note(ax, "faces meet at\nclosing_angle", (-7.5, -H / 2 - 2.2), (-g.lower_edge_x_m, -H / 2), DARK)
    note(ax, "… at opening_angle,\nthe other way", (9, H / 2 + 2.6), (g.upper_edge_x_m, H / 2), DARK)
    note(ax, "rigid link", (9.5, 4.5), (9.5, 4.5), "#555555")
    page(
        ax, (-16, 21), (-H / 2 - 7, H / 2 + 4.2), "section y = 0: mid-link, flexure with the joint, mid-link"
    )
    W, w = g.link_width_m, g.flexure_width_m
    end.add_patch(Rectangle((-W / 2, -H / 2), W, H, **RIGID))
    end.add_patch(Rectangle((-w / 2, -t / 2), w, t, **SOFT, zorder=3))
    end.plot(0, -h, "o", ms=6, mfc="white", mec=ORANGE, zorder=5)
    frame(end, "y", 4.2)
    dimension(end, (-W / 2, -H / 2), (W / 2, -H / 2), "link_width", (0, -H / 2 - 1.6), side="below")
    dimension(end, (-w / 2, 0), (w / 2, 0), "flexure_width", (0, H / 2 + 1.6))
    note(end, "tendon's hole", (4.8, -h), (0.5, -h), ORANGE)
    page(end, (-13, 13), (-H / 2 - 7, H / 2 + 4.2), "seen along x")
    return figure


def pneunet() -> Figure:
    g = ChamberGeometry(10.0, 15.0, 14.0, 1.5, 2.0, 1.6, 1.5, 1.5, 2.0, 1.5, 1.0)
    _, inner, outer, half = g.x_lines
    low, low_body, floor, channel, bridge, ceiling, top = g.z_lines
    figure, ax, end = sheet((1.15, 1), 5.8)
    ax.add_patch(Rectangle((-half, low_body), 2 * half, bridge - low_body, **SOFT, zorder=2))
    ax.add_patch(Rectangle((-outer, low_body), 2 * outer, top - low_body, **SOFT, zorder=2))
    ax.add_patch(
        Rectangle(
            (-half + 0.02, low_body + 0.02),
            2 * half - 0.04,
            bridge - low_body - 0.1,
            color="#bcd6ea",
            zorder=2,
        )
    )
    air = {"facecolor": "white", "edgecolor": BLUE, "lw": 0.8, "zorder": 3}
    ax.add_patch(Rectangle((-half, floor), 2 * half, channel - floor, **air))
    ax.add_patch(Rectangle((-inner, floor), 2 * inner, ceiling - floor, **air))
    ax.add_patch(
        Rectangle(
            (-inner - 0.1, floor + 0.06), 2 * inner + 0.2, channel - floor - 0.12, color="white", zorder=4
        )
    )
    ax.add_patch(
        Rectangle(
            (-half, low), 2 * half, low_body - low, facecolor="#f3c9a9", edgecolor=ORANGE, lw=1.2, zorder=4
        )
    )
    frame(ax, "x", 3.0)
    dimension(ax, (-half, low), (half, low), "module_length", (0, low - 1.4), side="below")
    dimension(ax, (-outer, top), (-inner, top), "wall", (0, top + 0.7))
    dimension(ax, (outer, bridge), (half, bridge), "gap / 2", (0, top + 0.7))
    dimension(ax, (half, low_body), (half, top), "height", (half + 5.6, 0))
    dimension(ax, (inner, ceiling), (inner, top), "shell", (half + 0.8, 0))
    dimension(ax, (half, channel), (half, bridge), "bridge", (half + 0.8, 0))
    dimension(ax, (half, floor), (half, channel), "channel_height", (half + 0.8, 0))
    dimension(ax, (-half, low_body), (-half, floor), "floor", (-half - 0.8, 0), side="left")
    dimension(ax, (-half, low), (-half, low_body), "layer", (-half - 0.8, 0), side="left")
    note(ax, "chamber, p", (0, 7.5), (0, 7.5), BLUE)
    page(
        ax,
        (-9.0, 14.5),
        (low - 3.5, top + 3.2),
        "section y = 0: mid-gap, mid-chamber with the joint, mid-gap",
    )

    _, c, y, w = g.y_lines
    end.add_patch(Rectangle((-w, low_body), 2 * w, top - low_body, **SOFT))
    end.add_patch(Rectangle((-y, floor), 2 * y, ceiling - floor, **air))
    end.add_patch(
        Rectangle(
            (-c, floor), 2 * c, channel - floor, facecolor="none", edgecolor=BLUE, lw=0.8, ls="--", zorder=5
        )
    )
    end.add_patch(Rectangle((-w, low), 2 * w, low_body - low, facecolor="#f3c9a9", edgecolor=ORANGE, lw=1.2))
    frame(end, "y", 3.0)
    dimension(end, (-w, low), (w, low), "width", (0, low - 1.4), side="below")
    dimension(end, (y, top), (w, top), "shell", (0, top + 0.7))
    dimension(end, (-c, channel), (c, channel), "channel_width", (0, channel + 0.6))
    note(end, "chamber, p", (0, 9.0), (0, 9.0), BLUE)
    page(end, (-11, 11), (low - 3.5, top + 3.2), "section x = 0, seen along x; dashed: the channel")
    return figure


def fibre_reinforced() -> Figure:
    g = TubeGeometry(20.0, 6.0, 2.5, 0.5, 2.0, np.radians(50), np.radians(80))
    height, outer, half = g.axis_height_m, g.radius_m + g.wall_m, g.module_length_m / 2
    figure, ax, end = sheet((1.3, 1), 5.8)
    for sign in (1, -1):
        low = height + sign * g.radius_m if sign > 0 else height - outer
        ax.add_patch(Rectangle((-half, low), 2 * half, g.wall_m, **SOFT, zorder=3))
    ax.add_patch(
        Rectangle(
            (-half, -g.sleeve_m / 2), 2 * half, g.sleeve_m, facecolor="#f3c9a9", edgecolor=ORANGE, zorder=4
        )
    )
    lean = 2 * outer / np.tan(g.thread_angle_rad)
    for start in np.arange(-half, half - lean + 0.1, g.thread_spacing_m):
        for a, b in ((start, start + lean), (start + lean, start)):
            ax.plot([a, b], [height - outer, height + outer], color=GREY, lw=0.7, zorder=5)
    ax.plot([-1.08 * half, 1.08 * half], [height, height], color=DARK, lw=0.8, ls="-.", zorder=2)
    frame(ax, "x", 3.4)
    dimension(ax, (-half, -0.25), (half, -0.25), "module_length", (0, -2.0), side="below")
    dimension(ax, (half, height), (half, height + g.radius_m), "radius", (half + 1.0, 0))
    dimension(ax, (half, height + g.radius_m), (half, height + outer), "wall", (half + 1.0, 0))
    dimension(ax, (half, -g.sleeve_m / 2), (half, g.sleeve_m / 2), "sleeve", (half + 1.0, 0))
    spot = -half + 2 * g.thread_spacing_m + lean
    dimension(
        ax,
        (spot, height + outer),
        (spot + g.thread_spacing_m, height + outer),
        "thread_spacing",
        (0, height + outer + 0.8),
    )
    note(
        ax,
        "threads at ±thread_angle\nfrom the axis",
        (-half - 4.6, height + 2.5),
        (-half + 0.6, height + 3.0),
        GREY,
    )
    note(ax, "sheet", (-half - 3.0, 1.4), (-half, 0.0), ORANGE)
    page(ax, (-half - 8, half + 5), (-4.5, height + outer + 3), "section y = 0; threads seen from the side")

    end.add_patch(Circle((0, height), outer, **SOFT))
    end.add_patch(
        Circle((0, height), outer - g.sleeve_m, facecolor="none", edgecolor=BLUE, lw=0.8, ls="--", zorder=3)
    )
    end.add_patch(Circle((0, height), g.radius_m, facecolor="white", edgecolor=BLUE, lw=0.8))
    phi = np.linspace(-g.sheet_angle_rad, g.sheet_angle_rad, 60)
    ring = [
        (r * np.sin(phi[::way]), height - r * np.cos(phi[::way]))
        for r, way in ((outer, 1), (outer - g.sleeve_m, -1))
    ]
    end.fill(
        *(np.concatenate(c) for c in zip(*ring, strict=True)), facecolor="#f3c9a9", edgecolor=ORANGE, zorder=4
    )
    edge = outer * np.sin(g.sheet_angle_rad), height - outer * np.cos(g.sheet_angle_rad)
    for place in ((0.0, height - outer), edge):
        end.plot([0, place[0]], [height, place[1]], color=GREY, lw=0.8, zorder=5)
    arc = np.linspace(0, g.sheet_angle_rad, 30)
    end.plot(4.2 * np.sin(arc), height - 4.2 * np.cos(arc), color=DARK, lw=0.9, zorder=6)
    note(end, "sheet_angle", (2.6, height - 2.2), (2.6, height - 2.2))
    note(end, "cavity, p", (0, height + 2.5), (0, height + 2.5), BLUE)
    frame(end, "y", 3.4)
    page(end, (-11, 11), (-4.5, height + outer + 3), "seen along x")
    return figure


def main() -> None:
    kinds = (bellow_bending, bellow_helical, bellow_translational, tendon_joint, pneunet, fibre_reinforced)
    for draw in kinds:
        path = OUT / f"family_{draw.__name__}.png"
        draw().savefig(path, facecolor="white")
        print(f"written  {path}")


if __name__ == "__main__":
    main()
