"""The tables and pictures of docs/studies/shape_matching.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from benchmarks.studies.bars import bar_rows
from benchmarks.studies.machine import state_words
from benchmarks.studies.published import SOURCE
from benchmarks.studies.shape_bars import METRICS, apart, engines, of_check
from benchmarks.studies.shape_pictures import backbones, history, strip
from benchmarks.studies.spoken import clock, millimetres, percent

from pliant.formatting import quantity

Result = dict[str, Any]


def state(result: Result) -> Iterator[str]:
    """When a study has run: on what."""
    yield state_words(result)


def reached(result: Result) -> Iterable[str]:
    """What was to be reached."""
    return bar_rows(result["bars"])


def runs(result: Result) -> Iterator[str]:
    """Every search, and the published figures below."""
    yield (
        "| search | candidates | wall time, search only | in kernels | predicted RMSE / e_max | verified | "
        "verified, other engine | apart | joints outside their data at any level, predicted / verified |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for name, run in result["runs"].items():
        own, others = run["engine"], [e for e in engines(run) if e != run["engine"]]
        second = "; ".join(f"{_both(run, e, 'engines')} ({e})" for e in others) or "–"
        stored = " (searched before; kernel timed later)" if run["from_store"] else ""
        yield (
            f"| `{name}`: {run['words']} | {run['evaluations']} | {clock(run['wall_s'])} | "
            f"{run['wall_in_kernels']:.0f}{stored} | {_both(run, own, 'predicted')} | {_both(run, own, 'engines')} | "
            f"{second} | {millimetres(apart(run))} | {_outside(run, 'predicted')} / {_outside(run, 'engines')} |"
        )
    given = result["published"]
    times = given["our_estimates"]
    yield (
        f"| published ({SOURCE}), roll fixed | | about {clock(times['evaluations_wall_s'])}; of generations "
        f"{clock(times['generations_wall_s'])}: estimates of ours | | "
        f"{_figures(given)} | {_figures(given['verified'])} | – | "
        f"{millimetres(given['verified']['rmse_m'] - given['rmse_m'])} | – |"
    )


def laws(result: Result) -> Iterator[str]:
    """What the laws of the searches missed of direct FEM of the winners."""
    yield "| search | design | FEM states | RMS, of the range | at worst | RMS, of the largest effort |"
    yield "|---|---|---|---|---|---|"
    for name, run in result["runs"].items():
        for law in (run["verified"] or {}).get("laws", ()):
            cells = (law.get(key) for key in ("rmse_of_range", "worst_of_range", "rmse_of_largest"))
            shares = " | ".join(percent(cell) for cell in cells)
            yield f"| `{name}` | {law['name']} | {law['n_states']} | {shares} |"


def best(result: Result) -> Iterator[str]:
    """The winners' values, one column per search."""
    shown = result["runs"]
    units = {name: unit for run in shown.values() for name, unit in run["units"].items()}
    names = list(dict.fromkeys(name for run in shown.values() for name in run["best"]["values"]))
    yield f"| variable | {' | '.join(f'`{name}`' for name in shown)} |"
    yield f"|---|{'---|' * len(shown)}"
    for name in names:
        cells = (_value(run["best"]["values"].get(name), units.get(name, "")) for run in shown.values())
        yield f"| {name} | {' | '.join(cells)} |"


def picture(
    label: str, words: str, drawn: Callable[[Result], bytes | None]
) -> Callable[[Result], Iterator[str]]:
    """A mark that shows a picture where there is one."""

    def lines(result: Result) -> Iterator[str]:
        if drawn(result) is not None:
            yield f"![{words}](shape_matching_{label}.png)"

    return lines


PICTURES: Mapping[str, Callable[[Result], bytes | None]] = {
    "backbones": backbones,
    "history": history,
    "structures": strip,
}
TABLES: Mapping[str, Callable[[Result], Iterable[str]]] = {
    "state": state,
    "reached": reached,
    "runs": runs,
    "laws": laws,
    "best": best,
    "backbones": picture(
        "backbones", "Backbone of the winners against the target, three projections", backbones
    ),
    "history": picture("history", "Best so far of every structure", history),
    "structures": picture("structures", "Best of every structure", strip),
}


def _both(run: Mapping[str, Any], engine: str, what: str) -> str:
    return " / ".join(millimetres(of_check(run, metric, engine, what)) for metric in METRICS)


def _outside(run: Mapping[str, Any], what: str) -> str:
    count = of_check(run, "outside_domain", what=what)
    return "–" if count is None else f"{count:.0f}"


def _figures(figures: Mapping[str, Any]) -> str:
    return " / ".join(millimetres(figures[metric]) for metric in METRICS)


def _value(value: Any, unit: str) -> str:
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) and not unit else quantity(value, unit, 4)
