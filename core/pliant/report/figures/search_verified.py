"""What the laws of the search predicted, beside what laws fitted to FEM of the design itself say."""

from __future__ import annotations

import textwrap

from pliant.report.figures import style
from pliant.report.figures.success_shares import Series, success_shares
from pliant.report.search_view import SearchView

MOST = 4  # metrics that get a panel
NO_RESULT = ("trials", "outside_domain")  # of the check, but nothing that it measures


def search_verified(read: SearchView) -> style.Png | None:
    """A panel per metric, a row per engine; None where nothing was verified."""
    found = read.result.verification
    if found is None:
        return None
    names = checked_metrics(read)[:MOST]
    engines = [e for e in found.verified if e in found.predicted]
    if not names or not engines:
        return None
    with style.canvas(max(430 * len(names), 900), 130 + 90 * len(engines) + 60, pad=(0.08, 0.06)) as figure:
        for axes, name in zip(
            figure.subplots(1, len(names), squeeze=False, sharey=True)[0], names, strict=True
        ):
            label, unit = read.metric(name)
            for row, engine in enumerate(engines):
                pair = [
                    float(side[engine].get(name, float("nan"))) * unit.factor
                    for side in (found.predicted, found.verified)
                ]
                axes.plot(pair, [row, row], color=style.FAINT, lw=3, zorder=1)
                first = row == 0 and name == names[0]
                axes.plot(
                    pair[0],
                    row,
                    "o",
                    ms=9,
                    mfc="white",
                    mew=1.8,
                    color=style.SERIES[0],
                    label="predicted" if first else None,
                )
                axes.plot(
                    pair[1],
                    row,
                    "D",
                    ms=8,
                    color=style.WARN,
                    label=("verified by direct FEM" if found.laws else "simulated again") if first else None,
                )
            axes.set_yticks(range(len(engines)), engines)
            axes.set_ylim(len(engines) - 0.5, -0.5)
            axes.margins(x=0.25)
            axes.locator_params(axis="x", nbins=4)
            axes.set_title(textwrap.fill(f"{label} ({unit.symbol})" if unit.symbol else label, 28))
        figure.legend(loc="outside lower center", ncols=2)
        return style.png(figure)


def checked_metrics(read: SearchView) -> list[str]:
    """Metrics with a prediction and a check in one engine, that of the objective first."""
    found = read.result.verification
    if found is None:
        return []
    both = {
        n: None for e, metrics in found.verified.items() for n in metrics if n in found.predicted.get(e, {})
    }
    known = [n for n in both if n not in NO_RESULT]
    return sorted(known, key=lambda name: name != read.objective_metric)


def success_counts(read: SearchView) -> dict[str, dict[str, tuple[int, int]]]:
    """Engine → condition → (stable grasps, trials); empty where no whole number of trials says so."""
    found = read.result.verification
    if found is None:
        return {}
    counts: dict[str, dict[str, tuple[int, int]]] = {}
    for engine, conditions in found.conditions.items():
        for name, metrics in conditions.items():
            share, trials = metrics.get("success_share"), read.trials(metrics)
            if share is None or not trials or abs(share * trials - round(share * trials)) > 1e-6:
                return {}
            counts.setdefault(engine, {})[name or "all trials"] = (round(share * trials), trials)
    return counts


def search_successes(read: SearchView) -> style.Png | None:
    """Success of every condition in every engine with the interval of counting; None where nothing is counted."""
    counts = success_counts(read)
    conditions = list(dict.fromkeys(name for one in counts.values() for name in one))
    series = [
        Series(engine, [one[c] for c in conditions], [True] * len(conditions))
        for engine, one in counts.items()
        if all(c in one for c in conditions)
    ]
    return success_shares(conditions, series[0], series[1:]) if series else None
