"""The files of an improved MuJoCo model: the MJCF, its assets, its module, and the check file."""

from __future__ import annotations

import json
import types
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from pliant import __version__
from pliant.errors import UserError
from pliant.formatting import listed
from pliant.interfaces.model import Drive, Exported, Improved
from pliant.records.design import Array
from pliant_mjcf.export.comments import placed_comments, read_comments
from pliant_mjcf.export.mjcf_text import carry_files, element_words, mjcf_text, with_comments
from pliant_mjcf.export.module_text import module_text
from pliant_mjcf.export.native_inputs import FILTERS
from pliant_mjcf.export.written_model import Destination, WrittenModel
from pliant_mjcf.loaded import WritableModel
from pliant_mjcf.mjcf import changed_model
from pliant_mjcf.starts import STATE, hold_inputs, state_of

FORMAT = 1
# Largest difference of a replayed reading, as a share of the largest predicted one; of effects that agree to a sample.
SAME, SAMPLED = 1e-9, 0.01
SMALLEST = 1e-12  # of a reading that should be zero
ABOUT = (
    "What the study predicts of recorded runs, with its effects; SI units. The module next to this file replays them: "
    "python MODULE --check, or",
    "  import MODULE; run = json.load(open(THIS))['runs'][0]",
    "  seen = MODULE.replay(run['time_s'], run['commanded'], run['state'])",
    "  # seen[name] is run['readings'][name] within tolerance[name]",
    "commanded are the inputs by column, state is MuJoCo's mjSTATE_INTEGRATION at the start of the run.",
)


def export_files(system: WritableModel, improved: Improved, target: Path) -> Exported:
    """Write the files of a model with its effects into the folder of `target`, the MJCF, and return them.

    Effects of inputs that agree to a sample only stay in the module where they would differ by more than `SAMPLED`.

    Raises:
        UserError: the target is the study's own MJCF, or an effect cannot be written.
    """
    if target.resolve() == system.config.file.resolve():
        raise UserError(f"--out {target} is the study's own MJCF; give another name.")
    for native in (True, False):
        exported, differences = _write(system, improved, target, native)
        approximate = native and any(not place.exact for place in exported[1])
        if not differences or not approximate:
            break
    files, places = exported
    sentences = _sentences(files, places, improved, differences)
    acts = {
        effect.config.kind: _acts(place, files[1].name)
        for effect, place in zip(improved.effects, places, strict=True)
    }
    return Exported(files, acts, sentences)


def _write(
    system: WritableModel, improved: Improved, target: Path, native: bool
) -> tuple[tuple[tuple[Path, ...], list[Destination]], list[str]]:
    """Write all files; return them, where each effect is, and what the replay finds different."""
    written = WrittenModel(system.loaded.spec.copy(), system.loaded.inputs)
    written.write(improved.effects, improved.parts, native)
    copies = carry_files(written.spec, system.config.file, target)
    head = _head(system, improved)
    notes = [
        (key, words)
        for words, place in zip(improved.provenance, written.places, strict=True)
        for key in place.elements
    ]
    plain = mjcf_text(written.spec)
    top, kept = placed_comments(read_comments(system.config.file), plain)
    text = with_comments(plain, [*head, *top], [*kept, *notes])
    target.write_text(text, encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(target))
    script, check = target.with_suffix(".py"), target.with_suffix(".check.json")
    script.write_text(
        module_text(
            written, model, system.loaded.outputs, system.config.fixed, target.name, script.name, head
        ),
        encoding="utf-8",
    )
    names = [one.channel.name for one in written.inputs]
    exact = all(place.exact for place in written.places)
    runs = [
        {
            "run": drive.history.run,
            "time_s": np.asarray(drive.history.time_s).tolist(),
            "commanded": {name: drive.history.actuation[name].tolist() for name in names},
            "state": _started(system, improved, written, model, drive).tolist(),
            "readings": {name: np.asarray(values).tolist() for name, values in readings.items()},
        }
        for drive, readings in zip(improved.drives, improved.predicted, strict=True)
    ]
    whole = {
        "pliant_check": FORMAT,
        "about": [line.replace("MODULE", script.stem).replace("THIS", repr(check.name)) for line in ABOUT],
        "study": improved.study,
        "pliant": __version__,
        "mujoco": mujoco.__version__,
        "tolerance": _tolerance(improved.predicted, SAME if exact else SAMPLED),
        "runs": runs,
    }
    check.write_text(json.dumps(whole) + "\n", encoding="utf-8")
    return ((target, script, check, *copies), written.places), _replayed(script, check)


