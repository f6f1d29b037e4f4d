"""A posterior and its bands in documents: shares of variance, unidentifiable directions, coverage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pliant.diagnosis.bands import Bands
from pliant.diagnosis.blind import unidentifiable_directions
from pliant.diagnosis.exploration import ENOUGH, FACTOR, OFF, Share, asymmetric_parameter
from pliant.diagnosis.extension import Extension
from pliant.diagnosis.posterior import Posterior
from pliant.formatting import listed, number, output_unit, whole_percent
from pliant.records.measurement import Measurement
from pliant.report.document import Column, Table, brief_table, page_table
from pliant.units import si_unit

OUTPUTS_SHOWN = 3
WIDE = 1.5  # times the noise: a larger error widens the band until it covers any reading
# Deviation of a share from one over the number of parameters below which all are alike: in any fit of identifiable
# parameters each takes the same part of the variance that the noise leaves, Σ of the leverages.
ALIKE = 0.05
Shared = tuple[str, Mapping[str, Share]]  # a parameter, and its shares by output


def posterior_json(posterior: Posterior) -> dict[str, Any]:
    """Return the distribution and its unidentifiable directions: keys of docs/extend_and_improve.md; numbers SI."""
    return {
        "parameters": list(posterior.names),
        "values": posterior.values,
        "sd": posterior.sd,
        "correlation": posterior.correlation,
        "unseen": [asdict(one) for one in unidentifiable_directions(posterior)],
    }


def fitted_posterior_json(extension: Extension) -> dict[str, Any]:
    """Return the same with the spread of the outputs over draws of it."""
    exploration = extension.exploration
    if exploration is None:
        return posterior_json(extension.posterior)
    return {
        **posterior_json(extension.posterior),
        "normal": extension.normal,
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


def bands_json(bands: Bands, measurement: Measurement) -> dict[str, Any]:
    """Return the coverage of the band at its level on a measurement's readings."""
    held, half = bands.held(measurement), bands.half_width()
    outputs = {
        name: {"half_width": half[name], "unit": si_unit(name), "held": held.get(name)} for name in half
    }
    return {"level": bands.level, "outputs": outputs}


def unseen_words(posterior: Posterior) -> list[str]:
    """Return the directions that the data do not determine, in sentences."""
    return [one.words for one in unidentifiable_directions(posterior)]


def posterior_words(extension: Extension) -> list[str]:
    """Return the same, whether the bars are rough, and whether all parameters contribute alike to the prediction."""
    rough = "" if extension.normal is not False else f"The bars are approximate: {_unlike(extension)}."
    shares = extension.exploration.shares if extension.exploration is not None else {}
    alike = shares and len(extension.posterior.names) > 1 and all(map(_alike, shares.values()))
    equal = "The parameters are determined separately: all contribute equally to the uncertainty of the prediction."
    return [*unseen_words(extension.posterior), *([rough] if rough else []), *([equal] if alike else [])]


def _alike(shares: Mapping[str, Share]) -> bool:
    """Return whether all parameters have the same shares, as in any fit of identifiable parameters."""
    equal = 1.0 / len(shares)
    return all(abs(value - equal) <= ALIKE for one in shares.values() for value in (one.first, one.total))


def _unlike(extension: Extension) -> str:
    """Return in what the posterior differs from a normal distribution."""
    exploration, side = (
        extension.exploration,
        asymmetric_parameter(extension.posterior, extension.uncertainty),
    )
    hold = "the 90 % intervals are profiles, which follow that"
    if side is not None:
        way = "up" if side.upwards else "down"
        return (
            f"the posterior of {side.name} is asymmetric, and reaches {side.ratio:.1f} times as far {way} as its bar "
            f"says; {hold}"
        )
    assert exploration is not None
    if exploration.worth < ENOUGH:
        return f"the posterior is so unlike a normal distribution that draws of the latter hardly cover it; {hold}"
    difference = np.maximum(
        np.abs(exploration.off) / OFF, np.abs(np.log(exploration.factor)) / np.log(FACTOR)
    )
    k = int(np.argmax(difference))
    way = "above" if exploration.off[k] > 0 else "below"
    return (
        f"the posterior of {extension.posterior.names[k]} is {exploration.factor[k]:.2f} times as wide as its bar, its "
        f"mean {abs(exploration.off[k]):.1f} bars {way} the best value; {hold}"
    )


def bands_words(bands: Bands, measurement: Measurement, of: str, over_floor: float = np.nan) -> str:
    """Return how many readings are within the band; an empty text where no output has one.

    `over_floor`: the error over its noise. Clearly above 1 the band is as wide as the misfit and covers the readings of
    any model, which the text states.
    """
    held = bands.held(measurement)
    if not held:
        return ""
    texts = [f"{whole_percent(share)} ({output_unit(name).label})" for name, share in held.items()]
    more = f", {len(texts) - OUTPUTS_SHOWN} more outputs in the report" if len(texts) > OUTPUTS_SHOWN else ""
    shown = listed(texts[:OUTPUTS_SHOWN])
    band = f"The {whole_percent(bands.level)} band"
    if over_floor > WIDE:
        return (
            f"{band} is as wide as what the model misses, {number(over_floor, 2)} times the noise: that it holds "
            f"{shown} of the readings of {of}{more} is no evidence for the model."
        )
    return f"{band} holds {shown} of the readings of {of}{more}."


def shares_brief(extension: Extension) -> Table | None:
    """Return each parameter's share of the prediction's variance, for the terminal.

    None with one parameter, if none moves a reading, or if all move them alike.
    """
    columns, rows = _shares(extension)
    return brief_table(columns, rows) if columns else None


def shares_table(extension: Extension) -> Table | None:
    """Return the same for the page."""
    columns, rows = _shares(extension)
    note = (
        "Of the variance that the parameters' uncertainty gives the prediction of these runs: alone, what would go "
        "away if this parameter were known, with all that it implies about the others; beside the others, what would "
        "stay if all others were known. Where the two differ much, parameters are known together and not apart, or act "
        "through one another."
    )
    return page_table("What the prediction depends on", columns, rows, note) if columns else None


def _shares(extension: Extension) -> tuple[tuple[Column[Shared], ...], Sequence[Shared]]:
    exploration = extension.exploration
    if exploration is None or not exploration.shares or len(extension.posterior.names) < 2:
        return (), ()

    def above(name: str) -> float:
        return -exploration.spread.get(name, 0.0) / max(extension.scatter[name].left, 1e-300)

    telling = [name for name, shares in exploration.shares.items() if not _alike(shares)]
    if not telling:
        return (), ()
    outputs = sorted(telling, key=above)[:OUTPUTS_SHOWN]
    rows = [
        (name, {output: exploration.shares[output][name] for output in outputs})
        for name in extension.posterior.names
    ]
    columns: list[Column[Shared]] = [Column("0", "", "parameter", "prediction depends on")]
    for output in outputs:
        for part, head in (("first", "alone"), ("total", "beside the others")):

            def share(row: Shared, output: str = output, part: str = part) -> float:
                return float(getattr(row[1][output], part))

            first = output == outputs[0]
            label = output_unit(output).label
            columns.append(
                Column(share, head=f"{label}, {head}", brief=head if first else "", show=whole_percent)
            )
    return tuple(columns), rows
