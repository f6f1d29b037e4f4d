"""The kind of data `counts`: what `pliant compare` and `pliant diagnose` call for a file of successes and trials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pliant.config.study import Study
from pliant.errors import UserError
from pliant.execution.executors import Workers
from pliant.formatting import listed
from pliant.measurements.files import Sources
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import Registry
from pliant.report.document import Document
from pliant_counts.comparison import CountComparison
from pliant_counts.comparison_page import counts_document
from pliant_counts.counted_study import CountedStudy, compare_counted, counted_study
from pliant_counts.diagnosis_page import counts_diagnosis_document
from pliant_counts.evidence import CountEvidence, count_evidence
from pliant_counts.parameters import VariedParameter, effect_parameters, task_parameters
from pliant_counts.verdict import judge_counts


@dataclass(frozen=True)
class MeasuredCounts:
    """A study with its counts, as a `MeasuredData`."""

    counted: CountedStudy

    @property
    def source(self) -> str:
        """The file's name."""
        return self.counted.counts.source

    @property
    def sha256(self) -> str:
        """The digest of the file's content."""
        return self.counted.counts.sha256

    def compare(
        self, context: RunContext, workers: Workers
    ) -> tuple[CountComparison, Callable[[], Document]]:
        """Simulate all conditions; return the comparison and the call that documents it."""
        counted = self.counted
        found = compare_counted(context, counted, workers)
        return found, lambda: counts_document(counted.study.name, counted.counts, found)

    def candidates(self, registry: Registry, kinds: Sequence[str] | None) -> Sequence[VariedParameter]:
        """Return the parameters that may explain the counts; raise `UserError` without any."""
        settings = self.counted.study.measurements
        ranges = settings.plausible if settings else ()
        parameters = [*effect_parameters(registry, kinds), *task_parameters(self.counted, ranges)]
        if not parameters:
            raise UserError(
                "nothing to try: no effect has a strength, and 'measurements.plausible' names no number."
            )
        return parameters

    def diagnose(
        self, context: RunContext, candidates: Sequence[VariedParameter], workers: Workers
    ) -> tuple[CountEvidence, Callable[[], Document]]:
        """Simulate all candidates at all levels; return the evidence and the call that documents its verdict."""
        counted = self.counted
        found = count_evidence(context, counted, [(parameter,) for parameter in candidates], workers)
        return found, lambda: counts_diagnosis_document(
            counted.study.name, counted.counts, found, judge_counts(found), context.registry
        )


def open_counts(study: Study, data: Sources = None) -> MeasuredCounts:
    """Return the study with its file of counts.

    Raises:
        UserError: a file of counts with further files beside it, or one that the study cannot use.
    """
    files = data if isinstance(data, list | tuple) else [data]
    if len(files) > 1:
        raise UserError(
            f"{files[0]} is a file of counts, and {listed([str(file) for file in files[1:]])} would not be read; "
            "counts come in one file: put the rows together, or give one --data."
        )
    return MeasuredCounts(counted_study(study, files[0]))


def compare_counts_file(
    context: RunContext, study: Study, data: Sources, workers: Workers
) -> CountComparison:
    """Compare the study's task with a file of counts."""
    return compare_counted(context, counted_study(study, data), workers)
