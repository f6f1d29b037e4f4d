"""A posterior and its bands in documents: what the prediction depends on, what the data do not see, what bands hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pliant.diagnosis.bands import Bands
from pliant.diagnosis.blind import blind_directions
from pliant.diagnosis.exploration import ENOUGH, FACTOR, OFF, Share, leaning
from pliant.diagnosis.extension import Extension
from pliant.diagnosis.posterior import Posterior
from pliant.formatting import listed, number, unit_of, whole_percent
from pliant.records.measurement import Measurement
from pliant.report.document import Column, Table, brief_table, page_table
from pliant.units import si_unit

OUTPUTS_SHOWN = 3
WIDE = 1.5  # times the noise: an error that widens a band until it holds anything
Shared = tuple[str, Mapping[str, Share]]  # a parameter, and its shares by output


def posterior_json(posterior: Posterior) -> dict[str, Any]:
    """The distribution, and what the data do not see of it: keys of docs/extend_and_improve.md; numbers SI."""
    return {
        "parameters": list(posterior.names),
        "values": posterior.values,
        "sd": posterior.sd,
        "correlation": posterior.correlation,
        "unseen": [asdict(one) for one in blind_directions(posterior)],
    }


def fitted_posterior_json(found: Extension) -> dict[str, Any]:
    """The same with what draws of it read."""
    exploration = found.exploration
    if exploration is None:
        return posterior_json(found.posterior)
    return {
        **posterior_json(found.posterior),
        "normal": found.normal,
        "draws": len(exploration.x),
        "draws_worth": exploration.worth,
        "mean_off": exploration.off,
        "sd_factor": exploration.factor,
        "depends_on": {
            name: {parameter: asdict(share) for parameter, share in shares.items()}
            for name, shares in exploration.shares.items()
        },
        "spread": {
            name: {"value": value, "unit": si_unit(name)} for name, value in exploration.spread.items()
        },
    }


def bands_json(found: Bands, measurement: Measurement) -> dict[str, Any]:
    """What the band at its level held of a measurement's readings."""
    held, half = found.held(measurement), found.half_width()
    outputs = {
        name: {"half_width": half[name], "unit": si_unit(name), "held": held.get(name)} for name in half
    }
    return {"level": found.level, "outputs": outputs}


def unseen_words(posterior: Posterior) -> list[str]:
    """What the data do not see, in sentences."""
    return [one.words for one in blind_directions(posterior)]


def posterior_words(found: Extension) -> list[str]:
    """The same, and whether the bars are rough."""
    rough = "" if found.normal is not False else f"The bars are approximate: {_unlike(found)}."
    return [*unseen_words(found.posterior), *([rough] if rough else [])]


def _unlike(found: Extension) -> str:
    """In what the posterior is unlike a normal distribution."""
    exploration, side = found.exploration, leaning(found.posterior, found.uncertainty)
    hold = "the 90 % intervals are profiles, which follow that"
    if side is not None:
        way = "up" if side.upwards else "down"
        return (
            f"the posterior of {side.name} is lopsided, and reaches {side.ratio:.1f} times as far {way} as its bar "
            f"says; {hold}"
        )
    assert exploration is not None
    if exploration.worth < ENOUGH:
        return f"the posterior is so unlike a normal distribution that draws of one hardly meet it; {hold}"
    told = np.maximum(np.abs(exploration.off) / OFF, np.abs(np.log(exploration.factor)) / np.log(FACTOR))
    k = int(np.argmax(told))
    way = "above" if exploration.off[k] > 0 else "below"
    return (
        f"the posterior of {found.posterior.names[k]} is {exploration.factor[k]:.2f} times as wide as its bar, its "
        f"mean {abs(exploration.off[k]):.1f} bars {way} the best value; {hold}"
    )


def bands_words(found: Bands, measurement: Measurement, of: str, over_floor: float = np.nan) -> str:
    """Return how many readings lie within the band; an empty text where no output has one.

    `over_floor`: the error over its noise. Where it is clearly above it, the band is as wide as the misfit and holds
    the readings whatever the model: that is said.
    """
    held = found.held(measurement)
    if not held:
        return ""
    texts = [f"{whole_percent(share)} ({unit_of(name).label})" for name, share in held.items()]
    more = f", {len(texts) - OUTPUTS_SHOWN} more outputs in the report" if len(texts) > OUTPUTS_SHOWN else ""
    shown = listed(texts[:OUTPUTS_SHOWN])
    band = f"The {whole_percent(found.level)} band"
    if over_floor > WIDE:
        return (
            f"{band} is as wide as what the model misses, {number(over_floor, 2)} times the noise: that it holds "
            f"{shown} of the readings of {of}{more} says nothing for the model."
        )
    return f"{band} holds {shown} of the readings of {of}{more}."


def shares_brief(found: Extension) -> Table | None:
    """What the prediction depends on, for the terminal; None with one parameter, or where none moves a reading."""
    columns, rows = _shares(found)
    return brief_table(columns, rows) if columns else None


def shares_table(found: Extension) -> Table | None:
    """The same for the page."""
    columns, rows = _shares(found)
    note = (
        "Of the variance that the parameters' uncertainty gives the prediction of these runs: alone, what would go "
        "away if this parameter were known, with all that it tells about the others; beside the others, what would "
        "stay if all others were known. Where the two differ much, parameters are known together and not apart, or act "
        "through one another."
    )
    return page_table("What the prediction depends on", columns, rows, note) if columns else None


def _shares(found: Extension) -> tuple[tuple[Column[Shared], ...], Sequence[Shared]]:
    exploration = found.exploration
    if exploration is None or not exploration.shares or len(found.posterior.names) < 2:
        return (), ()

    def above(name: str) -> float:
        return -exploration.spread.get(name, 0.0) / max(found.scatter[name].left, 1e-300)

    outputs = sorted(exploration.shares, key=above)[:OUTPUTS_SHOWN]
    rows = [
        (name, {output: exploration.shares[output][name] for output in outputs})
        for name in found.posterior.names
    ]
    columns: list[Column[Shared]] = [Column("0", "", "parameter", "prediction depends on")]
    for output in outputs:
        for part, head in (("first", "alone"), ("total", "beside the others")):

            def share(row: Shared, output: str = output, part: str = part) -> float:
                return float(getattr(row[1][output], part))

            first = output == outputs[0]
            label = unit_of(output).label
            columns.append(
                Column(share, head=f"{label}, {head}", brief=head if first else "", show=whole_percent)
            )
    return tuple(columns), rows