def _replayed(script: Path, check: Path) -> list[str]:
    """Return what the module's own check finds different."""
    module = types.ModuleType(script.stem)
    module.__file__ = str(script.resolve())
    exec(compile(script.read_text(encoding="utf-8"), str(script), "exec"), vars(module))
    return list(module.check(check))


def _tolerance(predicted: Sequence[Mapping[str, Array]], share: float) -> dict[str, float]:
    names = predicted[0] if predicted else ()
    return {
        name: share * max(max(float(np.nanmax(np.abs(one[name]))) for one in predicted), SMALLEST / share)
        for name in names
    }


def _started(
    system: WritableModel, improved: Improved, written: WrittenModel, model: Any, drive: Drive
) -> Array:
    """Return the start of a run as a state of the exported model: positions and velocities are those of the study."""
    parts = improved.parts
    for effect in improved.effects:
        parts = effect.apply(parts)  # type: ignore[arg-type,assignment]
    own = changed_model(system.config.file, system.loaded.spec, system.loaded.model, parts.changes)
    there, here = mujoco.MjData(own), mujoco.MjData(model)
    start = system.start(own, Drive(parts.commanded(drive.history), drive.first))
    mujoco.mj_setState(own, there, start, STATE)
    left = improved.parts.with_(inputs=tuple(written.input_maps))
    control = system.control(Drive(left.commanded(drive.history), drive.first))
    here.qpos[:], here.qvel[:] = there.qpos, there.qvel
    hold_inputs(model, here, control[0])
    for k in range(own.nu):
        # a filter's activation is that of the exported actuator's own command
        if own.actuator_actadr[k] >= 0 and (int(own.actuator_dyntype[k]) not in FILTERS or own.nkey):
            size = np.arange(own.actuator_actnum[k])
            here.act[model.actuator_actadr[k] + size] = there.act[own.actuator_actadr[k] + size]
    here.qacc_warmstart[:] = there.qacc_warmstart
    return state_of(model, here)


def _head(system: WritableModel, improved: Improved) -> list[str]:
    """Return the lines on where the files come from."""
    return [
        f"{system.config.file.name} with the effects of study '{improved.study}', written by Pliant {__version__} on "
        f"{date.today().isoformat()}.",
        *(improved.provenance or ("The study has no effects.",)),
    ]


def _acts(place: Destination, script: str) -> str:
    """Return where an effect is written."""
    there = [element_words(key) for key in place.elements]
    if not there and not place.module:
        return "changes nothing"
    near = "" if place.exact else ", to the spacing of the samples"
    return " and ".join([*([listed(there) + near] if there else []), *([script] if place.module else [])])


def _sentences(
    files: Sequence[Path], places: Sequence[Destination], improved: Improved, differences: Sequence[str]
) -> tuple[str, ...]:
    """Return how to use the files, and whether they do what the study predicts."""
    script = files[1].stem
    use = (
        f"MJCF cannot say all of it: step with {script}.Robot(model, data).step(ctrl) instead of mujoco.mj_step."
        if any(place.module for place in places)
        else f"The MJCF has all of it; {script}.py is for recordings only."
    )
    if not improved.drives:
        return (use,)
    n = f"{len(improved.drives)} recorded run{'s' if len(improved.drives) > 1 else ''}"
    if differences:
        return use, f"In plain MuJoCo it does not do what the study predicts: {differences[0]}."
    return use, f"In plain MuJoCo it does what the study predicts of {n}: python {files[1].name} --check."
