"""Tables of a module's FEM data: states by axis, sampling, coupling of axes, cost, failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import Unit, actuation_unit, deformation_unit, effort_unit, number, percent, seconds
from pliant.records.fem import PASSED, TRUSTED, ModuleData
from pliant.report.document import Cells, Table
from pliant.report.fem_reading import axis_record, explored_kinds, failed_place, solved_rows

ROUNDED = 9  # decimals of a coordinate in rad or m that are more than rounding
LISTED = 20  # failed states that are spelt out
STRATEGIES = {"adaptive": "one by one", "grid": "grid", "study": "published study's loads"}


def states_table(data: ModuleData) -> Table:
    """How many states of each sort, and what they span."""
    p_unit, u_unit, effort = (
        actuation_unit(data.actuation_name),
        deformation_unit(data),
        effort_unit(data),
    )
    rows: list[Cells] = []
    for kind in explored_kinds(data):
        chosen = data.explored == kind
        if kind == "coupling":
            spans = ["all axes held", "–", "–"]
        else:
            k = data.axes.index(kind)
            u, tau = data.deformation[chosen, k], data.tau[chosen, k]
            spans = [kind, _span(u, u_unit), _span(tau, effort)]
        count = _counts(data, chosen)
        rows.append([spans[0], *count, _span(data.actuation[chosen], p_unit), *spans[1:]])
    head = ["axis", "to fit", "check", "self-contact", "actuation", "u", "effort τ"]
    copies = int(np.sum(~solved_rows(data)))
    note = "States in self-contact are marked, since the FEM has no contact."
    if passed := int(np.sum(data.status == PASSED)):
        note += f" In {passed} states convolutions pass through each other, as 'fem.self_contact: pass' lets them."
    if copies > 1:  # the rest state may cost nothing either
        note += (
            f" {copies} states are copies: mirror images at −u, and free states that belong to several axes."
        )
    return Table("States", head, rows, note)


def sampling_table(data: ModuleData) -> Table:
    """How the states of each axis were chosen and what error that left."""
    rows: list[Cells] = []
    kind = str(data.sampling.get("kind", ""))
    for axis in data.explored_axes():
        record = axis_record(data, axis)
        tests = record.get("tests") or []
        last = [percent(float(t["miss"])) for t in tests[-2:]]
        one_by_one = "stated_error" in record
        rows.append(
            [
                axis,
                STRATEGIES["adaptive"] if one_by_one else STRATEGIES.get(kind, kind or "–"),
                percent(float(record["error"])) if one_by_one else "–",
                _share(record.get("stated_error")),
                ", ".join(last) or "–",
                ("yes" if record.get("reached") else "NO") if one_by_one else "–",
                _share(record.get("check_error")),
                _sides(record),
            ]
        )
    head = ["axis", "states chosen", "wanted", "stated error", "last misses", "reached", "at check states"]
    note = (
        "Errors are shares of the effort's range in the data. Stated error: twice the largest deviation of a Gaussian "
        "process of all states and slopes, widened by its own misses. Reached: stated error and the last two misses "
        "are below the wanted one."
        if any("stated_error" in axis_record(data, axis) for axis in data.explored_axes())
        else "States at fixed places: no error is stated; the law's errors on the check states tell."
    )
    return Table("How the states were chosen", [*head, "±u alike"], rows, note, numeric=2)


def coupling_table(data: ModuleData) -> Table | None:
    """How strongly the axes depend on each other; None for one axis."""
    found = data.sampling.get("coupling")
    if not isinstance(found, Mapping) or "largest" not in found:
        return None
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    first, second = (str(name) for name in found["between"])
    u = ", ".join(
        f"{axis} {u_unit.text(round(float(value), ROUNDED), 3)}"
        for axis, value in zip(data.axes, found["deformation"], strict=True)
    )
    place = f"{p_unit.text(float(found['actuation']))}; {u}"
    differ = found.get("pieces_differ")
    rows = [
        [
            "largest off-diagonal slope",
            f"{number(float(found['largest']), 3)} between {first} and {second}",
        ],
        ["found at", place],
        ["asymmetry of ∂τ/∂u", _tiny(float(found["largest_asymmetry"]))],
        ["free angle, piece of one axis against the whole", "–" if differ is None else _tiny(float(differ))],
        ["states of the whole module", str(found["n_states"])],
    ]
    note = (
        "Off-diagonal slopes ∂τᵢ/∂uⱼ by √(∂τᵢ/∂uᵢ ∂τⱼ/∂uⱼ): 0 for axes that do not know of each other. An energy makes "
        "the slopes symmetric, so their asymmetry is the solver's error."
    )
    return Table("Coupling of the axes", ["", "value"], rows, note, numeric=9)


def cost_table(data: ModuleData, backend: str) -> Table:
    """Mesh and effort."""
    rows = solved_rows(data)
    wall, steps = data.wall_s[rows], data.iterations[rows]
    table: list[Cells] = [["FEM code", backend or "–"]]
    pieces = data.sampling.get("pieces")
    for name, size in (pieces if isinstance(pieces, Mapping) else {}).items():
        label = {"main": "mesh", "full": "mesh of the whole module"}.get(str(name), str(name))
        table.append([label, f"{size['n_cells']} elements of 27 nodes, {size['n_nodes']} nodes"])
    table += [
        ["states solved", str(int(rows.sum()))],
        ["time of all states", seconds(float(wall.sum()))],
        ["time of a state", _mean_and_largest([float(w) for w in wall], seconds)],
        [
            "Newton steps of a state",
            _mean_and_largest([float(s) for s in steps], lambda s: number(s, 3)),
        ],
        ["Newton steps in all", str(int(steps.sum()))],
    ]
    return Table("Cost", ["", "value"], table, numeric=9)


def failed_table(data: ModuleData) -> Table | None:
    """States that were not reached, with their causes."""
    if not data.failed:
        return None
    rows: list[Cells] = [
        [*failed_place(entry, data), str(entry.get("cause", "–"))] for entry in data.failed[:LISTED]
    ]
    more = len(data.failed) - LISTED
    note = f"{more} more in the JSON result." if more > 0 else ""
    return Table("Failed states", ["actuation", "held", "cause"], rows, note, numeric=9)


def _counts(data: ModuleData, chosen: NDArray[np.bool_]) -> list[str]:
    trusted, check = np.isin(data.status, TRUSTED), data.role == "check"
    groups = (chosen & trusted & ~check, chosen & trusted & check, chosen & ~trusted)
    return [str(int(g.sum())) for g in groups]


def _span(values: NDArray[np.float64], unit: Unit) -> str:
    low, high = (number(float(v) * unit.factor, 4) for v in (values.min(), values.max()))
    return unit.attached(f"{low} to {high}")


def _share(value: Any) -> str:
    return "–" if value is None else percent(float(value))


def _tiny(value: float) -> str:
    return number(value, 2) if value else "0"


def _sides(record: Mapping[str, Any]) -> str:
    if "symmetric" not in record:
        return "–"
    apart = record.get("difference_of_sides")
    word = "yes" if record["symmetric"] else "no"
    return word if apart is None else f"{word} ({_tiny(float(apart))})"


def _mean_and_largest(values: Sequence[float], text: Any) -> str:
    if not values:
        return "–"
    return f"{text(sum(values) / len(values))} on average, {text(max(values))} at most"
