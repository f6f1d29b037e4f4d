"""Names of a table's columns, by the joint's kind: docs/command_line.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from pliant.records.law import JointKind

ACTUATIONS = ("pressure_pa", "tendon_force_n")
TRAVELS = {"pressure_pa": "volume_change_m3", "tendon_force_n": "tendon_travel_m"}
LABELS = ("branch", "status", "role")
EFFORTS = ("iterations", "wall_s")  # of the solver
ALL = "all"  # axis of a state in which several are held
WORDS = {"axis": ("x", "y", "z", ALL), "branch": ("free", "constrained"), "role": ("fit", "check")}


@dataclass(frozen=True)
class Names:
    """Columns of u, τ and its slopes, in the order of the fields of `FemDataset`."""

    deformation: str
    effort: str
    by_actuation: str
    by_deformation: str

    @property
    def required(self) -> tuple[str, str]:
        """What every state needs beside the actuation."""
        return self.deformation, self.effort

    @property
    def optional(self) -> tuple[str, str, str]:
        """What may be missing."""
        return self.by_actuation, self.by_deformation, "energy_j"

    @property
    def numbers(self) -> dict[str, str]:
        """Column → field of `FemDataset`."""
        fields = ("angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du", "energy_j")
        return dict(zip((*self.required, *self.optional), fields, strict=True))

    def of_axes(self, axes: Sequence[str]) -> list[str]:
        """Columns of all axes: u, τ, ∂τ/∂p, then ∂τ_i/∂u_j row by row."""
        (u, u_unit), (m, m_unit) = (name.split("_", 1) for name in self.required)
        return [
            *(f"{u}_{i}_{u_unit}" for i in axes),
            *(f"{m}_{i}_{m_unit}" for i in axes),
            *(f"d{m}_{i}_dp" for i in axes),
            *(f"d{m}_{i}_du_{j}" for i in axes for j in axes),
        ]


REVOLUTE = Names("angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du")
PRISMATIC = Names("extension_m", "force_n", "dforce_dp", "dforce_du")
KNOWN = frozenset(
    (*ACTUATIONS, *TRAVELS.values(), *WORDS, *LABELS, *EFFORTS, *REVOLUTE.numbers, *PRISMATIC.numbers)
)
_OF_AXES = re.compile(
    r"(angle_[xyz]_rad|extension_[xyz]_m|moment_[xyz]_n_m|force_[xyz]_n|d(moment|force)_[xyz]_d(p|u_[xyz]))"
)


def names_of(joint: JointKind) -> Names:
    """The columns of a joint."""
    return PRISMATIC if joint == "prismatic" else REVOLUTE


def is_data(name: str) -> bool:
    """Whether a column holds data, so that it is no parameter of the design."""
    return name in KNOWN or _OF_AXES.fullmatch(name) is not None
