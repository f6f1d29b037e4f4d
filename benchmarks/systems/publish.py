"""The bed's tables, on the terminal and on its page of docs.

    python -m benchmarks.systems.publish

writes the text between `<!-- systems: NAME -->` and `<!-- end -->` of the page from the stored answers of the latest
sealed run and from the ledger of all; the rest of the page is kept.
"""

from __future__ import annotations

import gzip
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.evidence import ledger
from benchmarks.output import ROOT
from benchmarks.systems.form_table import KINDS, UNKNOWN
from benchmarks.systems.judging import judged_twice, summary
from benchmarks.systems.plausible import PLAUSIBLE
from benchmarks.systems.robots import ROBOTS

from benchmarks import pages

HERE = Path(__file__).parent
LEDGER, ANSWERS = HERE / "ledger.jsonl", HERE / "answers.jsonl.gz"
# Rows of `benchmarks.systems.beside_sysid --store`.
BESIDE = HERE / "beside_sysid.json"
PAGE = ROOT / "docs" / "how_often_it_is_right_for_your_model.md"
MARK = pages.marks("systems")
FIGURES = ("placed", "strictly", "by_class", "wrong_kind", "false_alarms", "unknown")


def stored() -> dict[str, Any]:
    """Return all tables of the latest sealed run, with the ledger."""
    lines = gzip.decompress(ANSWERS.read_bytes()).splitlines() if ANSWERS.exists() else []
    head, *answers = [json.loads(line) for line in lines] or [{}]
    beside = json.loads(BESIDE.read_text()) if BESIDE.exists() else []
    return {
        **summary(judged_twice(answers)),
        "run": head,
        "ledger": ledger.entries(LEDGER),
        "beside": beside,
    }


def as_text(data: dict[str, Any]) -> str:
    """Return all tables as text."""
    lines = [f"{data['n']} answers, {data['errors']} errors"]
    for table in (bars, by_system, by_effect, times):
        lines += ["", f"{table.__doc__}", *table(data)]
    return "\n".join(lines)


def measured(data: dict[str, Any]) -> Iterator[str]:
    """The measured code."""
    run = data["run"]
    if not run:
        yield "No sealed run has ended yet: every cell of the tables below is *not tried*."
        return
    done = f"{run['done']} of {run['planned']} sets that are planned"
    if run.get("unmade"):
        done += f" ({run['unmade']} are left out: not reached with a plausible strength)"
    yield (
        f"Measured on {run['ended'][:10]}: commit `{run['commit']}`, code of the diagnosis `{run['code']}`, {done}. "
        "Later code is not measured by it; `python -m benchmarks.systems.run_bench --digest` says which you have."
    )


def bars(data: dict[str, Any]) -> Iterator[str]:
    """All systems together."""
    rows = (
        ("right effect, at the right place", data["placed"]),
        ("right effect, wherever", data["effects"]),
        ("… by class", data["effects"]["by_class"]),
        ("… a class was the answer", data["class_answers"]),
        ("… ambiguous or insufficient data", data["ambiguous"]),
        ("wrong kind named, all sets", data["wrong_kind"]),
        ("false alarms, nothing hidden", data["false_alarms"]),
        ("unknown effect recognised", data["unknown"]),
    )
    yield from pages.table(
        "what | reached | 95 % (Wilson), sets", ((w, percent(v), interval(v)) for w, v in rows)
    )


def by_system(data: dict[str, Any]) -> Iterator[str]:
    """Every system."""
    none = {"n": 0}
    rows = (
        (
            f"`{name}`",
            long(data["placed_by_robot"].get(name, none)),
            long(data["by_robot"].get(name, none)),
            long(data["by_robot"].get(name, {"by_class": none})["by_class"]),
            long(data["alarms_by_robot"].get(name, none)),
            long(data["unknown_by_robot"].get(name, none)),
        )
        for name in ROBOTS
        if name in data["minutes"]
    )
    yield from pages.table(
        "system | with place | strictly | by class | false alarms | unknown recognised", rows
    )


def by_effect(data: dict[str, Any]) -> Iterator[str]:
    """Every effect, and what was answered otherwise."""
    rows = [
        (
            f"`{kind}`",
            ratio(data["placed_by_kind"][kind]),
            ratio(one),
            ratio(one["by_class"]),
            ", ".join(f"{answer} {n}" for answer, n in data["answers"][kind].items()),
        )
        for kind, one in data["by_kind"].items()
    ]
    for kind, one in data["unknown_by_form"].items():
        rows.append(
            (
                f"`{kind}` (unknown)",
                "",
                ratio(one),
                "",
                ", ".join(f"{a} {n}" for a, n in data["answers"][kind].items()),
            )
        )
    yield from pages.table("hidden | with place | strictly | by class | answered otherwise", rows)


