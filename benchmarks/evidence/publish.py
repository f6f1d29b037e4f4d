"""The bench's tables, on the terminal and on the results page of docs: no figure on it is typed by hand.

The page's own words stay; what stands between `<!-- bench: NAME -->` and `<!-- end -->` is written anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.evidence.tasks import Plan
from benchmarks.evidence.truths import FOURTEEN
from benchmarks.evidence.workers import ORACLE_GROUP
from benchmarks.output import ROOT

from benchmarks import pages

DOCS = ROOT / "docs"
PAGE = DOCS / "how_often_it_is_right.md"
PICTURES = DOCS / "pictures"
MARK = pages.marks("bench")
# Seconds of CPU, measured with both cores busy: making a rich set, its diagnosis, the scorer with the true forms.
MAKING_S = {"joint": 2.5, "chain": 6.0, "four": 4.0, "finger": 3.0}
ASKING_S = {"joint": 5.0, "chain": 10.0, "four": 8.0, "finger": 15.0}
ORACLE_S = {"joint": 6.0, "chain": 6.0, "four": 4.0, "finger": 6.0}
# Of a rich one: what a poor set takes. Where one effect does not explain the data, pairs are searched.
POOR = 0.33
SEARCHED = ("unknown", "pair")
TIMES = {"diagnose": 1.0, "improve": 3.0, "suggested": 3.6, "random": 3.6}


def publish(data: dict[str, Any], page: Path = PAGE, pictures: Path = PICTURES) -> None:
    """Write the tables into the page and draw the pictures beside it.

    Raises:
        UserError: the page asks for a table that there is none of.
    """
    from benchmarks.evidence.result_pictures import draw_all

    page.write_text(pages.rendered(page.read_text(), MARK, TABLES, data))
    draw_all(data, pictures)


def as_text(data: dict[str, Any]) -> str:
    """All tables of `counting.summary` as text, and what was answered in every group."""
    lines = [f"{data['n']} answers, {data['errors']} errors"]
    for table in TABLES.values():
        lines += [
            "",
            f"{table.__doc__}",
            *(line for line in table(data) if line and not line.startswith("![")),
        ]
    for group, rows in data["confusion"].items():
        lines += [
            "",
            f"What was hidden, and what was answered ({group}; {_of(data['ambiguous'][group])} ambiguous):",
        ]
        lines += [f"  {kind:20s} {_counts(row)}" for kind, row in rows.items()]
    return "\n".join(lines)


def bars(data: dict[str, Any]) -> Iterator[str]:
    """What was asked for, and what was reached."""
    poor, plan, found, credible = data["poor"], data["plan"], data["calibration"], data["credible_set"]
    end = data["improve"]
    improved = f"**{_number(end['end_over_floor']['median'])}** of {end['n']}" if end["n"] else "not tried"
    ways = (("suggested", "≥ 90 %"), ("random", ""))
    rows: list[tuple[str, str, str, str]] = [
        _row("right effect by class, rich protocol", "≥ 95 %", data["effects"]["by_class"]),
        _row("… strictly", "", data["effects"]),
        _row("false alarms, nothing hidden", "≤ 5 %", data["false_alarms"]),
        _row("unknown effect recognised", "≥ 95 %", data["unknown"]),
        _row("exact pair of two hidden", "≥ 85 %", data["pairs"]),
        _row("… by class", "", data["pairs"]["by_class"]),
        _row("90 % set holds the truth", "86 to 95 %", credible["coverage"]),
        ("… median size", "≤ 2", _number(credible["median_size"]), ""),
        _row("poor protocol, first hypothesis true", "", poor["top"]),
        _row("… a scorer with the true forms", "", poor["oracle"]),
        ("… ratio", "≥ 90 %", _percent(poor["ratio"]), ""),
        *(_row(f"poor, after two runs, {name}", bar, plan[name]) for name, bar in ways if name in plan),
        *(_row(f"… {name}, by class", "", plan[name]["by_class"]) for name, _ in ways if name in plan),
        (f"stated against true, {found['n']} cases: error", "≤ 0.05", _number(found["error"]), ""),
        ("… Brier score", "", _number(found["brier"]), ""),
        ("held-out error after `improve`, over the floor, median", "≤ 1.15", improved, ""),
    ]
    yield from pages.table("what | to reach | reached | 95 % (Wilson), sets", rows)


def kinds(data: dict[str, Any]) -> Iterator[str]:
    """How often every effect was named."""
    answers = data["confusion"].get("effect", {})
    order = sorted(data["by_kind"].items(), key=lambda entry: (entry[0] not in FOURTEEN, entry[0]))
    yield from ("![Answers in % of what was hidden](pictures/bench_confusion.png)", "")
    yield from pages.table(
        "hidden | strictly | by class | answered otherwise",
        ((f"`{k}`", _of(v), _of(v["by_class"]), _counts(answers.get(k, {}), _words, (k,))) for k, v in order),
    )


def unknown(data: dict[str, Any]) -> Iterator[str]:
    """Every form that no plugin has."""
    answers, right = data["confusion"].get("unknown", {}), ("unknown_effect", "not_repeatable")
    yield from pages.table(
        "form | recognised | answered otherwise",
        (
            (f"`{kind}`", _of(value), _counts(answers.get(kind, {}), _words, right))
            for kind, value in data["unknown_by_form"].items()
        ),
    )


def strength(data: dict[str, Any]) -> Iterator[str]:
    """By the RMS change of the readings."""
    yield from ("![Share that is right by strength](pictures/bench_strength.png)", "")
    bands = [band for band in data["by_snr"] if band["n"]]
    yield from pages.table(
        "RMS change, σ | strictly | by class",
        ((f"{b['above']:g} to {b['below']:g}", _long(b), _long(b["by_class"])) for b in bands),
    )


def protocols(data: dict[str, Any]) -> Iterator[str]:
    """By protocol, engine and robot."""
    rows = [
        (f"protocol `{name}`", value["effects"], _of(value["clean"]))
        for name, value in data["by_protocol"].items()
    ]
    for what in ("engine", "robot"):
        for name, value in data[f"by_{what}"].items():
            alarms = data["false_alarms_by_engine"].get(name, {}) if what == "engine" else {}
            clean = f"{alarms['right']} alarms in {alarms['n']}" if alarms else ""
            rows.append((f"{what} `{name}`", value, clean))
    yield "| | effects, strictly | by class | nothing hidden: right |"
    yield "|---|---|---|---|"
    for name, value, clean in rows:
        yield f"| {name} | {_long(value)} | {_long(value['by_class'])} | {clean} |"


def planned(data: dict[str, Any]) -> Iterator[str]:
    """Poor sets after two more runs."""
    yield "| two more runs | right | by class | first hypothesis true | runs that were added |"
    yield "|---|---|---|---|---|"
    for name, value in sorted(data["plan"].items(), reverse=True):
        runs = _counts(dict(list(value["runs"].items())[:6]), "`{}`".format)
        yield f"| {name} | {_long(value)} | {_of(value['by_class'])} | {_of(value['top'])} | {runs} |"


def stated(data: dict[str, Any]) -> Iterator[str]:
    """Bins of equal mass."""
    yield from (
        "![Share that is true against the probability that was stated](pictures/bench_reliability.png)",
        "",
    )
    yield from pages.table(
        "probability of the first hypothesis | stated, mean | true",
        (
            (f"{row['above']:.3f} to {row['below']:.3f}", f"{row['stated']:.3f}", _long(row))
            for row in data["calibration"]["bins"]
        ),
    )


def times(data: dict[str, Any]) -> Iterator[str]:
    """Sets and processor time of every group."""
    wanted = data.get("planned", {})
    rows = (
        (name, one["n"], wanted.get(name, "–"), _number(one["median"]), f"{one['cpu_s'] / 60:.1f}")
        for name, one in data["time"].items()
    )
    yield from pages.table("group | sets | planned | one, median, s of CPU | all, min of CPU", rows)


TABLES: pages.Tables = {
    table.__name__: table for table in (bars, kinds, unknown, strength, protocols, planned, stated, times)
}


def expected_time(plan: Plan) -> str:
    """Sets and minutes of each group, on two cores, by the seconds that one was measured to take."""
    seconds: dict[str, list[float]] = {}
    for task in plan.tasks():
        robot, share = task.spec.robot, POOR if task.spec.protocol == "poor" else 1.0
        asked = 2.0 if task.group in SEARCHED else TIMES[task.mode]
        oracle = ORACLE_S[robot] if task.group == ORACLE_GROUP else 0.0
        one = share * (MAKING_S[robot] + asked * ASKING_S[robot]) + oracle
        seconds.setdefault(task.group, []).append(one)
    rows = {group: (len(seconds[group]), sum(seconds[group]) / 60 / 2) for group in sorted(seconds)}
    rows["all"] = tuple(sum(column) for column in zip(*rows.values(), strict=True))
    lines = [f"{group:14s} {count:4d}  {minutes:6.1f}" for group, (count, minutes) in rows.items()]
    return "\n".join([f"{'group':14s} sets  min on two cores", *lines])


def _row(what: str, bar: str, value: dict[str, Any]) -> tuple[str, str, str, str]:
    if not value["n"]:
        return what, bar, "not tried", ""
    return what, bar, f"**{_percent(value['share'])}**", f"{_interval(value)}, {_of(value)}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"


def _interval(value: dict[str, Any]) -> str:
    return f"{100 * value['low']:.1f}–{100 * value['high']:.1f}"


def _of(value: dict[str, Any]) -> str:
    return f"{value['right']}/{value['n']}" if value["n"] else "–"


def _long(value: dict[str, Any]) -> str:
    return f"{_percent(value['share'])} ({_of(value)}; {_interval(value)})" if value["n"] else "–"


def _words(answer: str) -> str:
    verdict = answer.endswith(("missing", "effect", "data", "repeatable"))
    return answer.replace("_", " ") if verdict else f"`{answer}`"


def _counts(answers: Mapping[str, int], words: Callable[[str], str] = str, but: Sequence[str] = ()) -> str:
    """Answers and how often each was given, the most frequent first."""
    shown = sorted(((a, n) for a, n in answers.items() if a not in but), key=lambda entry: -entry[1])
    return ", ".join(f"{words(a)} {n}" for a, n in shown)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
