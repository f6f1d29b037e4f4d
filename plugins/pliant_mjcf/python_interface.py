"""`pliant.MjcfModel`: a MuJoCo model at a Python prompt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant import api
from pliant.interfaces.model import SystemModel
from pliant.notebook.compose import Block, ComposedStudy


def mjcf_model(
    file: str | Path,
    *,
    inputs: Mapping[str, Any] | None = None,
    outputs: Mapping[str, str] | None = None,
    initial: str | Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | Sequence[str] | None = None,
    number_error: float | None = None,
    effects: Sequence[Block] = (),
    measurements: Block | Path | None = None,
    name: str | None = None,
    store: str | Path = api.DEFAULT_STORE,
) -> ComposedStudy:
    """Return a study of a MuJoCo model; `compare`, `diagnose` and `improve` take recordings.

    Args:
        file: the MJCF.
        inputs: column → actuator, or ``{"actuator": …, "curve": [[0, 0], [50e3, 1.0]]}``; columns named after the
            actuators without it.
        outputs: column → sensor, joint or site; every sensor without it.
        initial: ``"first"``, ``"settled"``, a keyframe, or joint → position.
        fixed: actuators that are no columns, with their constant ctrl.
        number_error: share by which each number of the file may be off; half a per cent by default, 0 for none.
        effects: effects in addition to the model, in this order.
        measurements: the recording, with its renames and units.
        name: of the study; the file's name without it.
        store: folder of cached results.

    Raises:
        UserError: the file cannot be read, or does not have what is named.

    >>> pendulum = store / "pendulum.xml"
    >>> _ = pendulum.write_text(
    ...     '<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/><geom size=".05" pos="0 0 -.5"/></body>'
    ...     '</worldbody><actuator><motor joint="hinge"/></actuator><sensor><jointpos joint="hinge"/></sensor></mujoco>'
    ... )
    >>> model = pliant.MjcfModel(pendulum, initial="settled", store=store)
    >>> model.config.model.kind
    'mjcf'
    """
    stated = {
        "inputs": inputs,
        "outputs": outputs,
        "initial": initial,
        "fixed": fixed,
        "number_error": number_error,
    }
    block = {
        "kind": "mjcf",
        "file": str(Path(file).resolve()),
        **{k: v for k, v in stated.items() if v is not None},
    }
    study = ComposedStudy(
        name or Path(file).stem, model=block, effects=effects, measurements=measurements, store=store
    )
    assert study.config.model is not None
    model: SystemModel = study.opened.context.build("model", study.config.model)
    assert model.inputs  # the file is read: its errors come before those of a recording
    return study
