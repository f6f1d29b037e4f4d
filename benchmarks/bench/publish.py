"""The closed loop's tables, on the page of docs that plans experiments.

    python -m benchmarks.bench.publish

writes the text between `<!-- loop: NAME -->` and `<!-- end -->` of the page from the stored answers of the latest
sealed run and from the ledger of all; the rest of the page is kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.bench.loop_answers import GROUPS, stored, summary
from benchmarks.evidence import ledger
from benchmarks.evidence.counting import wilson
from benchmarks.output import ROOT

from benchmarks import pages

LEDGER = Path(__file__).with_name("ledger.jsonl")
PAGE = ROOT / "docs" / "plan_the_next_experiment.md"
MARK = pages.marks("loop")


def result() -> pages.Result:
    """Return head, answers, counts and ledger of the latest sealed run."""
    head, answers = stored()
    return {"head": head, "answers": answers, "ledger": ledger.entries(LEDGER), **summary(answers)}


def measured(data: pages.Result) -> Iterator[str]:
    """The measured code."""
    head, chosen = data["head"], data["chosen"]
    yield (
        f"Measured on {head['ended'][:10]}: commit `{head['commit']}`, code `{head['code']}`, {chosen['n']} truths "
        f"with chosen runs, {data['random']['n']} of them with random runs too."
    )


def bars(data: pages.Result) -> Iterator[str]:
    """What is to be reached."""
    chosen = data["chosen"]
    clean, clean_count = chosen["groups"]["clean"]
    rows = [
        ("right, strictly or by the finest class", "≥ 90 %", *share(chosen["right"], chosen["n"])),
        ("… strictly", "", *share(chosen["strictly"], chosen["n"])),
        ("wrong kind named", "≤ 1 %", *share(chosen["wrong_kind"], chosen["n"])),
        ("nothing hidden, ended as clean", "≥ 97 %", *share(clean, clean_count)),
    ]
    words = {"rich_whole": ("the whole rich protocol", "≤ 0.4"), "random": ("random runs", "≤ 0.6")}
    for arm, (name, bar) in words.items():
        ratio = data[f"chosen_to_{arm}"]
        if ratio["n"]:
            what = f"minutes of chosen runs over those of {name}, median"
            rows.append((what, bar, f"**{ratio['median']:.2f}**", f"{ratio['n']} truths"))
        if 0 < ratio["n_both_right"] < ratio["n"]:
            both = f"**{ratio['median_both_right']:.2f}**"
            rows.append(("… where both are right", "", both, f"{ratio['n_both_right']} truths"))
    yield from pages.table("what | to reach | reached | 95 % (Wilson), truths", rows)


def by_group(data: pages.Result) -> Iterator[str]:
    """Answers by group: right of all, median of the minutes and of the runs."""
    rows = []
    for group in GROUPS:
        mine = [one for one in data["answers"] if one.arm == "chosen" and one.group == group]
        if mine:
            times = sorted(one.minutes for one in mine)
            others = [f"`{one.kind}`: {one.answer}" for one in mine if not one.right]
            rows.append(
                (
                    group,
                    f"{sum(one.right for one in mine)}/{len(mine)}",
                    sum(one.strictly for one in mine),
                    f"{times[len(times) // 2]:.1f}",
                    f"{times[0]:.1f}–{times[-1]:.1f}",
                    "; ".join(others),
                )
            )
    yield from pages.table("hidden | right | strictly | minutes, median | from–to | answered otherwise", rows)


def runs(data: pages.Result) -> Iterator[str]:
    """Sealed runs, finished or not."""
    rows = [
        (
            one["began"][:16].replace("T", " "),
            f"`{one['commit']}`",
            f"`{one['code']}`",
            "ended" if "ended" in one else "killed, or still running",
            one.get("note", ""),
        )
        for one in data["ledger"]
    ]
    yield from pages.table("begun (UTC) | commit | code | state | ", rows)


def share(right: int, n: int) -> tuple[str, str]:
    """Return a share in per cent, and its interval with the counts."""
    low, high = wilson(right, n)
    return f"**{100 * right / n:.1f} %**", f"{100 * low:.1f}–{100 * high:.1f}, {right}/{n}"


TABLES: pages.Tables = {table.__name__: table for table in (measured, bars, by_group, runs)}


def as_text(data: pages.Result) -> str:
    """Return all tables as text."""
    lines: list[str] = []
    for table in TABLES.values():
        lines += ["", f"{table.__doc__}", *table(data)]
    return "\n".join(lines).strip()


def main() -> None:
    """Print the tables and write them into the page."""
    data: dict[str, Any] = result()
    print(as_text(data))
    PAGE.write_text(pages.rendered(PAGE.read_text(), MARK, TABLES, data))


if __name__ == "__main__":
    main()
