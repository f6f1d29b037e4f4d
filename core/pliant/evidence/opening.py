"""Opening of what a study compares: its measurement, and its model driven by the measured runs."""

from __future__ import annotations

from pliant.config.study import Study
from pliant.errors import UserError
from pliant.evidence.driven_model import DrivenModel
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor, expected_ranges
from pliant.measurements.files import Sources, read_measurements
from pliant.measurements.system_reading import read_system_measurement
from pliant.pipeline.study import build_study_chain
from pliant.pipeline.workbench import RunContext
from pliant.records.measurement import Measurement
from pliant_tables.columns import is_frame


def measured_model(context: RunContext, study: Study, measurement: Measurement) -> MeasuredModel:
    """Return the study's model with its effects, driven by the measured runs.

    Raises:
        UserError: a model that cannot simulate histories, or no output that it has.
    """
    if study.model is not None:
        system = context.build("model", study.model)
        return DrivenModel(context, system, measurement, study.effects)
    return Predictor.from_study(context, study, measurement)


def read_study_measurement(context: RunContext, study: Study, data: Sources = None) -> Measurement:
    """Read the study's `measurements`, or `data` with the block's renames, units and sigmas.

    Several files, or a pattern for them, are read as one measurement, in their order: the block's renames, units and
    sigmas apply to all of them. If `data` are given, its exclusions apply to the first. `data` may also be pandas
    frames.

    The ranges that the model covers (its laws' domains, the chain's length) are used to detect a wrong unit.

    Raises:
        UserError: no file is named, or it cannot be read.
    """
    settings = study.measurements
    given = is_frame(data) or bool(data)
    if settings is None and not given:
        raise UserError(
            f"study '{study.name}' names no measurements; add 'measurements: {{file: bench.csv}}' "
            "to it (commands that compare or fit also take --data bench.csv)."
        )
    files = data if given or settings is None else settings.file
    if study.model is not None:
        system = context.build("model", study.model)
        return read_system_measurement(files, settings, system.inputs, system.outputs, context.progress)
    chain = build_study_chain(context, study).chain
    return read_measurements(
        files,
        settings,
        actuation=tuple(dict.fromkeys(actuator.input for actuator in chain.actuators)),
        expected=expected_ranges(chain),
        progress=context.progress,
        exclude_from_first=given,
    )
