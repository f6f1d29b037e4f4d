"""What the laws' error bars come to at the tip, on the page of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pliant.formatting import fixed, number, small_length, unit_of_field
from pliant.report.document import Cells, Picture, Section, Table, Warned
from pliant.report.figures.tip_cloud import COORDINATES, tip_cloud
from pliant.report.folder import FinishedRun
from pliant.report.reading import ran

TIP = ("tip_x_m", "tip_y_m", "tip_z_m")
TITLE = "From the laws' error bars to the tip"


def uncertainty_section(run: FinishedRun) -> Section | None:
    """The cloud of tips, and intervals of what the task measures; None where the study asks for none."""
    spread, engines = run.uncertainty, ran(run)
    if spread is None or not engines:
        return None
    level, first = f"{100 * float(spread['level']):g} %", engines[0]
    if "tip_mean_m" not in spread:
        text = f"None of {spread['samples']} runs with drawn laws settled, so there is no interval."
        return Section(TITLE, text=(text,))
    failed = f"; {spread['failed']} of them did not settle" if spread["failed"] else ""
    radius = small_length(float(spread["tip_radius_m"]))
    text = (
        f"{level} of {spread['samples']} runs in {first.kind} with laws drawn from their error bars end within "
        f"{radius} of their mean tip{failed}. Modules of one design share one draw. What the laws leave out (friction, "
        "tolerances, the chain itself) is not in it."
    )
    picture = tip_cloud(spread, first.markers_m[-1])
    caption = (
        "Left: tips of the drawn laws, from the tip of the laws themselves, in the two coordinates that vary most. "
        "Right: share of the runs within a distance of their mean."
    )
    pictures = (Picture("tip_cloud", caption, picture),) if picture is not None else ()
    return Section(TITLE, pictures, (_table(spread, run),), text=(text,))


def uncertainty_warnings(run: FinishedRun) -> list[Warned]:
    """Runs with drawn laws that did not settle."""
    spread = run.uncertainty
    if spread is None or not spread["failed"]:
        return []
    return [
        Warned(
            f"{spread['failed']} of {spread['samples']} runs with laws drawn from their error bars did not settle."
        )
    ]


def _table(spread: Mapping[str, Any], run: FinishedRun) -> Table:
    first = ran(run)[0]
    rows: list[Cells] = []
    for k, name in enumerate(COORDINATES):
        ends = [spread["tip_low_m"][k], first.markers_m[-1][k], spread["tip_high_m"][k]]
        half = (ends[2] - ends[0]) / 2
        rows.append([f"tip {name} (mm)", *(fixed(1e3 * float(v), 4) for v in ends), small_length(half)])
    for name, interval in spread.get("metrics", {}).items():
        if name in TIP or not interval["high"] > interval["low"]:
            continue
        label, unit = unit_of_field(name)
        own = first.result.metrics.get(name)
        factor = unit.factor if unit.symbol else 1.0
        cells = [interval["low"], own, interval["high"]]
        texts = [number(float(v) * factor, 5) if isinstance(v, int | float) else "–" for v in cells]
        half = number((interval["high"] - interval["low"]) / 2 * factor, 2)
        rows.append([label.replace("_", " ") + (f" ({unit.symbol})" if unit.symbol else ""), *texts, half])
    level = f"{100 * float(spread['level']):g} %"
    head = ["", f"{level} from", "the laws themselves", "to", "half-width"]
    return Table("Intervals", head, rows)
