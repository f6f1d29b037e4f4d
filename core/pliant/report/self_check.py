"""The document of a study's self-check, and the part on defaults of a run's document."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant.formatting import listed, percent, plural, quantity
from pliant.pipeline.checks import NOT_SETTLED, Check, DefaultNotChecked, DefaultThatMatters, SelfCheck
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Section,
    Table,
    as_json,
    brief_table,
    drawn,
    page_table,
    section,
)

ORDER = ("doubtful", "not checked", "fine")
CHECKS: list[Column[Check]] = [
    Column("status", head="status"),
    Column("subject", head="subject"),
    Column("sentence", head="finding"),
]
DEFAULTS: list[Column[DefaultThatMatters]] = [
    Column("key", head="default", brief="default"),
    Column("value", head="value", brief="value", text=lambda one: quantity(one.value, one.unit, 4)),
    Column("unit"),
    Column("metric", head="changes most", brief="changes most"),
    Column("change", head="by, for a tenth more", brief="by", show=percent),
    Column("error_bar", head="its error bar", show=percent),
]
NOT_CHECKED: list[Column[DefaultNotChecked]] = [
    Column("key", head="default", brief="not checked"),
    Column("why", head="not checked because", brief="because"),
]
NOTE = (
    "Defaults that the study does not state and that move a metric by more than its error bar if a tenth larger; the "
    "error bar is that of 'uncertainty', at least 1 % of the metric, or of the chain's length."
)
SHOWN = 3


def defaults_json(check: SelfCheck) -> dict[str, Any]:
    """Return a run's JSON on defaults."""
    return {
        "defaults_that_matter": [as_json(DEFAULTS, one) for one in check.defaults],
        "defaults_not_checked": [as_json(NOT_CHECKED, one) for one in check.not_checked],
    }


def defaults_section(summary: Mapping[str, Any]) -> Section | None:
    """Return the section on defaults of a run's page, from its JSON; None if it has none."""
    matter = [DefaultThatMatters(**one) for one in summary.get("defaults_that_matter") or ()]
    left = [DefaultNotChecked(**one) for one in summary.get("defaults_not_checked") or ()]
    return section("Defaults that the answer depends on", *_tables(matter, left))


def defaults_lines(check: SelfCheck) -> list[str]:
    """Return the terminal's lines on a run's defaults, and those that `pliant doctor` would add."""
    lines = []
    if check.defaults:
        words = [
            f"{one.key} {quantity(one.value, one.unit, 4)} ({one.metric} {percent(one.change)} for a tenth more)"
            for one in check.defaults[:SHOWN]
        ]
        more = f"; {len(check.defaults) - SHOWN} more in the report" if len(check.defaults) > SHOWN else ""
        lines.append(f"defaults     not stated, and the answer depends on them: {', '.join(words)}{more}")
    rest = ["rest pose"] if NOT_SETTLED in check.checks else []
    if slow := sum(one.too_long for one in check.not_checked):
        rest.append(plural(slow, "default"))
    if rest:
        lines.append(f"not checked  {listed(rest)}: pliant doctor")
    return lines


def _tables(matter: Sequence[DefaultThatMatters], left: Sequence[DefaultNotChecked]) -> list[Table]:
    tables = []
    if matter:
        tables.append(page_table("Defaults that matter", DEFAULTS, matter, NOTE, numeric=4))
    if left:
        note = "'pliant doctor' of the study takes the time for them, as far as it ends in a minute."
        tables.append(page_table("Defaults that were not checked", NOT_CHECKED, left, note, numeric=9))
    return tables


def self_check_document(name: str, found: SelfCheck) -> Document:
    """Return the document: doubts first, then skipped checks, then passed ones."""
    checks = sorted(found.checks, key=lambda check: ORDER.index(check.status))
    count = len(found.doubts)
    sentence = (
        f"{plural(count, 'doubt')} among {plural(len(checks), 'check')}." if count else "No doubt was raised."
    )
    tables: list[Table] = [page_table("Checks", CHECKS, checks, numeric=9)]
    brief: list[Table | str] = [f"{check.status}: {check.subject}. {check.sentence}" for check in checks]
    tables += _tables(found.defaults, found.not_checked)
    if found.defaults:
        brief.append(brief_table(DEFAULTS, found.defaults, NOTE))
    if found.not_checked:
        brief.append(brief_table(NOT_CHECKED, found.not_checked))

    def draw() -> Drawn:
        return drawn(None, Section("What was checked", tables=tuple(tables), open=True))

    return Document(
        kind="Pliant doctor",
        title=name,
        sentence=sentence,
        data={
            "checks": [as_json(CHECKS, check) for check in checks],
            "defaults": [as_json(DEFAULTS, one) for one in found.defaults],
            "defaults_not_checked": [as_json(NOT_CHECKED, one) for one in found.not_checked],
        },
        brief=tuple(brief),
        draw=draw,
    )