def times(data: dict[str, Any]) -> Iterator[str]:
    """Processor time of the diagnoses."""
    rows = ((f"`{n}`", v["n"], f"{v['median']:.1f}", f"{v['all']:.0f}") for n, v in data["minutes"].items())
    yield from pages.table("system | sets | one, median, min | all, min", rows)


def runs(data: dict[str, Any]) -> Iterator[str]:
    """Sealed runs, finished or not."""
    rows = []
    for one in data["ledger"]:
        figures = one.get("figures", {})
        shares = [figures.get(name) for name in FIGURES]
        reached = [f"{100 * a / b:.1f} %" if b else "–" for a, b in (share or (0, 0) for share in shares)]
        state = "" if one.get("finished") else "stopped" if "ended" in one else "killed, or still running"
        begun, done = one["began"][:16].replace("T", " "), f"{one.get('done', '?')}/{one['planned']}"
        code, unmade = f"`{one['code']}`", one.get("unmade", "?")
        rows.append((begun, f"`{one['commit']}`", code, done, unmade, *reached, one.get("note", state)))
    heads = "with place | strictly | by class | wrong kind | alarms | unknown |"
    yield from pages.table(f"begun (UTC) | commit | code | sets | not reached | {heads} ", rows)


def forms(data: dict[str, Any]) -> Iterator[str]:
    """Hidden effects: the equations of every kind in either split."""
    for title, kinds in (("effect", KINDS), ("unknown effect", UNKNOWN)):
        rows = (
            (
                f"`{kind}`",
                one.place.replace("_", " "),
                _most(kind),
                *(", ".join(f.name for f in split) for split in (one.calibration, one.judged)),
            )
            for kind, one in kinds.items()
        )
        yield from pages.table(
            f"{title} | where | largest strength | in calibration sets | in judged sets", rows
        )
        yield ""


def _most(kind: str) -> str:
    """Return the largest plausible strength of a kind in words."""
    limit = PLAUSIBLE[kind]
    aside = f", {limit.aside_m:g} m" if math.isfinite(limit.aside_m) else ""
    return f"{limit.largest:g} {limit.unit}{aside}"


def systems(data: dict[str, Any]) -> Iterator[str]:
    """The systems."""
    rows = (
        (
            f"`{r.name}`",
            r.package or "this bed",
            len(r.inputs),
            len(r.columns),
            f"{r.duration_s:g} s at {r.sampled_hz:g} Hz",
        )
        for r in ROBOTS.values()
    )
    yield from pages.table("system | package of its file | inputs | outputs | eight runs of", rows)


def beside(data: dict[str, Any]) -> Iterator[str]:
    """Errors on held-out runs in σ, after mujoco.sysid and after Pliant."""
    if not data["beside"]:
        yield "No set has been run to its end with this code."
        return
    names = ("stated", "sysid", "extend", "improve")
    rows = (
        (
            f"`{one['robot']}`",
            f"`{one['hidden']}`",
            *(f"{one['error'][name]:.2f}" if name in one["error"] else "not run" for name in names),
            ", ".join(f"`{kind}`" for kind in one["found"].split(" + ") if kind) or "–",
        )
        for one in data["beside"]
    )
    heads = "as it is | numbers by `mujoco.sysid` | numbers by Pliant | `improve` | what `improve` added"
    yield from pages.table(f"system | hidden | {heads}", rows)


TABLES: pages.Tables = {
    t.__name__: t for t in (measured, bars, by_system, by_effect, times, runs, forms, systems, beside)
}


def percent(value: dict[str, Any]) -> str:
    return f"**{100 * value['share']:.1f} %**" if value["n"] else "not tried"


def ratio(value: dict[str, Any]) -> str:
    return f"{value['right']}/{value['n']}" if value["n"] else "–"


def interval(value: dict[str, Any]) -> str:
    return f"{100 * value['low']:.1f}–{100 * value['high']:.1f}, {ratio(value)}" if value["n"] else ""


def long(value: dict[str, Any]) -> str:
    return f"{100 * value['share']:.1f} % ({interval(value)})" if value["n"] else "–"


def publish(page: Path = PAGE) -> None:
    """Write the tables into the page."""
    page.write_text(pages.rendered(page.read_text(), MARK, TABLES, stored()))


if __name__ == "__main__":
    publish()
