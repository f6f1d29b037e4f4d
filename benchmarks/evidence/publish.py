"""The bench's tables, on the terminal and on the results page of docs, whose figures are all generated.

    python -m benchmarks.evidence.publish

makes the page and its pictures from the stored answers of the latest sealed run of each bed and from the ledger of all.
Text between `<!-- bench: NAME -->` and `<!-- end -->` is regenerated, the rest of the page is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.evidence import ledger
from benchmarks.evidence.bench_errors import MISTAKES
from benchmarks.evidence.counting import overall_tables, summary
from benchmarks.evidence.form_table import FORMS, LAW_SHAPES, MISTAKE_FORMS, Form
from benchmarks.evidence.tasks import MISTAKE_GROUPS, Plan, planned
from benchmarks.evidence.truths import FOURTEEN, KINDS, UNKNOWN
from benchmarks.evidence.workers import ORACLE_GROUP
from benchmarks.output import ROOT

from benchmarks import pages

DOCS = ROOT / "docs"
PAGE = DOCS / "how_often_it_is_right.md"
PICTURES = DOCS / "pictures"
MARK = pages.marks("bench")
# Seconds of CPU, measured with both cores busy: making a rich set, its diagnosis, the scorer with the true forms.
MAKING_S = {"joint": 3.0, "chain": 5.0, "four": 4.0, "finger": 3.0, "rod": 3.5}
ASKING_S = {"joint": 5.0, "chain": 10.0, "four": 8.0, "finger": 15.0, "rod": 5.0}
ORACLE_S = {"joint": 6.0, "chain": 6.0, "four": 4.0, "finger": 6.0}
# Cost of a poor set relative to a rich one. If one effect does not explain the data, pairs are searched.
POOR = 0.33
SEARCHED = ("unknown", "pair")
SPECIAL = (
    ("midway", "begun in mid-transient"),
    ("coarse", "0.2 s dynamics at 2.5 Hz"),
    ("rod", "a rod with a tendon, the third source"),
)
WAYS = (("suggested", "≥ 85 %"), ("random", ""))
FIGURES = ("strictly", "by_class", "wrong_kind", "false_alarms", "unknown", "pairs", "pairs_by_class")
NOTHING = {"n": 0, "by_class": {"n": 0}}
TIMES = {"diagnose": 1.0, "improve": 3.0, "suggested": 3.6, "random": 3.6}


def stored() -> dict[str, Any]:
    """Return all tables of the latest sealed run of each bed, from their stored answers, with the ledger."""
    head, items = ledger.read_answers()
    other_head, others = ledger.read_answers(ledger.ANSWERS_OF["law_off"])
    second = {"law_off": {**summary(others), **_run(other_head)}} if other_head else {}
    both = overall_tables(items, others)
    return {**summary(items), **_run(head), "ledger": ledger.entries(), **second, "beds": both}


def _run(head: dict[str, Any]) -> dict[str, Any]:
    return {"run": head, **({"planned": planned(Plan(**head["plan"]))} if head else {})}


def publish(data: dict[str, Any], page: Path = PAGE, pictures: Path = PICTURES) -> None:
    """Write the tables into the page and draw its pictures.

    Raises:
        UserError: the page asks for an unknown table.
    """
    from benchmarks.evidence.result_pictures import draw_all

    page.write_text(with_tables(page.read_text(), data))
    draw_all(data, pictures)


def with_tables(text: str, data: dict[str, Any]) -> str:
    """Return the page's text with its tables updated."""
    return pages.rendered(text, MARK, {**TABLES, **LAW_OFF_TABLES}, data)


def as_text(data: dict[str, Any]) -> str:
    """Return all tables of `counting.summary` as text, and the answers in every group."""
    lines = [f"{data['n']} answers, {data['errors']} errors"]
    for table in (bars, law_off, kinds, unknown, strength, protocols, suggested, stated, times):
        shown = table({"law_off": data, "beds": data} if table is law_off else data)
        lines += ["", f"{table.__doc__}", *(line for line in shown if line and not line.startswith("!["))]
    for group, rows in data["confusion"].items():
        lines += [
            "",
            f"What was hidden, and what was answered ({group}; {_ratio_text(data['ambiguous'][group])} ambiguous):",
        ]
        lines += [f"  {kind:20s} {_counts(row)}" for kind, row in rows.items()]
    return "\n".join(lines)


