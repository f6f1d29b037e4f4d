"""Each run as the study's model predicts it and as the explanation does, after a diagnosis: means and bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import NOTHING
from pliant.diagnosis.next_run import information_matrix
from pliant.records.design import Array
from pliant_bench.loop.folder import RoundFolder, read_columns, write_columns

FILE = "compared"
# Columns of the file beside the time, each after the name of its output.
MEASURED, BEFORE, AFTER = "measured", "before", "after"


@dataclass(frozen=True, eq=False)
class ModelBand:
    """What a model reads over time: (t,) mean and standard deviation, with the noise of a reading, SI."""

    name: str
    time_s: Array
    mean: Array
    sd: Array


def explanation_name(kinds: Sequence[str]) -> str:
    """Return the name of a model with these effects, for a legend; empty for the study's own model."""
    return f"with {' + '.join(kinds)}" if kinds else ""


AS_IT_IS = "the study's model"


def write_compared(diagnosis: Diagnosis, rounds: Sequence[RoundFolder]) -> None:
    """Write for every run what was read, and what the study's model and the explanation read there."""
    by_name = {(one.read("plan") or {})["name"]: one for one in rounds}
    explained = diagnosis.fits[diagnosis.explained]
    is_law_off = diagnosis.law_off is not None
    before = diagnosis.fits[NOTHING].raw
    after = explained.residual if is_law_off else explained.raw
    noise = float(np.sqrt(max(diagnosis.noise.floor_square, 0.0))) if diagnosis.noise.judged else 1.0
    unpack = diagnosis.readings.unpack
    residuals = (unpack(before), unpack(after))
    widths = (unpack(np.full(len(before), noise)), unpack(np.sqrt(noise**2 + _spread(diagnosis, explained))))
    name = explanation_name(diagnosis.explained) or ("with its law corrected" if is_law_off else "")
    for k, run in enumerate(diagnosis.measurement.runs):
        folder, clock = by_name.get(run.name), run.history.time_s
        if folder is None or clock is None:
            continue
        columns = {"time_s": np.asarray(clock, float)}
        for output, measured in run.outputs.items():
            columns[f"{output} {MEASURED}"] = np.asarray(measured, float)
            for which, residual, sd in zip((BEFORE, AFTER), residuals, widths, strict=True):
                columns[f"{output} {which}"] = measured - residual[k][output]
                columns[f"{output} {which} sd"] = sd[k][output]
        write_columns(folder.path / f"{FILE}.csv", columns)
        folder.write(FILE, {"explanation": name, "after_run": rounds[-1].number})


def _spread(diagnosis: Diagnosis, fit: EffectFit) -> Array:
    """Return (N,) variance of the prediction by the parameters, and by the law's own error, over the noise floor."""
    slopes = fit.slopes if fit.law is None else np.column_stack([fit.slopes, fit.law.columns])
    if not slopes.shape[1]:
        return np.zeros(len(fit.residual))
    square = max(diagnosis.noise.floor_square, 1e-12) if diagnosis.noise.judged else 1.0
    known = information_matrix(fit, diagnosis.noise.n_effective, square)
    return np.asarray(np.einsum("nk,kl,nl->n", slopes, np.linalg.inv(known), slopes))


def read_bands(folder: RoundFolder) -> dict[str, tuple[ModelBand, ...]]:
    """Return by output the study's model and, if it is another one, the explanation; first what was read.

    Before the diagnosis of the run they are what was expected of it; without a reading so far there is no band.
    """
    compared, path = folder.read(FILE), folder.path / f"{FILE}.csv"
    if compared is not None and path.exists():
        return _bands(read_columns(path), compared["explanation"])
    expected = folder.read_expected()
    return _bands(expected, (folder.read("expected") or {}).get("explanation", "")) if expected else {}


def _bands(columns: Mapping[str, Array], explanation: str) -> dict[str, tuple[ModelBand, ...]]:
    clock, found = columns["time_s"], {}
    for column in columns:
        output, _, which = column.rpartition(" ")
        if which != BEFORE:
            continue
        models = [(AS_IT_IS, BEFORE), *([(explanation, AFTER)] if explanation else [])]
        found[output] = tuple(
            ModelBand(name, clock, columns[f"{output} {key}"], columns[f"{output} {key} sd"])
            for name, key in models
        )
    return found


def fall_of_error(folder: RoundFolder) -> dict[str, float]:
    """Return by output by how much the explanation lowers the RMS error of the run, SI; empty without a diagnosis."""
    path = folder.path / f"{FILE}.csv"
    if folder.read(FILE) is None or not path.exists():
        return {}
    columns = read_columns(path)

    def error(output: str, which: str) -> float:
        left = columns[f"{output} {MEASURED}"] - columns[f"{output} {which}"]
        there = left[np.isfinite(left)]
        return float(np.sqrt(np.mean(there**2))) if len(there) else 0.0

    outputs = [name.removesuffix(f" {MEASURED}") for name in columns if name.endswith(f" {MEASURED}")]
    return {name: error(name, BEFORE) - error(name, AFTER) for name in outputs}
