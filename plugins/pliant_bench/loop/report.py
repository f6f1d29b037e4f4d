"""The report of an experiment, run by run: its reason, its expected and its obtained information."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pliant.formatting import listed, output_unit, plural, whole_percent
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Section,
    Table,
    Warned,
    as_json,
    brief_table,
    drawn,
    page_table,
    picture,
    section,
)
from pliant_bench.loop.compared import fall_of_error
from pliant_bench.loop.decision import Ended
from pliant_bench.loop.folder import ExperimentFolder, RoundFolder
from pliant_bench.loop.improving import ImprovedStudy
from pliant_bench.loop.report_charts import hypothesis, probability_chart, read_outputs, runs_chart
from pliant_bench.loop.terminal import bits

PREDICTED = (
    "Readings, and what the study's model reads with and without the explanation of the last diagnosis. Bands: two "
    "standard deviations, of the noise and, with the explanation, of its parameters. Below: the errors, measured minus "
    "model."
)
MOST_RUNS = 12


@dataclass(frozen=True)
class RunStory:
    """One run with its plan, its recording and the verdict after it."""

    number: int
    plan: Mapping[str, Any]
    recording: Mapping[str, Any]
    verdict: Mapping[str, Any] | None

    @staticmethod
    def from_folder(folder: RoundFolder) -> RunStory:
        """Return the story of a run that has been recorded."""
        return RunStory(
            folder.number, folder.read("plan") or {}, folder.read("recording") or {}, folder.read("verdict")
        )

    @property
    def leading(self) -> tuple[str, float] | None:
        """Return the most probable explanation and its probability; None before the first diagnosis."""
        if self.verdict is None:
            return None
        first = self.verdict["hypotheses"][0]
        return hypothesis(first["kinds"]), float(first["probability"])

    @property
    def obtained_nats(self) -> float | None:
        """Return the information that the run gave; None where it is unknown."""
        return None if self.verdict is None else self.verdict["obtained_nats"]


WORDS: tuple[Column[RunStory], ...] = (
    Column("number", head="run"),
    Column("recording.words", "run", head="what was done"),
    Column("plan.why", head="why"),
    Column("recording.ending", "ending", head="ending"),
)
NUMBERS: tuple[Column[RunStory], ...] = (
    Column("number", head="run", brief="run"),
    Column("recording.minutes", "minutes", head="min", brief="min", show=lambda m: f"{m:.2g}"),
    Column("plan.expected_nats", head="expected", brief="expected", show=bits),
    Column("obtained_nats", head="obtained", brief="obtained", show=bits),
    Column("verdict.verdict", head="verdict after it"),
    Column(
        "leading",
        head="most probable",
        brief="most probable",
        show=lambda lead: f"{lead[0]}, {whole_percent(lead[1])}",
    ),
    Column("recording.reason", "reason"),
    Column("recording.samples", "samples"),
    Column("recording.late", "late"),
)


def experiment_document(
    title: str, folder: ExperimentFolder, ended: Ended, minutes: float, improved: ImprovedStudy | None
) -> Document:
    """Return the document of an experiment that has ended; `improved` is the better study, if one was asked for."""
    stories = [RunStory.from_folder(one) for one in folder.rounds() if one.is_recorded]
    last = next((s.verdict for s in reversed(stories) if s.verdict is not None), None)
    verdict = "No verdict was reached." if last is None else last["sentence"]
    stopped = [s for s in stories if s.recording["ending"] != "complete"]
    end = f"{ended.sentence} {plural(len(stories), 'run')}, {minutes:.3g} min of bench time."
    return Document(
        kind=f"Pliant: an experiment · {title}",
        title=verdict,
        sentence=end,
        data={
            "ended": ended.why,
            "reason": ended.sentence,
            "minutes": minutes,
            "verdict": None if last is None else last["verdict"],
            "selected": [] if last is None else last["selected"],
            "selected_class": [] if last is None else last.get("selected_class", []),
            "probabilities": {}
            if last is None
            else {hypothesis(h["kinds"]): h["probability"] for h in last["hypotheses"]},
            "parameters": {} if last is None else _leading(last).get("parameters", {}),
            "rmse_over_floor": None if last is None else _leading(last).get("rmse_over_floor"),
            "runs": [as_json((*WORDS, *NUMBERS), story) for story in stories],
            "recordings": [str(path) for path in folder.recordings()],
            "improved_study": None if improved is None or improved.path is None else str(improved.path),
            "improved": None if improved is None else improved.json(),
        },
        brief=(brief_table(NUMBERS, stories),),
        warnings=tuple(
            Warned(f"Run {s.number} was {s.recording['words']}. {s.recording['reason']}") for s in stopped
        ),
        closing=(
            verdict,
            *([] if last is None else _numbers(last)),
            end,
            *(improved.sentences if improved else ()),
            *([f"improved study {improved.path}"] if improved and improved.path else []),
            f"recordings {folder.path}/run_*/recording_*.csv",
        ),
        draw=partial(_drawn, stories, folder, improved),
        footer=f"Recordings: {listed([p.parent.name for p in folder.recordings()])} in {folder.path}",
    )


def _leading(verdict: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the most probable hypothesis of a diagnosis that is a listed one."""
    listed_ones = [one for one in verdict["hypotheses"] if one["kinds"] != ["unknown"]]
    first: Mapping[str, Any] = listed_ones[0]
    return first


