"""The FEM of one design on a page: its module, its states, how they were chosen, what they cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pliant.records.fem import FemDataset, ModuleData
from pliant.report.document import Picture, Section, Table
from pliant.report.fem_reading import foretold_axes, solved_rows
from pliant.report.fem_tables import cost_table, coupling_table, failed_table, sampling_table, states_table
from pliant.report.figures.fem_cost import cost_picture
from pliant.report.figures.fem_sampling import sampling_picture
from pliant.report.figures.fem_states import states_picture
from pliant.report.figures.module_shape import can_show, module_shape
from pliant.report.figures.module_stress import has_stress, module_stress, stress_caption

SHOWN = 6  # designs whose pictures are drawn
IMAGES = {0: "the whole is solved", 1: "half is solved", 2: "a quarter is solved", 3: "an eighth is solved"}


@dataclass(frozen=True, eq=False)
class Solved:
    """The FEM data of a design, under its name; `backend` is the kind of the code that solved it."""

    name: str
    data: ModuleData
    backend: str = ""


def shape_section(designs: Sequence[tuple[str, FemDataset]]) -> Section | None:
    """Meshes at rest and deformed, and the stress, of designs whose data have shapes; None without any."""
    pictures = []
    for n, (name, data) in enumerate([d for d in designs if can_show(d[1])][:SHOWN]):
        link = (
            " The rigid links beside the flexure are not drawn."
            if data.actuation_name == "tendon_force_n"
            else ""
        )
        mirrors = data.shapes[0].mirrors
        images = IMAGES[len(mirrors)] + ("; the rest are mirror images." if mirrors else ".")
        caption = f"{name}: the mesh at rest and on the free branch, orthographic, one scale; {images}{link}"
        pictures.append(Picture(numbered("module_shape", n), caption, module_shape(data)))
        if has_stress(data):
            stress = Picture(numbered("module_stress", n), stress_caption(data), module_stress(data))
            pictures.append(stress)
    return Section("One module, undeformed and deformed", tuple(pictures)) if pictures else None


def data_sections(designs: Sequence[Solved], remark: str = "") -> list[Section]:
    """States, sampling and cost of each design; empty without any. `remark` ends the section of the states."""
    if not designs:
        return []
    shown = designs[:SHOWN]
    note = f"Pictures of the first {SHOWN} of {len(designs)} designs. " if len(designs) > SHOWN else ""
    states = Section(
        "The FEM data",
        tuple(
            Picture(numbered("fem_states", n), _states_caption(d), states_picture(d.data))
            for n, d in enumerate(shown)
        ),
        _named(designs, [(states_table(d.data), failed_table(d.data)) for d in designs]),
        (note + remark).strip(),
    )
    chosen = Section(
        "How the states were chosen",
        tuple(
            Picture(numbered("fem_sampling", n), _sampling_caption(d), sampling_picture(d.data))
            for n, d in enumerate(shown)
            if foretold_axes(d.data)
        ),
        _named(designs, [(sampling_table(d.data), coupling_table(d.data)) for d in designs]),
    )
    cost = Section(
        "What the FEM cost",
        tuple(
            Picture(
                numbered("fem_cost", n), _prefix(d, designs) + "Seconds as measured when it was solved.", p
            )
            for n, d in enumerate(shown)
            if solved_rows(d.data).any() and (p := cost_picture(d.data)) is not None
        ),
        _named(designs, [(cost_table(d.data, d.backend),) for d in designs]),
    )
    return [states, chosen, cost]


def numbered(name: str, number: int) -> str:
    """A picture's name in a page of several designs."""
    return name if number == 0 else f"{name}_{number + 1}"


def _named(designs: Sequence[Solved], tables: Sequence[Sequence[Table | None]]) -> tuple[Table, ...]:
    """All tables in a row; those of several designs carry their names."""
    found = []
    for design, some in zip(designs, tables, strict=True):
        for table in some:
            if table is not None:
                title = _prefix(design, designs) + table.title
                found.append(replace(table, title=title))
    return tuple(found)


def _prefix(design: Solved, designs: Sequence[Solved]) -> str:
    return f"{design.name}: " if len(designs) > 1 else ""


def _states_caption(design: Solved) -> str:
    word = "forces in N, extensions in mm" if design.data.joint == "prismatic" else "moments of one module"
    return f"{design.name}: every solved state; {word}. Thin lines join states of one actuation that are to be fitted."


def _sampling_caption(design: Solved) -> str:
    return (
        f"{design.name}. Left: blue with number = states chosen where the law was least certain, grey = free branch "
        "and corners, open = check states, cross = self-contact. Right: each new state against what was foretold of it."
    )