def measured(data: dict[str, Any]) -> Iterator[str]:
    """The measured code."""
    run = data.get("run")
    if not run:
        yield "No sealed run has ended yet: every cell of the tables below is *not tried*."
        return
    done = f"{run['done']} of {run['planned']} sets that are planned"
    yield (
        f"Measured on {run['ended'][:10]}: commit `{run['commit']}`, code of the diagnosis `{run['code']}`, {done}. "
        "Later code is not measured by it; `python -m benchmarks.evidence.run_bench --digest` says which you have."
    )


def bars(data: dict[str, Any]) -> Iterator[str]:
    """Targets and results."""
    poor, plan, found, credible = data["poor"], data["plan"], data["calibration"], data["credible_set"]
    end = data["improve"]
    improved = f"**{_number(end['end_over_floor']['median'])}** of {end['n']}" if end["n"] else "not tried"
    rows: list[tuple[str, str, str, str]] = [
        _row("right effect strictly, rich protocol", "≥ 90 %", data["effects"]),
        _row("… by class", "≥ 97 %", data["effects"]["by_class"]),
        _row("… a class was the answer", "", data["class_answers"]),
        _row("wrong kind named, all sets", "≤ 0.5 %", data["wrong_kind"]),
        _row("false alarms, nothing hidden", "≤ 3 %", data["false_alarms"]),
        _row("unknown effect recognised", "≥ 95 %", data["unknown"]),
        _row("exact pair of two hidden", "≥ 82 %", data["pairs"]),
        _row("… by class", "≥ 92 %", data["pairs"]["by_class"]),
        _row("90 % set holds the truth, all groups", "≥ 90 %", credible["coverage"]),
        ("… mean size", "", _number(credible["mean_size"]), ""),
        (f"stated against observed, {found['n']} answers: mean gap", "≤ 0.05", _number(found["error"]), ""),
        ("… Brier score", "", _number(found["brier"]), ""),
        *(_row(f"poor, after two runs, {name}", bar, plan[name]) for name, bar in WAYS if name in plan),
        *(_row(f"… {name}, by class", "", plan[name]["by_class"]) for name, _ in WAYS if name in plan),
    ]
    for name, words in SPECIAL:
        rows += [
            _row(f"{words}, strictly", "≥ 90 %", data[name]),
            _row("… by class", "≥ 97 %", data[name]["by_class"]),
            _row("… wrong kind named", "≤ 0.5 %", data[name]["wrong_kind"]),
            _row("… false alarms", "≤ 3 %", data[name]["alarms"]),
        ]
    rows += [
        ("held-out error after `improve`, over the floor, median", "≤ 1.05", improved, ""),
        _row("poor protocol, first hypothesis true", "", poor["top"]),
        _row("… a scorer with the true forms", "", poor["oracle"]),
    ]
    yield from pages.table("what | to reach | reached | 95 % (Wilson), sets", rows)


def runs(data: dict[str, Any]) -> Iterator[str]:
    """Sealed runs, finished or not; the last finished one counts."""
    yield from _runs(data, "exact")


def law_off_runs(data: dict[str, Any]) -> Iterator[str]:
    """Sealed runs with inexact laws."""
    yield from _runs(data, "law_off")


def _runs(data: dict[str, Any], bed: str) -> Iterator[str]:
    rows = []
    for one in data.get("ledger", ()):
        if one.get("plan", {}).get("bed", "exact") != bed:
            continue
        figures = one.get("figures", {})
        reached = [_percent_text(figures.get(name)) for name in FIGURES]
        state = "" if one.get("finished") else "stopped" if "ended" in one else "killed, or still running"
        begun, done = one["began"][:16].replace("T", " "), f"{one.get('done', '?')}/{one['planned']}"
        what = (begun, f"`{one['commit']}`", f"`{one['code'] or '–'}`", done)
        rows.append((*what, *reached, one.get("note", state)))
    heads = "strictly | by class | wrong kind | alarms | unknown | pairs | … by class |"
    yield from pages.table(f"begun (UTC) | commit | code | sets | {heads} ", rows)


def forms(data: dict[str, Any]) -> Iterator[str]:
    """Hidden effects: the equations of every kind in either split."""
    for title, kinds_of in (("effect", KINDS), ("unknown effect", tuple(UNKNOWN))):
        rows = ((f"`{kind}`", FORMS[kind]) for kind in kinds_of)
        yield from _splits(title, rows)


