"""Shared by the measured benches: recordings split by run, errors of a study on a file, and the page's sections.

All of it uses the public interface: `pliant.open`, `compare`, `diagnose`, `improve`, `api.fit_stated_law`.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import REFERENCE, ROOT

import pliant
from pliant.notebook.study import StudyHandle
from pliant.records.design import Array
from pliant.store.store import write_atomically

MEASURED = REFERENCE.parent / "measured"
PAGE = ROOT / "docs" / "what_real_data_taught_us.md"
PICTURES = ROOT / "docs" / "pictures"
Row = Mapping[str, str]


def missing(*names: str) -> bool:
    """Return whether a recording is missing, and print it."""
    absent = [MEASURED / name for name in names if not (MEASURED / name).is_file()]
    if absent:
        print(f"skipped: {absent[0]} is not here")
    return bool(absent)


def read_runs(names: Iterable[str], key: str = "run") -> dict[str, list[Row]]:
    """Return the rows of each run of some files, in their order."""
    found: dict[str, list[Row]] = defaultdict(list)
    for name in names:
        with (MEASURED / name).open(encoding="utf-8") as file:
            for row in csv.DictReader(file):
                found[row[key]].append(row)
    return dict(found)


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write a CSV of rows with the same columns."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    return path


def residuals(study: StudyHandle, data: Path) -> dict[str, dict[str, Array]]:
    """Return the residuals (t,) of `compare` on a file by run and output: measured − model in SI."""
    table = study.compare(data).to_frame()
    run, output, values = (np.asarray(table[name]) for name in ("run", "output", "residual"))
    found: dict[str, dict[str, Array]] = {}
    for name in dict.fromkeys(run.tolist()):
        outputs = dict.fromkeys(output[run == name].tolist())
        found[name] = {o: values[(run == name) & (output == o)].astype(float) for o in outputs}
    return found


def rms(values: Array) -> float:
    """Return the root mean square of readings; NaN without any."""
    there = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(there**2))) if len(there) else float("nan")


def improved(study: StudyHandle, new: Path) -> tuple[Any, StudyHandle]:
    """Run `improve`; return its record and the study that it wrote, the given study if it added nothing."""
    found = study.improve(out=new)
    added = found.record.final is not None
    return found.record, pliant.open(new, store=study.opened.context.store.root) if added else study


def publish(section: str, lines: Sequence[str]) -> None:
    """Put the lines between the marks of a section of the page; its prose around them is written by hand."""
    begin, end = f"<!-- {section}: written by benchmarks/real -->", f"<!-- {section}: end -->"
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    _, found, after = rest.partition(end)
    assert found, f"{PAGE} has no section '{section}'"
    body = "\n".join(lines).strip()
    write_atomically(PAGE, f"{before}{begin}\n\n{body}\n\n{end}{after}")


def finish(figure: Any, name: str) -> None:
    """Save a row of panels for the page; the legend of the first panel applies to all."""
    for panel in figure.axes:
        panel.spines[["top", "right"]].set_visible(False)
    figure.axes[0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    figure.savefig(PICTURES / f"{name}.png", dpi=110)


def first_sentence(reason: str) -> str:
    """Return the first sentence of the verdict of `improve`: the page has no room for all of it."""
    return f"{reason.split('. ')[0].rstrip('.')}."


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a Markdown table."""
    body = [" | ".join(row) for row in rows]
    return [f"| {' | '.join(head)} |", "|" + "---|" * len(head), *(f"| {row} |" for row in body), ""]


def run_script(files: Sequence[str], doc: str | None, work: Callable[[Path, bool], None]) -> None:
    """Run a bench in a folder that is kept while it runs; `--page` draws and publishes too."""
    import tempfile

    from benchmarks.output import make_parser

    parser = make_parser(doc)
    parser.add_argument("--page", action="store_true", help="draw the pictures and write the page's section")
    asked = parser.parse_args()
    if missing(*files):
        return
    with tempfile.TemporaryDirectory() as folder:
        work(Path(folder), asked.page)
