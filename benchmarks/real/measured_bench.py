"""A bench of `splits.yaml`: its study with a stated law, its notes, and how the law follows from training runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.real import splits
from benchmarks.real.splits import Part
from scipy.optimize import minimize_scalar

import pliant
from pliant.config.measurements import UNKNOWN, MeasurementsConfig
from pliant.evidence.alignment import Alignment, Turns, components
from pliant.evidence.prediction import Predictor
from pliant.measurements.files import read_measurements
from pliant.mechanics.kinematics import ChainGeometry, base_rotations, trajectory
from pliant.notebook.study import StudyHandle
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.measurement import Measurement


@dataclass(frozen=True)
class MeasuredBench:
    """One of the five.

    Attributes:
        name: of its folder and in `splits.yaml`.
        chain: the study without its measurements; {gain} and other numbers are placeholders in braces.
        notes: information that its files lack, by part if it depends on the files.
        fit: the numbers of `chain` from the training measurement.
        only: how the names of the files begin that the study is about.
    """

    name: str
    chain: str
    notes: Mapping[str, Any] | Callable[[Part], Mapping[str, Any]]
    fit: Callable[[MeasuredBench, Measurement], dict[str, float]]
    only: str = ""
    inputs: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)

    def files(self, part: Part = "train") -> list[Path]:
        """Return the files of a part."""
        return splits.files(self.name, part, self.only)

    def read(self, part: Part = "train") -> Measurement:
        """Return the runs of a part, read by the notes."""
        block = splits.block(self.name, part, self.said(part), self.only)
        settings = MeasurementsConfig.model_validate(block)
        return read_measurements(settings.file, settings, actuation=self.inputs or None)

    def said(self, part: Part = "train") -> Mapping[str, Any]:
        """Return the notes on the files of a part."""
        return self.notes(part) if callable(self.notes) else self.notes

    def text(self, numbers: Mapping[str, float], part: Part = "train", **notes: Any) -> str:
        """Return the study with these numbers, driven by the runs of a part."""
        block = splits.block(self.name, part, {**self.said(part), **notes}, self.only)
        chain = self.chain
        for key, value in numbers.items():
            chain = chain.replace("{" + key + "}", f"{value:.8g}")
        return f"{chain.strip()}\nmeasurements: {json.dumps(block)}\n"

    def study(self, folder: Path, numbers: Mapping[str, float] | None = None) -> StudyHandle:
        """Return the study of the training runs, its law fitted to them unless numbers are given."""
        chosen = self.fit(self, self.read()) if numbers is None else numbers
        path = folder / f"{self.name}.yaml"
        path.write_text(self.text(chosen), encoding="utf-8")
        return pliant.open(path, store=folder / "store")

    def judged(
        self, folder: Path, study: StudyHandle, numbers: Mapping[str, float], part: Part = "judge"
    ) -> StudyHandle:
        """Return the same model on the runs that judge, in the frame and with the zeros of the training runs."""
        notes = training_frame(study_predictor(study))
        path = folder / f"{self.name}_judged.yaml"
        path.write_text(self.text(numbers, part, **_with_zeros(self.said(part), notes)), encoding="utf-8")
        return pliant.open(path, store=folder / "store")


def study_predictor(study: StudyHandle) -> Predictor:
    """Return a study's model, driven by its measured runs."""
    from pliant.evidence.opening import read_study_measurement

    opened = study.opened
    return Predictor.from_study(
        opened.context, opened.study, read_study_measurement(opened.context, opened.study)
    )


def training_frame(predictor: Predictor) -> dict[str, Any]:
    """Return the notes that keep the frames and the zeros of all runs that were fitted; of each run they stay free."""
    from pliant.mechanics.rotations import quaternion_from_matrix

    measurement = predictor.measurement
    alignment, turns = Alignment.from_measurement(measurement), predictor.turns
    kept: dict[str, Any] = {}
    for session, one in zip(alignment.sessions, turns, strict=True):
        if one.positions is not None:
            kept[session.pattern] = [float(v) for v in quaternion_from_matrix(one.positions)]
        elif one.pairs is not None:
            kept[session.pattern] = f"{np.degrees(np.arctan2(one.pairs[0, 1], one.pairs[0, 0])):.9g} deg"
    plain = alignment.applied(predictor.unaligned(), own=False)
    free = [name for name, how in measurement.free_zeros.items() if how == "unknown"]
    misses = {
        name: np.concatenate(
            [m.outputs[name] - run[name] for m, run in zip(measurement.runs, plain, strict=True)]
        )
        for name in free
    }
    # by the names of the file: after an exchange of names, those of Pliant are other columns there
    called = measurement.headed
    zeros = {called.get(name, name): float(np.nanmean(miss)) for name, miss in misses.items()}
    return {"zero": zeros, **({"frame": {"turn": kept}} if kept else {})}


