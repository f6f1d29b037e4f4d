"""The planner of an experiment: repeats of a first condition, then the run with the most information per minute."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pliant import api
from pliant.pipeline.study import build_study_chain
from pliant_bench.bench import Bench
from pliant_bench.choose import Choice, SearchEffort, choose_next, first_runs
from pliant_bench.config import ExperimentConfig
from pliant_bench.coverage import Coverage
from pliant_bench.loop.experiment import Situation
from pliant_bench.performed import performed
from pliant_bench.protocol_space import ProtocolSpace

CONTROL = "The first condition again: has the specimen changed since?"


def model_inputs(opened: api.OpenStudy) -> tuple[str, ...]:
    """Return the inputs of the study's model, by the names of their columns."""
    if opened.study.model is not None:
        return tuple(channel.name for channel in opened.context.build("model", opened.study.model).inputs)
    chain = build_study_chain(opened.context, opened.study).chain
    return tuple(dict.fromkeys(actuator.input for actuator in chain.actuators))


@dataclass(frozen=True)
class TellingPlanner:
    """Runs with the most expected information per minute; `settings` limits what a person is asked for."""

    opened: api.OpenStudy
    settings: ExperimentConfig
    bench: Bench
    effort: SearchEffort | None = None

    def repeat(self, number: int) -> Choice:
        """Return a repeat of the first condition."""
        return first_repeat(self.settings, self.bench)

    def next(self, now: Situation) -> Choice:
        """Return the most informative run; for a stable verdict one that could contradict it.

        The last run before an end is a control: the first condition again. Drift and ageing, which no candidate may
        predict, show there.
        """
        axes = ProtocolSpace.from_settings(self.settings, self.bench.inputs).axes
        envelopes = {name: one.limits(name) for name, one in self.settings.outputs.items()}
        choice = choose_next(
            self.opened,
            now.data,
            now.diagnosis,
            self.settings,
            [performed(one) for one in now.recordings],
            channels=self.bench.inputs,
            minutes_left=now.minutes_left,
            effort=self.effort,
            coverage=Coverage.from_recordings(axes, now.recordings, envelopes),
            met=now.met,
        )
        if choice.protocol is not None or now.controlled:
            return choice
        control = self._control(now)
        return control if control.minutes <= now.minutes_left else choice

    def _control(self, now: Situation) -> Choice:
        first = first_repeat(self.settings, self.bench)
        assert first.protocol is not None
        conditions = first.protocol.conditions
        standing = {name: now.recordings[-1].protocol.conditions.get(name) for name in conditions}
        to_set = {name: value for name, value in conditions.items() if value != standing[name]}
        minutes = first.minutes + self.settings.manual_minutes * len(to_set)
        return replace(first, why=CONTROL, minutes=minutes, to_set=to_set)


def first_repeat(settings: ExperimentConfig, bench: Bench) -> Choice:
    """Return a repeat of the first condition, from which the noise is learned."""
    protocol = first_runs(settings, bench.inputs)[0]
    minutes = protocol.duration_s / 60.0 + settings.set_up_minutes
    return Choice(protocol, "repeat", "Repeats of one condition show the noise of the bench.", 0.0, minutes)
