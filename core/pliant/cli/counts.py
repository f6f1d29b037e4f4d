"""`pliant compare` and `pliant diagnose` with a file of counts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.diagnosis.counts_diagnosis import count_evidence, effect_parameters, judge_counts, task_parameters
from pliant.errors import UserError
from pliant.evidence.counts import CountedStudy, compare_counted, counted_study
from pliant.execution.executors import checked_workers
from pliant.pipeline.workbench import Workbench
from pliant.report.counts import counts_diagnosis_document, counts_document


def compare_counts_verb(
    here: Session, bench: Workbench, study: Study, data: Path | None, folder: Path, workers: int
) -> None:
    """Every condition simulated and compared."""
    counted = _counted(here, study, data, workers)
    check_writable(folder)
    found = compare_counted(bench, counted, workers)
    here.show(counts_document(study.name, counted.counts, found), folder)


def diagnose_counts_verb(
    here: Session,
    bench: Workbench,
    study: Study,
    data: Path | None,
    kinds: Sequence[str] | None,
    folder: Path,
    workers: int,
) -> None:
    """The effects and the study's plausible ranges scanned and weighed."""
    counted = _counted(here, study, data, workers)
    ranges = study.measurements.plausible if study.measurements else ()
    parameters = [*effect_parameters(bench.registry, kinds), *task_parameters(counted, ranges)]
    if not parameters:
        raise UserError(
            "nothing to try: no effect has a strength, and 'measurements.plausible' names no number."
        )
    check_writable(folder)
    found = count_evidence(bench, counted, [(parameter,) for parameter in parameters], workers)
    judged = judge_counts(found)
    here.show(counts_diagnosis_document(study.name, counted.counts, found, judged, bench.registry), folder)


def _counted(here: Session, study: Study, data: Path | None, workers: int) -> CountedStudy:
    checked_workers(workers)
    counted = counted_study(study, data)
    here.result.update(study=study.name, data=counted.counts.source, data_sha256=counted.counts.sha256)
    return counted
