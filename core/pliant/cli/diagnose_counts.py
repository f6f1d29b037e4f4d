"""`pliant diagnose` with a file of counts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.diagnosis.counts_candidates import effect_knobs, task_knobs
from pliant.diagnosis.counts_evidence import CountEvidence, count_evidence
from pliant.diagnosis.counts_verdict import judge_counts
from pliant.diagnosis.counts_words import (
    best_listed,
    counts_diagnosis_json,
    counts_headline,
    counts_why,
    told,
)
from pliant.diagnosis.table import UNKNOWN
from pliant.diagnosis.words import named
from pliant.errors import UserError
from pliant.evidence.counted_study import counted_study
from pliant.execution.executors import checked_workers
from pliant.formatting import number
from pliant.pipeline.workbench import Workbench
from pliant.report.diagnosis_words import probability_text
from pliant.report.stage import write_page

MOST_SHOWN = 12


def diagnose_counts_verb(
    here: Session,
    bench: Workbench,
    study: Study,
    data: Path | None,
    kinds: Sequence[str] | None,
    folder: Path,
    workers: int,
) -> None:
    """Scan the effects and the study's plausible ranges, weigh, say; the JSON and the page."""
    checked_workers(workers)
    counted = counted_study(study, data)
    ranges = study.measurements.plausible if study.measurements else ()
    knobs = [*effect_knobs(bench.registry, kinds), *task_knobs(counted, ranges)]
    if not knobs:
        raise UserError(
            "nothing to try: no effect has a strength, and 'measurements.plausible' names no number."
        )
    check_writable(folder)
    found = count_evidence(bench, counted, [(knob,) for knob in knobs], workers)
    judged = judge_counts(found)
    here.result.update(
        {
            "study": study.name,
            "data": counted.counts.source,
            "data_sha256": counted.counts.sha256,
            **counts_diagnosis_json(found, judged, bench.registry),
            "out": str(folder),
        }
    )
    here.say(_table(found))
    for remark in found.comparison.remarks:
        here.say(f"note: {remark}")
    sentences = [counts_headline(judged), *counts_why(found, judged)]
    for line in sentences:
        here.say(line)
    from pliant.report.counts import counts_diagnosis_page  # matplotlib takes a second to import

    made = counts_diagnosis_page(study.name, counted.counts, found, sentences, best_listed(found))
    page = write_page(folder, made.html, made.pictures)
    here.result["report"] = str(page)
    here.say(f"report   {page}")


def _table(found: CountEvidence) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("hypothesis")
    for name in ("probability", "evidence", "best at", "still wrong"):
        table.add_column(name, justify="right", no_wrap=True)
    for kinds in list(found.probability)[:MOST_SHOWN]:
        row = found.rows.get(kinds)
        best = told(row).rpartition(kinds[0] + " ")[2] if row is not None and kinds else ""
        wrong = "" if kinds == UNKNOWN else str(len(found.comparisons[kinds].disagreeing))
        probability = probability_text(found.probability[kinds])
        table.add_row(named(kinds), probability, number(found.log_evidence[kinds], 3), best, wrong)
    return table
