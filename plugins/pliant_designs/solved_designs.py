"""Designs that a meta-model is fitted to, of the study's sweep or of a sweep's table, and their parameters.

Parameters are those of the family, and constants of the material as `material.…`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.config.design_parameters import (
    MATERIAL,
    design_parameters,
    is_number,
    same_value,
    shown,
    study_key,
)
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.fem_tables.reading import read_labelled_designs
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant_designs.meta_model import MetaModel, enough_to_score
from pliant_designs.records import Parameter, SolvedDesigns
from pliant_designs.sweep import SweepRun, sweep_study
from pliant_designs.sweep_designs import sweep_designs

# Of the width of the range: a design on its border is inside despite the rounding of its table.
ROUNDING = 1e-7


@dataclass(frozen=True, eq=False)
class SourcedDesigns:
    """Solved designs and their source.

    Attributes:
        designs: to be fitted.
        inputs: name → key of the FEM artifacts, or digest of the table, for the key of the meta-model's artifact.
        source: in words, for people.
        left_out: designs of the sweep without data, and duplicates.
    """

    designs: SolvedDesigns
    inputs: Mapping[str, str]
    source: str
    left_out: int = 0


def trusted(data: ModuleData) -> NDArray[np.bool_]:
    """Return (n,) whether a state has no overlap, or its overlap is allowed."""
    return np.isin(data.status, TRUSTED)


def scored_states(data: ModuleData) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return trusted states (n,), and for these (m, k) whether the effort about each axis is scored.

    A lateral axis is scored only in states that move it: those that explore it, or prescribe all axes.
    """
    keep = trusted(data)
    counts = np.isfinite(data.tau[keep])
    counts[:, [axis != data.main_axis for axis in data.axes]] &= (data.explored[keep] != data.main_axis)[
        :, None
    ]
    return keep, counts


def design_values(
    names: Sequence[str],
    box: Array,
    fixed: Mapping[str, Parameter],
    family: FamilyConfig,
    material: MaterialConfig | None,
    extrapolate: bool,
) -> Array:
    """Return (d,) values of one design for a meta-model.

    Args:
        names: its parameters.
        box: (d, 2) their range.
        fixed: parameters that all solved designs share.
        family, material: of the design.
        extrapolate: whether the design may be outside the range.

    Raises:
        UserError: the design lacks a parameter, is outside the range, or differs in a fixed parameter.
    """
    known = design_parameters(family, material)

    for name in names:
        if not is_number(known.get(name)):
            raise UserError(
                f"the meta-model's designs differ in '{name}', and family '{family.kind}' of this study has no such "
                "number; were they of another family?"
                if not name.startswith(MATERIAL)
                else f"the meta-model's designs differ in '{name}'; give the study a 'material' block that has it."
            )
    for name, value in fixed.items():
        own = known.get(name, value)
        if not same_value(own, value):
            bare = name.removeprefix("family.").removeprefix(MATERIAL)
            raise UserError(
                f"{study_key(name, family, material)} is {shown(name, own)}, and all solved designs of the meta-model "
                f"have {shown(name, value)}; use that, or sweep '{bare}' too."
            )
    values = np.array([float(known[name]) for name in names])
    for name, one, (low, high) in zip(names, values, box, strict=True) if not extrapolate else ():
        slack = ROUNDING * (high - low)
        if not low - slack <= one <= high + slack:
            raise UserError(
                f"{study_key(name, family, material)} is {shown(name, one)}, outside the meta-model's range "
                f"{shown(name, low)} to {shown(name, high)}; solve designs there, or set "
                "meta_model.extrapolate: true to use the law all the same."
            )
    return values


def solved_designs(context: RunContext, study: Study) -> SourcedDesigns:
    """Return the designs of `meta_model.data`, else those of the study's sweep after solving them.

    Raises:
        UserError: no designs, several actuations for a kind of one, or designs that do not belong together; see
            `assembled`.
    """
    config = study.need("meta_model", "a meta-model")
    family: FamilyConfig = study.need("family", "a meta-model")
    built: ActuatorFamily = context.build("family", family)
    model: MetaModel = context.build("meta_model", config)
    model.check_actuations(built.actuation)  # before hours of FEM
    if config.data is not None:
        found = from_table(config.data, family.kind)
    elif study.block("sweep") is not None:
        planned = sweep_designs(study)
        # before hours of FEM: an upper bound, since some designs may be impossible
        swept = planned[0].changes
        varied = [n for n in swept if len({repr(design.changes[n]) for design in planned}) > 1]
        enough_to_score(len(planned), varied, model.fewest)
        found = from_sweep(sweep_study(context, study))
    else:
        raise UserError(
            "'meta_model' needs solved designs: give the study a 'sweep' block, or the table of one, "
            "'meta_model.data: fem.csv'."
        )
    _one_family(context, family, study.material, found)
    return found