def law_off_forms(data: dict[str, Any]) -> Iterator[str]:
    """Shapes of a law's error and mistakes of a record, in either split."""
    rows = [("a law's error", LAW_SHAPES), *((f"`{kind}`", MISTAKE_FORMS[kind]) for kind in MISTAKES)]
    yield from _splits("off", rows)


def _splits(title: str, rows: Iterable[tuple[str, Sequence[Sequence[Form]]]]) -> Iterator[str]:
    named = ((name, *(", ".join(form.name for form in split) for split in splits)) for name, splits in rows)
    yield from pages.table(f"{title} | in calibration sets | in judged sets", named)
    yield ""


def law_off(data: dict[str, Any]) -> Iterator[str]:
    """Law errors of shape, wrong records, separable classes and intervals."""
    if "law_off" not in data:
        yield "No sealed run of laws that are off has ended yet."
        return
    one, beds = data["law_off"], data["beds"]
    plan = one["plan"].get("suggested", {"n": 0, "by_class": {"n": 0}})
    gap = _number(beds["calibration"]["error"])
    rows = [
        _row("right effect by class", "≥ 93 %", one["effects"]["by_class"]),
        _row("… strictly", "", one["effects"]),
        _row("wrong effect named, all sets", "≤ 1 %", one["wrong_kind"]),
        _row("an effect said to be missing, nothing hidden", "≤ 3 %", one["false_alarms"]),
        _row("unknown effect recognised", "", one["unknown"]),
        _row("… tilted sensors and detents", "", one["missed"]),
        _row("pair of two by class", "", one["pairs"]["by_class"]),
        *(_row(f"wrong {name} recognised", "", one[name]) for name in MISTAKE_GROUPS),
        _row("a mistake reported for a correct record", "", one["told_wrongly"]),
        *(_row(f"{words}, by class", "", one[name]["by_class"]) for name, words in SPECIAL),
        _row("poor, after two suggested runs", "", plan),
        *(
            _row(f"what is hidden was fitted, {name}", "≥ 99 %", value)
            for name, value in one["fitted"].items()
        ),
        _row("90 % intervals of parameters hold the value", "85–95 %", one["intervals"]["all"]),
        _row("stated at 99 % or more: right by class", "≥ 98 %", beds["certain"]),
        (f"stated against observed, {beds['calibration']['n']} answers: mean gap", "≤ 0.04", gap, ""),
    ]
    yield from pages.table("what | to reach | reached | 95 % (Wilson), sets", rows)
    yield ""
    yield from pages.table(
        "group | could be split | strictly right, of these",
        ((g, _long(v["could"]), _long(v["strictly"])) for g, v in one["split"].items() if v["could"]["n"]),
    )
    yield ""
    yield from pages.table(
        "law off by, % of its torque range | strictly | by class",
        (
            (f"{100 * b['above']:g} to {100 * b['below']:g}", _long(b), _long(b["by_class"]))
            for b in one["by_law"]
            if b["n"]
        ),
    )
    yield ""
    yield from pages.table(
        "parameter | 90 % intervals that hold | median distance, sd",
        ((f"`{n}`", _long(v), _number(v["median_sd_off"])) for n, v in one["intervals"].items() if v["n"]),
    )


def kinds(data: dict[str, Any]) -> Iterator[str]:
    """Answers for every hidden effect."""
    answers = data["confusion"].get("effect", {})
    order = sorted(data["by_kind"].items(), key=lambda entry: (entry[0] not in FOURTEEN, entry[0]))
    if order:
        yield from ("![Answers in % of what was hidden](pictures/bench_confusion.png)", "")
    yield from pages.table(
        "hidden | strictly | by class | strictly, form by form | answered otherwise",
        (
            (
                f"`{k}`",
                _ratio_text(v),
                _ratio_text(v["by_class"]),
                ", ".join(f"{form} {_ratio_text(one)}" for form, one in data["by_form"][k].items()),
                _counts(answers.get(k, {}), _words, (k,)),
            )
            for k, v in order
        ),
    )


def unknown(data: dict[str, Any]) -> Iterator[str]:
    """Answers for every effect without a plugin, and every robot."""
    answers, right = data["confusion"].get("unknown", {}), ("unknown_effect", "not_repeatable")
    rows = [
        (f"`{kind}`", _ratio_text(value), _counts(answers.get(kind, {}), _words, right))
        for kind, value in data["unknown_by_form"].items()
    ]
    rows += [(f"robot `{name}`", _ratio_text(value), "") for name, value in data["unknown_by_robot"].items()]
    yield from pages.table("unknown effect | recognised | answered otherwise", rows)


