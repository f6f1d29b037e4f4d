"""The planner of an experiment: repeats of a first condition, then the run with the most information per minute."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.pipeline.study import build_study_chain
from pliant.records.measurement import Measurement
from pliant_bench.bench import Bench
from pliant_bench.config import ExperimentConfig
from pliant_bench.loop.rounds import Choice
from pliant_bench.protocol_space import ProtocolSpace


def model_inputs(opened: api.OpenStudy) -> tuple[str, ...]:
    """Return the inputs of the study's model, by the names of their columns."""
    if opened.study.model is not None:
        return tuple(channel.name for channel in opened.context.build("model", opened.study.model).inputs)
    chain = build_study_chain(opened.context, opened.study).chain
    return tuple(dict.fromkeys(actuator.input for actuator in chain.actuators))


class RandomPlanner:
    """Random runs of the space, for a comparison."""

    def __init__(self, opened: api.OpenStudy, settings: ExperimentConfig, bench: Bench, seed: int) -> None:
        self.inputs = model_inputs(opened)
        self._space = ProtocolSpace.from_settings(settings, bench.inputs)
        self._settings, self._rng, self._seed = settings, np.random.default_rng(seed), seed

    def repeat(self, number: int) -> Choice:
        return self._choice(np.random.default_rng(self._seed), f"repeat_{number}")

    def next(self, data: Measurement, diagnosis: Diagnosis, setting: Mapping[str, float]) -> Choice | None:
        return self._choice(self._rng, "random")

    def _choice(self, rng: np.random.Generator, name: str) -> Choice:
        protocol = self._space.protocol(self._space.random(rng, self._settings.standing), name)
        return Choice(
            protocol, "a random run", None, protocol.duration_s / 60.0 + self._settings.set_up_minutes
        )
