"""∂τ/∂u over the box of a law: where it nears zero a joint is about to snap."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from pliant.formatting import actuation_unit, deformation_unit, effort_unit, number
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.report.figures import style
from pliant.report.figures.fem_states import actuation_word, coordinate_words
from pliant.report.fit_reading import Fitted

POINTS = 81
LEVELS = 14
FLAT = 0.02  # of the largest slope: less than that across the box is shown as one colour


def slope_grid(law: JointLaw, axis: str) -> tuple[Array, Array, Array]:
    """p (m,), u (m,) and ∂τ_axis/∂u_axis (m, m) over the law's box, the other axes at zero."""
    k = law.axes.index(axis)
    p = _even(law.domain.actuation)
    u = _even(law.domain.deformation[k])
    P, V = np.meshgrid(p, u, indexing="ij")
    deformation = np.zeros((P.size, len(law.axes)))
    deformation[:, k] = V.ravel()
    slopes = law.evaluate(P.ravel(), deformation).dtau_du[:, k, k]
    return p, u, slopes.reshape(P.shape)


def _even(limits: Array) -> Array:
    return np.linspace(float(limits[0]), float(limits[1]), POINTS)


def least_stable(law: JointLaw, count: int = 4000) -> float:
    """The largest eigenvalue of the symmetric part of ∂τ/∂u in the box: below 0 the joint is stable everywhere.

    Looked for at `count` random places and, axis by axis, on the grid of `slope_grid`.
    """
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    values = box[:, 0] + np.ptp(box, axis=1) * np.random.default_rng(0).random((count, len(box)))
    slopes = law.evaluate(values[:, 0], values[:, 1:]).dtau_du
    largest = float(np.linalg.eigvalsh((slopes + np.swapaxes(slopes, 1, 2)) / 2).max())
    return max(largest, *(float(slope_grid(law, axis)[2].max()) for axis in law.axes))


def slope_map(fitted: Fitted) -> style.Png:
    """One panel for each axis that was explored."""
    law, data, names = fitted.law, fitted.data, fitted.explored
    p_unit, u_unit, effort = (
        actuation_unit(law.actuation_name),
        deformation_unit(law),
        effort_unit(law),
    )
    per = "m" if law.joint == "prismatic" else "rad"
    with style.canvas(1000 if len(names) == 1 else 1560, 600) as figure:
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.03)
        grid = figure.subplots(1, len(names), squeeze=False)[0]
        for axes, name in zip(grid, names, strict=True):
            p, u, slopes = slope_grid(law, name)
            shown = effort.factor * slopes
            mesh = axes.contourf(
                u * u_unit.factor,
                p * p_unit.factor,
                shown,
                _levels(shown),
                cmap=style.pressure_map().reversed(),
            )
            if shown.max() >= 0 > shown.min():
                axes.contour(
                    u * u_unit.factor, p * p_unit.factor, shown, [0.0], colors=style.WARN, linewidths=2
                )
            i, j = np.unravel_index(int(np.argmax(shown)), shown.shape)
            _mark(axes, u[j] * u_unit.factor, p[i] * p_unit.factor)
            bar = figure.colorbar(mesh, ax=axes, pad=0.02)
            bar.outline.set_visible(False)
            bar.ax.yaxis.set_major_formatter(lambda value, _: number(float(value), 4))
            bar.set_label(rf"$\partial\tau/\partial u$ ({effort.symbol}/{per})")
            axes.grid(False)
            axes.set_xlabel(coordinate_words(data, name))
            axes.set_ylabel(f"{actuation_word(data)} ({p_unit.symbol})")
            word = "softest" if shown.max() < 0 else "UNSTABLE"
            text = f"axis {name}: {word}" if len(names) > 1 else word
            largest = number(float(shown.max()), 3)
            axes.set_title(f"{text[0].upper()}{text[1:]} {largest} {effort.symbol}/{per}")
        return style.png(figure)


def _levels(shown: Array) -> Array:
    """Round contours over the slopes; around a slope that hardly varies, a range of its own size."""
    low, high = float(shown.min()), float(shown.max())
    room = max(FLAT * max(abs(low), abs(high)) - (high - low), 0.0) / 2 + np.finfo(float).tiny
    return np.asarray(MaxNLocator(LEVELS).tick_values(low - room, high + room))


def _mark(axes: Any, x: float, y: float) -> None:
    axes.plot([x], [y], "o", ms=9, mfc="none", mec="white", mew=2.6, clip_on=False, zorder=5)
    axes.plot([x], [y], "o", ms=9, mfc="none", mec=style.INK, mew=1.3, clip_on=False, zorder=6)