def from_sweep(run: SweepRun) -> SourcedDesigns:
    """Return the designs of a sweep that have data.

    Raises:
        UserError: as `assembled`, or if no design has data.
    """
    done = run.done()
    total = f"{len(run.outcomes)} design{'s' * (len(run.outcomes) > 1)}"
    if not done:
        cause = next((outcome.cause for outcome in run.outcomes if outcome.cause), "")
        raise UserError(f"none of the sweep's {total} could be solved, so there is nothing to fit: {cause}")
    planned = [outcome.design for outcome in done]
    constants = [design_parameters(design.family, design.material) for design in planned]
    labels = [f"design {design.number}" for design in planned]
    data, swept = [outcome.data() for outcome in done], list(planned[0].changes)
    designs, doubles = assembled(planned[0].family.kind, constants, data, labels, "the sweep", swept)
    inputs = {f"design{outcome.design.number}": outcome.key for outcome in done}
    missing = len(run.outcomes) - len(done)
    return SourcedDesigns(designs, inputs, f"the sweep's {total}", missing + doubles)


def from_table(path: Path, family: str) -> SourcedDesigns:
    """Return the designs of a sweep's table; it names no family, so its parameters are those of the study's family.

    Raises:
        UserError: as `assembled`, and for a table that cannot be read.
    """
    path = Path(path)
    labels, data = zip(*read_labelled_designs(path), strict=True)
    constants = [dict(one.design.parameters) for one in data]
    designs, doubles = assembled(family, constants, data, labels, str(path))
    digest = "sha256:" + hashlib.sha256(path.read_bytes()).hexdigest()
    return SourcedDesigns(designs, {"data": digest}, str(path), doubles)


def assembled(
    family: str,
    constants: Sequence[Mapping[str, Any]],
    data: Sequence[ModuleData],
    labels: Sequence[str],
    place: str,
    swept: Sequence[str] = (),
) -> tuple[SolvedDesigns, int]:
    """Return the designs with all their parameters as one set, and the number of dropped duplicates.

    Args:
        family: kind of the family.
        constants: all parameters of each design.
        data: of each.
        labels: name of each design in messages.
        place: name of their source in messages.
        swept: parameters that are known to vary; their values must be numbers.

    Raises:
        UserError: no parameter varies or one is not a number; designs of different joints, axes or actuation; a
            duplicate design with different data.
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
    first: dict[bytes, int] = {}
    for index, row in enumerate(np.round(values / np.abs(values).max(axis=0).clip(1e-300), 9)):
        earlier = first.setdefault(row.tobytes(), index)
        if earlier != index and not _same_states(data[earlier], data[index]):
            raise UserError(
                f"{place}: {labels[index]} has the parameters of {labels[earlier]} and other data; points that "
                "contradict each other cannot be fitted: keep one of them, or add the parameter in which they differ."
            )
    keep = sorted(first.values())
    fixed = {name: constants[0][name] for name in every if name not in varied}
    designs = SolvedDesigns(family, tuple(varied), values[keep], fixed, tuple(data[i] for i in keep))
    return designs, len(data) - len(keep)


def _one_joint(data: Sequence[ModuleData], labels: Sequence[str], place: str) -> None:
    """Check that all designs have the same joint, axes and actuation, and states that can be fitted."""
    for label, one in zip(labels, data, strict=True):
        for word, what in (("joint", "joint"), ("axes", "axes"), ("actuation_name", "actuation")):
            pair = getattr(one, word), getattr(data[0], word)
            if pair[0] != pair[1]:
                other, first = (v if isinstance(v, str) else ", ".join(v) for v in pair)
                raise UserError(
                    f"{place}: {what} of {label} is {other}, of {labels[0]} {first}; a meta-model is for "
                    "designs of one family with the same joint, axes and actuation."
                )
        if not np.any((one.role == "fit") & trusted(one)):
            raise UserError(
                f"{place}: {label} has no trusted state to fit (all overlap or are kept for checks); leave it out."
            )


def _varies(values: Sequence[Any]) -> bool:
    """Return whether a parameter differs between designs by more than the rounding of a table."""
    if all(is_number(value) for value in values):
        numbers = np.array(values, float)
        return bool(np.ptp(numbers) > ROUNDING * np.abs(numbers).max())
    return len({repr(value) for value in values}) > 1


def _same_states(one: ModuleData, other: ModuleData) -> bool:
    """Return whether two designs have the same states: count, p and u, and efforts to 1 % of their range."""
    return bool(
        len(one) == len(other)
        and np.allclose(one.actuation, other.actuation)
        and np.allclose(one.deformation, other.deformation, atol=1e-2)
        and np.all(np.abs(one.tau - other.tau) <= 1e-2 * (np.ptp(one.tau, axis=0) + 1e-300))
    )


def _one_family(
    context: RunContext, family: FamilyConfig, material: MaterialConfig | None, found: SourcedDesigns
) -> None:
    """Check that the designs match the study's family in parameters, joint, axes and actuation."""
    known = list(design_parameters(family, material))
    for name in found.designs.names:
        if name not in known and not name.startswith(MATERIAL):
            raise UserError(
                f"{found.source}: '{name}' varies between its designs, and it is not a parameter of the study's family "
                f"'{family.kind}'{closest(name, known)} Were the designs of another family?"
            )
    built: ActuatorFamily = context.build("family", family)
    data = found.designs.data[0]
    theirs, own = (data.joint, data.axes, data.actuation_name), (built.joint, built.axes, built.actuation)
    if theirs != own:
        said = [
            f"a {joint} joint with {'axis' if len(axes) == 1 else 'axes'} {', '.join(axes)}, driven by {drive}"
            for joint, axes, drive in (theirs, own)
        ]
        raise UserError(
            f"{found.source}: its designs have {said[0]}; the study's family '{family.kind}' has {said[1]}. "
            "Were the designs of another family?"
        )