def strength(data: dict[str, Any]) -> Iterator[str]:
    """Results by the RMS change of the readings."""
    bands = [band for band in data["by_snr"] if band["n"]]
    if bands:
        yield from ("![Share that is right by strength](pictures/bench_strength.png)", "")
    yield from pages.table(
        "RMS change, σ | strictly | by class",
        ((f"{b['above']:g} to {b['below']:g}", _long(b), _long(b["by_class"])) for b in bands),
    )


def protocols(data: dict[str, Any]) -> Iterator[str]:
    """Results by protocol, engine and robot."""
    rows = [
        (f"protocol `{name}`", value["effects"], _ratio_text(value["clean"]))
        for name, value in data["by_protocol"].items()
    ]
    for what in ("engine", "robot"):
        alarms = data[f"false_alarms_by_{what}"]
        for name in sorted({*data[f"by_{what}"], *alarms}):
            clean = f"{alarms[name]['right']} alarms in {alarms[name]['n']}" if name in alarms else ""
            rows.append((f"{what} `{name}`", data[f"by_{what}"].get(name, NOTHING), clean))
    yield "| | effects, strictly | by class | nothing hidden: right |"
    yield "|---|---|---|---|"
    for name, value, clean in rows:
        yield f"| {name} | {_long(value)} | {_long(value['by_class'])} | {clean} |"


def suggested(data: dict[str, Any]) -> Iterator[str]:
    """Poor sets after two more runs."""
    yield "| two more runs | right | by class | first hypothesis true | runs that were added |"
    yield "|---|---|---|---|---|"
    for name, value in sorted(data["plan"].items(), reverse=True):
        runs = _counts(dict(list(value["runs"].items())[:6]), "`{}`".format)
        yield f"| {name} | {_long(value)} | {_ratio_text(value['by_class'])} | {_ratio_text(value['top'])} | {runs} |"


def stated(data: dict[str, Any]) -> Iterator[str]:
    """Bins of equal width."""
    if data["calibration"]["n"]:
        yield from (
            "![Share that is true against the probability that was stated](pictures/bench_reliability.png)",
            "",
        )
    yield from pages.table(
        "probability of the first hypothesis | stated, mean | true",
        (
            (f"{row['above']:.1f} to {row['below']:.1f}", f"{row['stated']:.3f}", _long(row))
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
    table.__name__: table
    for table in (measured, bars, runs, forms, kinds, unknown, strength, protocols, suggested, stated, times)
}
# Of the bed of laws that are off: for the page, once a sealed run of it has ended.
LAW_OFF_TABLES: pages.Tables = {table.__name__: table for table in (law_off, law_off_runs, law_off_forms)}


def expected_time(plan: Plan) -> str:
    """Return sets and minutes of each group, on two cores, from the measured seconds per set."""
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
    return what, bar, f"**{_percent(value['share'])}**", f"{_interval(value)}, {_ratio_text(value)}"


def _percent_text(count: Sequence[int] | None) -> str:
    return f"{100 * count[0] / count[1]:.1f} %" if count and count[1] else "–"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"


def _interval(value: dict[str, Any]) -> str:
    return f"{100 * value['low']:.1f}–{100 * value['high']:.1f}"


def _ratio_text(value: dict[str, Any]) -> str:
    return f"{value['right']}/{value['n']}" if value["n"] else "–"


def _long(value: dict[str, Any]) -> str:
    return f"{_percent(value['share'])} ({_ratio_text(value)}; {_interval(value)})" if value["n"] else "–"


def _words(answer: str) -> str:
    verdict = answer.endswith(("missing", "effect", "data", "repeatable"))
    return answer.replace("_", " ") if verdict else f"`{answer}`"


def _counts(answers: Mapping[str, int], words: Callable[[str], str] = str, but: Sequence[str] = ()) -> str:
    """Return answers and their counts, the most frequent first."""
    shown = sorted(((a, n) for a, n in answers.items() if a not in but), key=lambda entry: -entry[1])
    return ", ".join(f"{words(a)} {n}" for a, n in shown)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


if __name__ == "__main__":
    publish(stored())