def in_the_world(measurement: Measurement, alignment: Alignment, turns: Sequence[Turns]) -> Measurement:
    """Return the positions of a measurement turned back from the cameras' frames, of runs of the same sessions."""
    names = [s.pattern for s in alignment.sessions]
    runs = []
    for run in measurement.runs:
        place = next((k for k, pattern in enumerate(names) if fnmatchcase(run.name, pattern)), None)
        turn = None if place is None else turns[place].positions
        outputs = dict(run.outputs)
        for name in run.outputs:
            parts = components(name)
            if turn is not None and name.endswith("_m") and len(parts) == 3 and name == parts[0]:
                seen = np.stack([run.outputs[part] for part in parts], axis=1) @ turn
                outputs |= dict(zip(parts, seen.T, strict=True))
        runs.append(run.with_outputs(outputs))
    return replace(measurement, runs=tuple(runs))


def _with_zeros(own: Mapping[str, Any], kept: Mapping[str, Any]) -> dict[str, Any]:
    stated = {name: value for name, value in dict(own.get("zero", {})).items() if value != UNKNOWN}
    zeros = {**stated, **kept.get("zero", {})}
    return {**kept, "zero": zeros}


def bend_gain(bench: MeasuredBench, measurement: Measurement, most: float) -> tuple[float, float]:
    """Return the gain g of u = g Σ aₖ eₖ that fits best, and the error: bends of each joint by the actuations' sum.

    eₖ is (0, cos φₖ, sin φₖ) for an actuator at φₖ about the chain; without weight that is the equilibrium of a law
    τ = k p − b u with g = k / b. The frame's turn and the zeros are those that fit best at each gain.
    """
    chain = _chain(bench)
    alignment = Alignment.from_measurement(measurement)

    def miss(gain: float) -> float:
        runs = alignment.applied(_bent(chain, measurement, gain))
        square = count = 0.0
        for run, measured in zip(runs, measurement.runs, strict=True):
            for name in measurement.outputs:
                if name in run:
                    there = np.isfinite(measured.outputs[name])
                    square += float(((run[name] - measured.outputs[name])[there] ** 2).sum())
                    count += float(there.sum())
        return float(np.sqrt(square / count))

    grid = most * np.geomspace(1e-3, 1.0, 25)
    best = grid[int(np.argmin([miss(g) for g in grid]))]
    found = minimize_scalar(miss, bounds=(best / 1.6, best * 1.6), method="bounded")
    return float(found.x), float(found.fun)


def _chain(bench: MeasuredBench) -> ChainModel:
    import tempfile

    from pliant.pipeline.study import build_study_chain

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chain.yaml"
        numbers = dict(bench.start)
        text = bench.chain
        for key, value in numbers.items():
            text = text.replace("{" + key + "}", f"{value:g}")
        path.write_text(text, encoding="utf-8")
        opened = pliant.open(path, store=Path(folder) / "store").opened
        return build_study_chain(opened.context, opened.study).chain


def _bent(chain: ChainModel, measurement: Measurement, gain: float) -> list[dict[str, Array]]:
    geometry = ChainGeometry.from_chain(chain)
    runs = []
    for run in measurement.runs:
        axis = np.zeros((len(run), 3))
        for actuator in chain.actuators:
            turn = np.array([0.0, np.cos(actuator.rotation_rad), np.sin(actuator.rotation_rad)])
            axis += actuator.sign * np.outer(run.input(actuator.input), turn)
        q = np.repeat((gain * axis)[:, None, :], geometry.n_joints, axis=1)
        bases = base_rotations(geometry.base_rotation, run.history.base_angles_rad)
        tips = trajectory(geometry, q, bases)[:, -1]
        total = q.sum(axis=1)
        read = {f"tip_{a}_m": tips[:, k] for k, a in enumerate("xyz")}
        read |= {f"curvature_{a}_1_per_m": total[:, k] / chain.length_m for k, a in ((1, "y"), (2, "z"))}
        runs.append(read)
    return runs
