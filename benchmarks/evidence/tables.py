"""The bench's tables as text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

SHORT = {
    "missing_effect": "missing",
    "nothing_missing": "nothing",
    "unknown_effect": "unknown",
    "not_repeatable": "not repeatable",
    "insufficient_data": "insufficient",
}


MAIN = ("effect", "clean", "unknown")
SEVERAL = "several effects"


def tables(data: dict[str, Any]) -> str:
    """`judge.summary` as a page of text."""
    return "\n".join(_lines(data))


def _lines(data: dict[str, Any]) -> Iterator[str]:
    yield f"{data['n']} answers, {data['errors']} errors"
    yield ""
    yield from _matrix({k: row for g in MAIN for k, row in data["confusion"].get(g, {}).items()})
    for group, rows in data["confusion"].items():
        yield ""
        yield f"What was hidden, and what was answered ({group}):"
        shares = data["by_kind"] | data["unknown_by_form"] if group in ("effect", "unknown") else {}
        for kind, row in rows.items():
            answers = ", ".join(
                f"{_short(a)} {n}" for a, n in sorted(row.items(), key=lambda x: (-x[1], x[0]))
            )
            rate = share_text(shares[kind]) if kind in shares else f"{'':>28s}"
            yield f"  {kind:20s} {rate}  {answers}"
    yield ""
    yield f"Right effect, by class       {share_text(data['effects']['by_class'])}"
    yield f"  strictly                   {share_text(data['effects'])}"
    if data["effects_not_excited"]:
        yield f"  not excited, left out      {data['effects_not_excited']}"
    for name in ("by_engine", "by_robot"):
        for key, value in data[name].items():
            yield f"  {key:26s} {_two(value)}"
    yield f"False alarms on clean data   {share_text(data['false_alarms'])}"
    for key, value in data["false_alarms_by_engine"].items():
        yield f"  {key:26s} {share_text(value)}"
    yield f"Unknown effects recognised   {share_text(data['unknown'])}"
    yield f"Exact pair of two hidden     {_two(data['pairs'])}"
    yield ""
    yield "By strength (RMS change of the readings in σ): by class, strictly"
    for band in data["by_snr"]:
        if band["n"]:
            yield f"  {band['above']:.2f} to {band['below']:.2f}             {_two(band)}"
    yield "By protocol (effects that it excites, by class and strictly; clean):"
    for name, value in data["by_protocol"].items():
        yield f"  {name:26s} {_two(value['effects'])}  clean {share_text(value['clean'])}"
    poor = data["poor"]
    yield "Poor protocol, first hypothesis against a scorer with the true forms:"
    yield f"  first hypothesis           {share_text(poor['top'])}"
    yield f"  true forms                 {share_text(poor['oracle'])}  ratio {number_text(poor['ratio'])}"
    for name, value in data["plan"].items():
        runs = ", ".join(f"{run} {n}" for run, n in list(value["runs"].items())[:5])
        yield f"  after two runs, {name:10s} {_two(value)}  first {share_text(value['top'])}  {runs}"
    yield "Ambiguous, never strictly right:"
    for name, value in data["ambiguous"].items():
        yield f"  {name:26s} {share_text(value)}"
    credible = data["credible_set"]
    size = number_text(credible["median_size"])
    yield f"90 % credible set holds it   {share_text(credible['coverage'])}  median size {size}"
    found = data["calibration"]
    yield (
        f"First hypothesis, {found['n']} cases: error {number_text(found['error'])}, Brier score "
        f"{number_text(found['brier'])}; probability stated, and share that is true:"
    )
    for row in found["bins"]:
        yield f"  {row['above']:.3f} to {row['below']:.3f}  stated {row['stated']:.3f}  {share_text(row)}"
    wall = data["wall_s"]
    yield f"One diagnosis: median {number_text(wall['median'])} s, 90 % below {number_text(wall['q90'])} s"
    for name, value in data["time"].items():
        minutes, median = value["cpu_s"] / 60, number_text(value["median"])
        yield f"  {name:12s} {value['n']:4d} sets, {minutes:.1f} min of CPU, median {median} s"
    improve = data["improve"]
    if improve["n"]:
        start, end = improve["start_over_floor"], improve["end_over_floor"]
        yield (
            f"Held-out error over the floor, {improve['n']} sets: before {number_text(start['median'])}, after improve "
            f"{number_text(end['median'])} (quartiles {number_text(end['q25'])} to {number_text(end['q75'])}, worst "
            f"{number_text(end['worst'])}); right effects {share_text(improve['right'])}"
        )


def _two(value: dict[str, Any]) -> str:
    """By class and strictly."""
    return f"{share_text(value['by_class'])} {share_text(value)}"


def _matrix(rows: dict[str, dict[str, int]]) -> Iterator[str]:
    """Confusion matrix: a row per truth, a column per answer; columns are numbered as the rows are."""
    named = {
        kind: [(SEVERAL if " + " in answer else _short(answer), n) for answer, n in row.items()]
        for kind, row in rows.items()
    }
    answers = {answer for row in named.values() for answer, _ in row}
    columns = [kind for kind in rows if kind in answers] + sorted(answers - set(rows))
    number = {column: i for i, column in enumerate(columns, 1)}
    yield f"Confusion matrix, hidden by answered{'':5s}" + "".join(f"{i:4d}" for i in number.values())
    for kind, row in named.items():
        counts = dict.fromkeys(columns, 0)
        for answer, n in row:
            counts[answer] += n
        place = f"{number[kind]:3d} " if kind in number else "    "
        yield f"  {place}{kind:36s}" + "".join(f"{counts[c]:4d}" if counts[c] else "   ·" for c in columns)
    others = [f"{number[c]} {c}" for c in columns if c not in rows]
    yield f"  {', '.join(others)}"


def _short(answer: str) -> str:
    return SHORT.get(answer, answer)


def share_text(value: dict[str, Any]) -> str:
    if not value["n"]:
        return f"{'none tried':>28s}"
    text = f"{value['right']}/{value['n']}"
    return f"{text:>8s} {100 * value['share']:5.1f} % [{100 * value['low']:4.1f}, {100 * value['high']:5.1f}]"


def number_text(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
