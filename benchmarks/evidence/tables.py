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
            rate = _share(shares[kind]) if kind in shares else f"{'':>28s}"
            yield f"  {kind:20s} {rate}  {answers}"
    yield ""
    yield f"Right effect selected        {_share(data['effects'])}"
    if data["effects_not_excited"]:
        yield f"  not excited, left out      {data['effects_not_excited']}"
    for name in ("by_engine", "by_robot"):
        for key, value in data[name].items():
            yield f"  {key:26s} {_share(value)}"
    yield f"False alarms on clean data   {_share(data['false_alarms'])}"
    for key, value in data["false_alarms_by_engine"].items():
        yield f"  {key:26s} {_share(value)}"
    yield f"Unknown effects recognised   {_share(data['unknown'])}"
    yield f"Exact pair of two hidden     {_share(data['pairs'])}"
    yield ""
    yield "By strength (RMS change of the outputs in σ):"
    for band in data["by_snr"]:
        if band["n"]:
            yield f"  {band['above']:.2f} to {band['below']:.2f}             {_share(band)}"
    yield "By protocol (effects that it excites; clean):"
    for name, value in data["by_protocol"].items():
        yield f"  {name:26s} {_share(value['effects'])}  clean {_share(value['clean'])}"
    yield "Ambiguous, never right:"
    for name, value in data["ambiguous"].items():
        yield f"  {name:26s} {_share(value)}"
    credible = data["credible_set"]
    yield f"90 % credible set holds it   {_share(credible['coverage'])}  median size {_number(credible['median_size'])}"
    yield "First hypothesis: probability stated, and share that is true:"
    for row in data["calibration"]:
        if row["n"]:
            yield f"  {row['above']:.2f} to {row['below']:.2f}  stated {row['stated']:.3f}  {_share(row)}"
    wall = data["wall_s"]
    yield f"One diagnosis: median {_number(wall['median'])} s, 90 % below {_number(wall['q90'])} s"
    improve = data["improve"]
    if improve["n"]:
        start, end = improve["start_over_floor"], improve["end_over_floor"]
        yield (
            f"Held-out error over the floor, {improve['n']} sets: before {_number(start['median'])}, after improve "
            f"{_number(end['median'])} (quartiles {_number(end['q25'])} to {_number(end['q75'])}, worst "
            f"{_number(end['worst'])}); right effects {_share(improve['right'])}"
        )


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


def _share(value: dict[str, Any]) -> str:
    if not value["n"]:
        return f"{'none tried':>28s}"
    text = f"{value['right']}/{value['n']}"
    return f"{text:>8s} {100 * value['share']:5.1f} % [{100 * value['low']:4.1f}, {100 * value['high']:5.1f}]"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
