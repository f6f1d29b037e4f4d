"""The measurement that a study is compared with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pliant.config.measurements import MeasurementsConfig
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.measurements.joining import together
from pliant.measurements.reading import read_measurement
from pliant.pipeline.study import chain_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.chain import ChainModel
from pliant.records.measurement import Measurement

POSITIONS = ("tip_x_m", "tip_y_m", "tip_z_m")


def measurement_of_study(
    bench: Workbench, study: Study, data: Path | Sequence[Path] | None = None
) -> Measurement:
    """Read the study's `measurements`, or `data` with the block's renames, units and sigmas.

    Several files are one measurement, in their order: the block's renames, units and sigmas hold for all of them, its
    exclusions for the first.

    The ranges that the model knows (its laws' domains, the chain's length) are used to notice a wrong unit.

    Raises:
        UserError: no file is named, or it cannot be read.
    """
    settings = study.measurements
    if settings is None and not data:
        raise UserError(
            f"study '{study.name}' names no measurements; add 'measurements: {{file: bench.csv}}' "
            "or give --data bench.csv."
        )
    files = [data] if isinstance(data, Path) else list(data or ())
    blocks = [settings] if settings is not None and not files else []
    for number, file in enumerate(files):
        given: dict[str, object] = {"file": str(file)} | ({"exclude": ()} if number else {})
        blocks.append(settings.model_copy(update=given) if settings else MeasurementsConfig(file=str(file)))
    chain = chain_of_study(bench, study).chain
    return together(
        [
            read_measurement(
                Path(block.file),
                settings=block,
                actuation=tuple(dict.fromkeys(actuator.input for actuator in chain.actuators)),
                expected=expected_ranges(chain),
                progress=bench.progress,
            )
            for block in blocks
        ]
    )


def expected_ranges(chain: ChainModel) -> Mapping[str, tuple[float, float]]:
    """Column → range in which the model expects it: inputs, angles and positions."""
    domains = [chain.laws[joint.law].domain for joint in chain.joints]
    low = float(min(np.min(domain.actuation) for domain in domains))
    high = float(max(np.max(domain.actuation) for domain in domains))
    ranges = {actuator.input: (low, high) for actuator in chain.actuators}
    reach = float(np.linalg.norm(chain.base_position_m)) + chain.length_m
    ranges |= dict.fromkeys(POSITIONS, (-reach, reach))
    if chain.laws[0].joint != "prismatic":
        bends = sum(float(np.max(np.abs(domain.deformation))) for domain in domains)
        ranges["angle_rad"] = (-bends, bends)
    return {name: span for name, span in ranges.items() if np.isfinite(span).all()}