def _numbers(verdict: Mapping[str, Any]) -> list[str]:
    """Return the parameters of the leading explanation and its error, in a sentence each."""
    first = _leading(verdict)
    name = hypothesis(first["kinds"])
    values = [
        f"{key} {one['value']:.4g} ± {one['sd']:.2g} {one['unit']}".strip()
        for key, one in first.get("parameters", {}).items()
        if one.get("value") is not None and one.get("sd") is not None
    ]
    over = first.get("rmse_over_floor")
    said = [f"With {name}: {', '.join(values)}."] if values else []
    said += [] if over is None else [f"Its error on runs left out is {over:.3g} times the noise."]
    return said


def _drawn(stories: Sequence[RunStory], folder: ExperimentFolder, improved: ImprovedStudy | None) -> Drawn:
    rounds = [one for one in folder.rounds() if one.recording.exists()]
    verdicts = {story.number: story.verdict for story in stories if story.verdict is not None}
    chances = picture(
        "probabilities", "Probability of the explanations after each run.", probability_chart(verdicts)
    )
    return drawn(
        _effect_picture(rounds),
        section("Probabilities", chances, open=True),
        _improved_section(improved),
        section(
            "Run by run",
            page_table("What was done", WORDS, stories, numeric=9),
            page_table(
                "What it told",
                NUMBERS,
                stories,
                "Expected and obtained: the fall of the entropy of the explanations' probabilities. Where one "
                "explanation is left, a run is expected to tell whether a further effect is missing, with even odds.",
            ),
            open=True,
        ),
        *(
            section(
                f"Predicted and measured: {output_unit(name).label}",
                picture(f"runs_{name}", PREDICTED, runs_chart(rounds[-MOST_RUNS:], name)),
            )
            for name in read_outputs(rounds)
        ),
    )


def _effect_picture(rounds: Sequence[RoundFolder]) -> Picture | None:
    """Return the run and the output in which the explanation lowers the error most."""
    falls = {(k, name): fall for k, one in enumerate(rounds) for name, fall in fall_of_error(one).items()}
    if not falls:
        return None
    k, name = max(falls, key=lambda key: falls[key])
    return picture("effect", PREDICTED, runs_chart([rounds[k]], name))


def _improved_section(improved: ImprovedStudy | None) -> Section | None:
    if improved is None:
        return None
    rows = [[one.name, "yes" if one.in_verdict else "no", one.why] for one in improved.added]
    table = Table("What it adds", ["block", "named by the verdict", "why"], rows, numeric=3)
    return Section("The improved study", (), (table,) if rows else (), "", improved.sentences, True)
