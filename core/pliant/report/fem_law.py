"""What a joint law misses of the states of each axis: lateral axes and states that hold several at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import effort_unit, number, percent
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.records.law import JointLaw
from pliant.report.document import Cells, Table
from pliant.report.fem_reading import explored_kinds


def law_by_axis(data: ModuleData, law: JointLaw, name: str = "") -> Table | None:
    """Errors of τ by axis on trusted states, fitted and left out; None for a module of one axis.

    Also None for a law of other axes. Shares are of the range of an axis' effort in its own states.
    """
    if len(data.axes) < 2 or set(law.axes) != set(data.axes):
        return None
    order = [data.axes.index(axis) for axis in law.axes]
    missed = np.full(data.tau.shape, np.nan)
    missed[:, order] = law.evaluate(data.actuation, data.deformation[:, order]).tau - data.tau[:, order]
    trusted, check = np.isin(data.status, TRUSTED), data.role == "check"
    ranges = {axis: _range(data, axis, trusted) for axis in data.axes}
    unit = effort_unit(law)
    rows: list[Cells] = []
    for kind in explored_kinds(data):
        chosen = trusted & (data.explored == kind)
        for axis in data.axes if kind == "coupling" else (kind,):
            k = data.axes.index(axis)
            label = f"all held: {axis}" if kind == "coupling" else axis
            fit, left = missed[chosen & ~check, k], missed[chosen & check, k]
            worst = float(np.abs(missed[chosen, k]).max(initial=0.0))
            rows.append(
                [
                    label,
                    _worst(fit, ranges[axis]),
                    _worst(left, ranges[axis]),
                    number(worst * unit.factor, 3) if chosen.any() else "–",
                ]
            )
    head = ["axis", "fitted states, worst of range", "check states, worst of range", f"worst ({unit.symbol})"]
    note = (
        "Of the range of each axis' effort in its own states. 'All held': states that hold all axes at once, which "
        "tell how well a law without coupling does."
    )
    return Table(f"{name}Errors of the law by axis", head, rows, note)


def _range(data: ModuleData, axis: str, trusted: NDArray[np.bool_]) -> float:
    """Range of an axis' effort in its own trusted states; 1 where there are none."""
    tau = data.tau[trusted & (data.explored == axis), data.axes.index(axis)]
    return float(np.ptp(tau)) or 1.0 if len(tau) else 1.0


def _worst(missed: Array, scale: float) -> str:
    if not len(missed):
        return "–"
    return f"{percent(float(np.abs(missed).max()) / scale)} ({len(missed)})"
