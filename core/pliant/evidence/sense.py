"""Whether the model moves the way the readings do: swapped inputs and reversed sensors are mistakes, not physics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pliant.formatting import unit_of
from pliant.records.design import Array
from pliant.records.measurement import Measurement

AGAINST = -0.5  # a correlation below it is no missing effect: it is a sign
FEWEST = 10


def sense_remarks(
    measurement: Measurement, predicted: Sequence[Mapping[str, Array]], names: Sequence[str]
) -> list[str]:
    """A sentence for each output whose readings go the other way than the model's."""
    found = []
    for name in names:
        pairs = [
            (run.outputs[name], model[name]) for run, model in zip(measurement.runs, predicted, strict=True)
        ]
        read, said = (np.concatenate([np.asarray(pair[k], float) for pair in pairs]) for k in (0, 1))
        there = np.isfinite(read) & np.isfinite(said)
        if there.sum() < FEWEST or np.ptp(read[there]) == 0.0 or np.ptp(said[there]) == 0.0:
            continue
        correlation = float(np.corrcoef(read[there], said[there])[0, 1])
        if correlation < AGAINST:
            found.append(
                f"The readings of {unit_of(name).label} go the other way than the model (correlation "
                f"{correlation:.2f}): before looking for an effect look at the sign of the "
                f"sensor{_swapped(measurement)}."
            )
    return found


def _swapped(measurement: Measurement) -> str:
    inputs = sorted({name for run in measurement.runs for name in run.history.actuation})
    if len(inputs) < 2:
        return ""
    return f", and at which chamber is which: {', '.join(inputs)} and their signs in 'chain.actuators'"
