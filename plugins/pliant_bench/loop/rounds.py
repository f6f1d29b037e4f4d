"""The closed loop: plan, run, record, diagnose, until the experiment ends.

Every step reads the folder and ends with one more file, so that a killed program resumes there: a run with a plan and
without a recording is recorded from its samples, or performed; a recording without a verdict is diagnosed.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.records.measurement import Measurement
from pliant.report.diagnosis import diagnosis_json
from pliant_bench.bench import BenchProtocol, BenchRecording
from pliant_bench.choose import Choice
from pliant_bench.config import ExperimentConfig
from pliant_bench.limits import check_protocol
from pliant_bench.loop.compared import write_compared
from pliant_bench.loop.decision import (
    Ended,
    budget_spent,
    nothing_to_tell,
    rounds_held,
    verdict_ends,
    verdict_holds,
)
from pliant_bench.loop.expectation import expect, expect_without_data
from pliant_bench.loop.experiment import Experiment, Situation
from pliant_bench.loop.fit_progress import DIAGNOSING
from pliant_bench.loop.folder import ExperimentFolder, RoundFolder
from pliant_bench.loop.information import obtained_nats
from pliant_bench.loop.perform import STOP_BUTTON, perform, record_from_samples
from pliant_bench.plans import history_from_columns
from pliant_bench.watchdog import Expectation

# Runs that a watchdog may stop one after the other before the experiment ends.
MOST_STOPPED = 3
# A rival of a verdict has had its chance after so many runs that would have shown it; a single one may miss a weak one.
ENOUGH_RUNS = 2
GOES_ON = "The same command goes on once the bench answers."
# Seconds between two looks at the stop button while the specimen rests.
REST_STEP_S = 0.2


def run_rounds(experiment: Experiment) -> Ended:
    """Do rounds until the experiment ends; resumes what is on disk.

    Raises:
        KeyboardInterrupt: after the bench has vented; what was recorded is on disk.
        UserError: the bench does not answer, or a run exceeds its limits.
    """
    experiment.bench.study_limits = experiment.settings.input_limits
    recover(experiment.folder)
    experiment.bench.resume([one.read_recording() for one in experiment.folder.rounds() if one.is_recorded])
    latest: tuple[int, Diagnosis] | None = None
    recordings: list[BenchRecording] = []
    while True:
        rounds = experiment.folder.rounds()
        last = rounds[-1] if rounds else None
        if experiment.folder.stop_file.exists():
            return Ended("stopped", STOP_BUTTON)
        if last is not None and not last.is_recorded:
            recordings.append(_perform(experiment, last, latest[1] if latest else None))
            if (ended := _stopped(recordings)) is not None:
                return ended
            if recordings[-1].ending == "lost":
                if not _reconnected(experiment, last):
                    return Ended("bench", f"{recordings[-1].reason} {GOES_ON}")
                _plan_again(experiment, last)
            continue
        repeats = sum(_is_complete_repeat(one) for one in rounds)
        if repeats < experiment.settings.first_repeats:
            _plan(experiment, experiment.planner.repeat(repeats + 1), "repeat")
            continue
        assert last is not None
        if last.read("verdict") is None:
            latest = (last.number, _diagnose(experiment, rounds))
        verdicts = [one for folder in rounds if (one := folder.read("verdict")) is not None]
        if (end := last.read("end")) is not None:
            return verdict_ends(verdicts, end["why"])
        holds = verdict_holds(verdicts, experiment.settings)
        spent = sum(run_minutes(one) for one in rounds)
        if (over := budget_spent(len(rounds), spent, experiment.settings, holds)) is not None:
            return over
        if latest is None or latest[0] != last.number:  # resumed after a verdict
            latest = (last.number, _diagnose(experiment, rounds))
        left = experiment.settings.minutes - spent
        experiment.folder.write_status(doing="planning", run=last.number, since=time.time())
        now = situation(rounds, experiment.settings, _measurement(experiment), latest[1], left)
        choice = experiment.planner.next(now)
        if holds and choice.protocol is None:
            last.write("end", {"why": choice.why})
            continue
        if choice.protocol is None or not choice.splits:
            return nothing_to_tell(choice.purpose == "decide", verdicts[-1])
        _plan(experiment, choice, "chosen")


def situation(
    rounds: Sequence[RoundFolder],
    settings: ExperimentConfig,
    data: Measurement,
    diagnosis: Diagnosis,
    minutes_left: float,
) -> Situation:
    """Return what a planner chooses the next run from: readings, diagnosis, and runs since the verdict was reached."""
    judged = [one for one in rounds if one.read("verdict") is not None]
    verdicts = [one.read("verdict") or {} for one in judged]
    held = rounds_held(verdicts)
    since = [one.read("plan") or {} for one in judged[len(judged) - held + 1 :] if _is_complete(one)]
    shown = Counter(kind for plan in since for kind in plan.get("exposes", ()))
    return Situation(
        data,
        diagnosis,
        [one.read_recording() for one in rounds],
        minutes_left,
        frozenset(kind for kind, count in shown.items() if count >= ENOUGH_RUNS)
        if verdict_holds(verdicts, settings)
        else None,
        any(plan["purpose"] == "repeat" for plan in since),
    )


def recover(folder: ExperimentFolder) -> None:
    """Write the recordings of runs that were cut off, from their samples."""
    folder.stop_file.unlink(missing_ok=True)
    for one in folder.rounds():
        if not one.is_recorded and one.samples.exists():
            record_from_samples(one)


def setting(rounds: Sequence[RoundFolder]) -> dict[str, float]:
    """Return the conditions that a person set last."""
    plan = rounds[-1].read("plan") if rounds else None
    return {} if plan is None else {**plan.get("setting", {}), **plan["conditions"]}


def _plan(experiment: Experiment, choice: Choice, kind: str) -> None:
    assert choice.protocol is not None
    rounds = experiment.folder.rounds()
    folder = experiment.folder.next_round()
    specimen = int((rounds[-1].read("plan") or {}).get("specimen", 1)) if rounds else 1
    plan = {
        "kind": kind,
        "why": choice.why,
        "expected_nats": choice.expected_nats if kind == "chosen" else None,
        "purpose": choice.purpose,
        "exposes": choice.exposes,
        "minutes": choice.minutes,
        "specimen": str(specimen + choice.protocol.new_specimen),
        "setting": experiment.settings.standing | setting(rounds),
    }
    named = BenchProtocol(
        f"run {folder.number:02d}",
        choice.protocol.words,
        choice.protocol.time_s,
        choice.protocol.commands,
        choice.protocol.conditions,
        choice.protocol.new_specimen,
    )
    folder.write_plan(named, plan)
    experiment.view.planned(folder, folder.read("plan") or {})


def _perform(experiment: Experiment, folder: RoundFolder, diagnosis: Diagnosis | None) -> BenchRecording:
    protocol, plan = folder.read_protocol(), folder.read("plan") or {}
    asked = {**plan["setting"], **plan["conditions"]}
    check_protocol(protocol, experiment.bench.limited_inputs)
    before = setting([one for one in experiment.folder.rounds() if one.number < folder.number])
    stands = experiment.settings.standing | before
    changes = {name: value for name, value in asked.items() if stands.get(name) != value}
    if changes or protocol.new_specimen:
        experiment.person.set_conditions(changes, protocol.new_specimen)
    expected = _expected(experiment, protocol, asked, diagnosis)
    folder.write_expected(expected, protocol.time_s)
    _rest(experiment, folder)
    experiment.view.begins(protocol, expected)
    experiment.folder.write_status(doing="running", run=folder.number, since=time.time())
    recording = perform(
        experiment.bench,
        BenchProtocol(
            protocol.name, protocol.words, protocol.time_s, protocol.commands, asked, protocol.new_specimen
        ),
        experiment.folder,
        folder,
        experiment.watches(protocol, expected, diagnosis is not None),
    )
    experiment.view.recorded(folder, folder.read("recording") or {})
    return recording


def _reconnected(experiment: Experiment, folder: RoundFolder) -> bool:
    """Connect again after a lost connection; return whether the bench answers."""
    experiment.folder.write_status(doing="reconnecting", run=folder.number, since=time.time())
    experiment.view.reconnecting(folder)
    return experiment.bench.reconnect()


def _plan_again(experiment: Experiment, folder: RoundFolder) -> None:
    """Plan the run that a lost connection cut short once more."""
    plan = folder.read("plan") or {}
    why = f"Run {folder.number} was cut short by a lost connection; it is repeated."
    nats, minutes = plan["expected_nats"] or 0.0, plan["minutes"]
    shown = tuple(plan.get("exposes", ()))
    choice = Choice(folder.read_protocol(), plan["purpose"], why, nats, minutes, exposes=shown)
    _plan(experiment, choice, plan["kind"])


def _rest(experiment: Experiment, folder: RoundFolder) -> None:
    """Wait until the specimen of a bench has been at rest for the time of setting up; the stop button ends the wait."""
    earlier = [
        one.path / "recording.json" for one in experiment.folder.rounds() if one.number < folder.number
    ]
    if not experiment.bench.is_hardware or not earlier:
        return
    until = earlier[-1].stat().st_mtime + 60.0 * experiment.settings.set_up_minutes
    experiment.folder.write_status(doing="resting", run=folder.number, since=time.time())
    while (left := until - time.time()) > 0.0 and not experiment.folder.stop_file.exists():
        time.sleep(min(left, REST_STEP_S))


def _expected(
    experiment: Experiment, protocol: BenchProtocol, asked: Mapping[str, float], diagnosis: Diagnosis | None
) -> Expectation:
    names = experiment.inputs
    history = history_from_columns(protocol.name, protocol.time_s, {**asked, **protocol.commands}, names)
    if diagnosis is not None:
        return expect(experiment.opened, _measurement(experiment), diagnosis, history)
    outputs = tuple(channel.name for channel in experiment.bench.outputs)
    return expect_without_data(experiment.opened, outputs, history)


def _diagnose(experiment: Experiment, rounds: Sequence[RoundFolder]) -> Diagnosis:
    """Diagnose all recordings, and write the verdict unless it is there."""
    last = rounds[-1]
    earlier = next((one for f in reversed(rounds[:-1]) if (one := f.read("verdict")) is not None), None)
    progress = experiment.progress(DIAGNOSING, earlier)
    diagnosis = api.diagnose(
        experiment.opened,
        _measurement(experiment),
        kinds=experiment.kinds,
        tick=progress.tick,
        workers=experiment.workers,
    )
    write_compared(diagnosis, rounds)
    if last.read("verdict") is None:
        verdict = diagnosis_json(diagnosis)
        last.write(
            "verdict",
            {
                **verdict,
                "sentence": diagnosis.judgement.sentence,
                "obtained_nats": obtained_nats(earlier, verdict),
                "wall_s": diagnosis.wall_s,
                "fits": progress.done,
            },
        )
    experiment.view.diagnosed(last, last.read("verdict") or {})
    return diagnosis


def _measurement(experiment: Experiment) -> Measurement:
    return api.read_measurement(experiment.opened, experiment.folder.recordings())


def _stopped(recordings: Sequence[BenchRecording]) -> Ended | None:
    """Return the end after the stop button, or after several runs in a row that were cut short."""
    if recordings[-1].reason == STOP_BUTTON:
        return Ended("stopped", STOP_BUTTON)
    last = recordings[-MOST_STOPPED:]
    if len(last) == MOST_STOPPED and all(one.ending != "complete" for one in last):
        return Ended("bench", f"{MOST_STOPPED} runs were cut short one after the other: {last[-1].reason}")
    return None


def _is_complete(folder: RoundFolder) -> bool:
    return (folder.read("recording") or {}).get("ending") == "complete"


def _is_complete_repeat(folder: RoundFolder) -> bool:
    return (folder.read("plan") or {}).get("kind") == "repeat" and _is_complete(folder)


def run_minutes(folder: RoundFolder) -> float:
    """Return the minutes of bench time that a run took, or is planned to take."""
    recording = folder.read("recording") or {}
    return float(recording.get("minutes", (folder.read("plan") or {})["minutes"]))
