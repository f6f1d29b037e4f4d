"""Studies for a recording: a base study with these measurements, or a skeleton of one joint."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.loading import load_study
from pliant.config.writing import StudyDraft, study_name_from_path
from pliant.measurements.block import advised, block_text, with_files
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry
from pliant.store.store import write_atomically

JOINT = re.compile(r"joint_(\d+)_angle_rad")
DRIVEN = {"tendon_force": ("tendon_force_n", "N"), "tendon_travel": ("tendon_travel_m", "m")}
SKELETON = """\
# A study of {source}, written by 'pliant import'.
# Fill in the three lines that have an arrow, check 'base' and 'gravity', then: pliant compare {target}
pliant: 1
name: {name}

surrogate:             # the law of one joint: {moment} = k_n · input − b_e · {coordinate}, in SI
  kind: polynomial
  form: study
  odd: true
  # k_n: {moment} per input of the joint held straight; b_e: its stiffness without input. A recording without loads
  # tells their ratio alone. Both come from loads: 'pliant fit TABLE.csv --out DIR', with the columns {columns}
  # of FEM or a bench, prints how good a law is and writes a study with it; take its surrogate in place of this one.
{keys}  coefficients: {{k_n: , m_a: 0, m_e: 0, b_e: }}   # <- {coefficients}

chain:
  modules: {modules}
  module_length:       # <- of one module, e.g. 80 mm
  module_mass:         # <- of one module, e.g. 40 g
  # World: z up. 'direction' is the way from the base to the tip at rest: [0, 0, -1] hangs and bends towards +x,
  # [1, 0, 0] lies and bends upwards ('roll: 180 deg' beside it: downwards), [0, 1, 0] lies and bends sideways.
  base: {{direction: [0, 0, -1]}}
  gravity: [0, 0, -9.81]   # m/s²; [0, 0, 0] where it bends in the plane of a table
{actuators}
physics: quasistatic

{block}"""


def write_study(
    target: Path,
    measurement: Measurement,
    block: Mapping[str, Any],
    base: Path | None,
    registry: Registry,
) -> None:
    """Write a study with these measurements.

    Args:
        target: the new file; paths in it are relative to its folder.
        measurement: what was read.
        block: keys of `measurements`; its files relative to the current folder.
        base: the study to extend; without one a skeleton is written, with three lines to fill in.
        registry: the installed plugins.

    Raises:
        UserError: the base cannot be read, or does not read back with these measurements.
    """
    if base is None:
        text = block_text(with_files(block, target.resolve().parent), advised(measurement.remarks))
        write_atomically(target.resolve(), skeleton(target, measurement, text))
        return
    whole = with_files(block)
    overrides = ["measurements=null", f"measurements={json.dumps(whole)}"]
    meant = load_study(base, registry, overrides, note=lambda _: None).canonical()
    draft = StudyDraft(base)
    draft.set(("measurements",), whole)
    meant["name"] = draft.name_after(target)
    draft.write(target, meant, registry, head="\n".join(doubt.sentence for doubt in measurement.doubts))


def skeleton(target: Path, measurement: Measurement, block: str) -> str:
    """Return a study with as many equal joints as the recording has joint angles, with a stated law."""
    inputs = list(measurement.runs[0].history.actuation)
    joints = [int(match[1]) for name in measurement.outputs if (match := JOINT.fullmatch(name))]
    slides = bool({"elongation_strain", "extension_m"} & set(measurement.outputs))
    driven, driver = next(
        (named for stem, named in DRIVEN.items() if inputs[0].startswith(stem)), ("pressure_pa", "Pa")
    )
    keys = {"joint: prismatic": slides, f"actuation_name: {driven}": driven != "pressure_pa"}
    effort, per = ("N", "m") if slides else ("N·m", "rad")
    words = f"k_n in {effort} per {driver}, b_e in {effort} per {per}{_ratio(measurement, inputs)}"
    signs = [f"    - {{input: {name}, sign: {1 - 2 * (k % 2)}}}\n" for k, name in enumerate(inputs)]
    return SKELETON.format(
        source=measurement.source,
        target=target,
        name=study_name_from_path(target) or "recording",
        keys="".join(f"  {key}\n" for key, needed in keys.items() if needed),
        coordinate="extension" if slides else "angle",
        moment="force" if slides else "moment",
        columns=", ".join((driven, *(("extension_m", "force_n") if slides else ("angle_rad", "moment_n_m")))),
        coefficients=words,
        modules=max(joints, default=1),
        actuators="  actuators:           # the sign says to which side each one bends\n" + "".join(signs)
        if len(inputs) > 1
        else "",
        block=block,
    )


def _ratio(measurement: Measurement, inputs: Sequence[str]) -> str:
    """Return what the recording implies about the two coefficients: the angle per input, through the origin."""
    if len(inputs) != 1 or "angle_rad" not in measurement.outputs:
        return ""
    driver = np.concatenate([run.input(inputs[0]) for run in measurement.runs])
    angle = np.concatenate([run.outputs["angle_rad"] for run in measurement.runs])
    free = np.concatenate([run.history.moment_n_m == 0 for run in measurement.runs]) & np.isfinite(angle)
    if not (driver[free] ** 2).sum() > 0:
        return ""
    slope = float((driver[free] * angle[free]).sum() / (driver[free] ** 2).sum())
    return f"; k_n / b_e is about {slope:.3g} here"
