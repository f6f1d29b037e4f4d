"""What a meta-model is fitted to: the designs of the study's sweep, or those of a sweep's table."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.config.designs import sweep_designs
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.interfaces.meta_model import enough_to_score
from pliant.pipeline.meta_model.parameters import ROUNDING, is_number, material_parameters, parameters_of
from pliant.pipeline.sweep import sweep_study
from pliant.pipeline.sweep_records import SweepRun
from pliant.pipeline.workbench import Workbench
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.records.solved import SolvedDesigns
from pliant.tabular.fem_reading import read_labelled_designs


@dataclass(frozen=True, eq=False)
class Solved:
    """Solved designs and where they came from.

    Attributes:
        designs: what is fitted.
        inputs: name → key of the FEM artifacts, or digest of the table: what the meta-model's artifact is keyed by.
        source: in words, for people.
        left_out: designs of the sweep without data, and doubles that say the same.
    """

    designs: SolvedDesigns
    inputs: Mapping[str, str]
    source: str
    left_out: int = 0


def solved_designs(bench: Workbench, study: Study) -> Solved:
    """The designs of `meta_model.data`, else those of the study's sweep, which are solved first.

    Raises:
        UserError: no designs at all, or designs that do not belong together; see `assembled`.
    """
    config = study.need("meta_model", "a meta-model")
    family: FamilyConfig = study.need("family", "a meta-model")
    if config.data is not None:
        found = from_table(config.data, family.kind)
    elif study.sweep is not None:
        planned = sweep_designs(study)
        # before hours of FEM: not all of them may be possible, but there will not be more
        swept = planned[0].changes
        varied = [n for n in swept if len({repr(design.changes[n]) for design in planned}) > 1]
        enough_to_score(len(planned), varied, bench.build("meta_model", config).fewest)
        found = from_sweep(sweep_study(bench, study))
    else:
        raise UserError(
            "'meta_model' needs solved designs: give the study a 'sweep' block, or the table of one, "
            "'meta_model.data: fem.csv'."
        )
    _one_family(bench, family, study.material, found)
    return found


def from_sweep(run: SweepRun) -> Solved:
    """The designs of a sweep that have data.

    Raises:
        UserError: as `assembled`, and where none has data.
    """
    done = run.done()
    total = f"{len(run.outcomes)} design{'s' * (len(run.outcomes) > 1)}"
    if not done:
        cause = next((outcome.cause for outcome in run.outcomes if outcome.cause), "")
        raise UserError(f"none of the sweep's {total} could be solved, so there is nothing to fit: {cause}")
    kind = done[0].design.family.kind
    swept = list(done[0].design.changes)
    constants = [
        {**parameters_of(outcome.design.family), **material_parameters(outcome.design.material)}
        for outcome in done
    ]
    labels = [f"design {outcome.design.number}" for outcome in done]
    data = [outcome.data() for outcome in done]
    designs, doubles = assembled(kind, constants, data, labels, "the sweep", swept)
    inputs = {f"design{outcome.design.number}": outcome.key for outcome in done}
    missing = len(run.failed()) + len(run.refused())
    return Solved(designs, inputs, f"the sweep's {total}", missing + doubles)


def from_table(path: Path, family: str) -> Solved:
    """The designs of a sweep's table, which holds no name of a family: the study's says what its parameters are.

    Raises:
        UserError: as `assembled`, and for a table that cannot be read.
    """
    path = Path(path)
    read = read_labelled_designs(path)
    labels, data = [label for label, _ in read], [one for _, one in read]
    constants = [dict(one.design.parameters) for one in data]
    designs, doubles = assembled(family, constants, data, labels, str(path))
    digest = "sha256:" + hashlib.sha256(path.read_bytes()).hexdigest()
    return Solved(designs, {"data": digest}, str(path), doubles)


def assembled(
    family: str,
    constants: Sequence[Mapping[str, Any]],
    data: Sequence[ModuleData],
    labels: Sequence[str],
    place: str,
    swept: Sequence[str] = (),
) -> tuple[SolvedDesigns, int]:
    """Designs with all their parameters as one set, and how many doubles were dropped.

    Args:
        family: kind of the family.
        constants: all parameters of each design.
        data: of each.
        labels: how messages name each design.
        place: how messages name where they come from.
        swept: parameters that are known to vary; their values must be numbers.

    Raises:
        UserError: no parameter varies or one is no number; designs of different joints, axes or actuation; a design
            twice with different data.
    """
    _one_joint(data, labels, place)
    every = list(dict.fromkeys(name for one in constants for name in one))
    varied = [name for name in every if _varies([one.get(name) for one in constants])]
    for name in varied:
        for label, one in zip(labels, constants, strict=True):
            if not is_number(one.get(name)):
                given = "none" if one.get(name) is None else repr(one[name])
                raise UserError(
                    f"{place}, {label}: parameter '{name}' is {given}, but it varies between the designs, and a "
                    "meta-model takes numbers; give a table of designs that share it."
                )
    if not varied:
        what = (
            f"{' and '.join(swept)} {'has' if len(swept) == 1 else 'have'} one value each; add values to the sweep."
            if swept
            else "a meta-model needs columns of parameters, such as average_radius_m, that vary between designs."
        )
        raise UserError(f"{place}: the designs do not differ, so there is nothing to learn; {what}")
    values = np.array([[float(one[name]) for name in varied] for one in constants])
    keep = _without_doubles(values, data, labels, place)
    fixed = {name: constants[0][name] for name in every if name not in varied}
    designs = SolvedDesigns(family, tuple(varied), values[keep], fixed, tuple(data[i] for i in keep))
    return designs, len(data) - len(keep)


def _one_joint(data: Sequence[ModuleData], labels: Sequence[str], place: str) -> None:
    """All designs have the same joint, axes and actuation, and states that can be fitted."""
    for label, one in zip(labels, data, strict=True):
        for word, what in (("joint", "joint"), ("axes", "axes"), ("actuation_name", "actuation")):
            first, other = getattr(data[0], word), getattr(one, word)
            if first != other:
                raise UserError(
                    f"{place}: {what} of {label} is {_said(other)}, of {labels[0]} {_said(first)}; a meta-model is for "
                    "designs of one family with the same joint, axes and actuation."
                )
        if not np.any((one.role == "fit") & trusted(one)):
            raise UserError(
                f"{place}: {label} has no trusted state to fit (all overlap or are kept for checks); leave it out."
            )


def trusted(data: ModuleData) -> NDArray[np.bool_]:
    """(n,) whether nothing overlaps in a state, or what overlaps is let pass."""
    return np.isin(data.status, TRUSTED)


def _varies(values: Sequence[Any]) -> bool:
    """Whether a parameter differs between designs by more than the rounding of a table."""
    if all(is_number(value) for value in values):
        numbers = np.array(values, float)
        return bool(np.ptp(numbers) > ROUNDING * np.abs(numbers).max())
    return len({repr(value) for value in values}) > 1


def _said(value: Any) -> str:
    return value if isinstance(value, str) else ", ".join(value)


def _without_doubles(
    values: Array, data: Sequence[ModuleData], labels: Sequence[str], place: str
) -> list[int]:
    """The places of designs, each once."""
    first: dict[bytes, int] = {}
    for index, row in enumerate(np.round(values / np.abs(values).max(axis=0).clip(1e-300), 9)):
        earlier = first.setdefault(row.tobytes(), index)
        if earlier != index and not _same(data[earlier], data[index]):
            raise UserError(
                f"{place}: {labels[index]} has the parameters of {labels[earlier]} and other data; points that "
                "contradict each other cannot be fitted: keep one of them, or add the parameter in which they differ."
            )
    return sorted(first.values())


def _same(one: ModuleData, other: ModuleData) -> bool:
    """Whether two designs have the same states: same count, p and u, and efforts to 1 % of their range."""
    if len(one) != len(other):
        return False
    size = np.ptp(one.tau, axis=0) + 1e-300
    return bool(
        np.allclose(one.actuation, other.actuation)
        and np.allclose(one.deformation, other.deformation, atol=1e-2)
        and np.all(np.abs(one.tau - other.tau) <= 1e-2 * size)
    )


def _one_family(
    bench: Workbench, family: FamilyConfig, material: MaterialConfig | None, found: Solved
) -> None:
    """The designs are of the study's family: their parameters are its own, joint, axes and actuation too."""
    designs = found.designs
    own = parameters_of(family)
    known = [*own, *(material_parameters(material) if material is not None else ())]
    for name in designs.names:
        if name not in known and not name.startswith("material."):
            raise UserError(
                f"{found.source}: '{name}' varies between its designs, and it is not a parameter of the study's family "
                f"'{family.kind}'{closest(name, known)} Were the designs of another family?"
            )
    built: ActuatorFamily = bench.build("family", family)
    data = designs.data[0]
    said = (data.joint, data.axes, data.actuation_name)
    if said != (built.joint, built.axes, built.actuation):
        raise UserError(
            f"{found.source}: its designs have a {data.joint} joint with {_axes(data.axes)}, driven by "
            f"{data.actuation_name}; the study's family '{family.kind}' has a {built.joint} joint with "
            f"{_axes(built.axes)}, driven by {built.actuation}. Were the designs of another family?"
        )


def _axes(axes: Sequence[str]) -> str:
    return f"{'axis' if len(axes) == 1 else 'axes'} {', '.join(axes)}"
