"""`pliant compare` with a file of counts."""

from __future__ import annotations

from pathlib import Path

from rich.table import Table

from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.evidence.counted_study import compare_counted, counted_study
from pliant.evidence.counts import CountComparison
from pliant.evidence.counts_words import counted, counts_json, interpret_counts
from pliant.execution.executors import checked_workers
from pliant.formatting import number
from pliant.pipeline.workbench import Workbench
from pliant.report.stage import write_page

MOST_SHOWN = 40


def compare_counts_verb(
    here: Session, bench: Workbench, study: Study, data: Path | None, folder: Path, workers: int
) -> None:
    """Every condition simulated and compared; the JSON, the table, the page."""
    checked_workers(workers)
    measured = counted_study(study, data)
    check_writable(folder)
    found = compare_counted(bench, measured, workers)
    here.result.update(
        {
            "study": study.name,
            "data": measured.counts.source,
            "data_sha256": measured.counts.sha256,
            **counts_json(found),
            "out": str(folder),
        }
    )
    here.say(_table(found))
    if found.disagreeing:
        here.say(f"* more than chance, corrected for looking at {len(found.conditions)} conditions")
    for remark in found.remarks:
        here.say(f"note: {remark}")
    here.say(interpret_counts(found))
    from pliant.report.counts import counts_page  # matplotlib takes a second to import

    made = counts_page(study.name, measured.counts, found)
    page = write_page(folder, made.html, made.pictures)
    here.result["report"] = str(page)
    here.say(f"report   {page}")


def _table(found: CountComparison) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("condition")
    for name in ("measured", "model", "log-lik.", "dev.", "z", "sets"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in found.conditions[:MOST_SHOWN]:
        sets = " ".join(str(s.successes) for s in one.condition.sets[:6])
        table.add_row(
            one.condition.words,
            counted(one.measured),
            counted(one.simulated),
            number(one.log_likelihood, 3),
            number(one.deviance, 3),
            f"{number(one.z, 2)}{'*' if one.disagrees else ' '}",
            f"{sets}{' !' if one.contradictory else ''}",
        )
    table.add_row(
        "all conditions", "", "", number(found.log_likelihood, 4), number(found.deviance, 4), "", ""
    )
    return table
