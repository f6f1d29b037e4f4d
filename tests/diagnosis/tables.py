"""Evidence tables with values set by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from pliant.diagnosis.evidence_table import EvidenceTable, Kinds, Row
from pliant.diagnosis.noise import NoiseView


def row(kinds: Kinds, square: float, n_parameters: int | None = None, heldout: float | None = None) -> Row:
    """Return a hypothesis with this mean square; errors on unseen runs are a little larger."""
    left = 1.01 * square if heldout is None else heldout
    values = {
        "kinds": kinds,
        "n_parameters": len(kinds) if n_parameters is None else n_parameters,
        "mean_square": square,
        "heldout_square": left,
        "unseen_square": left,
        "unseen": (left,),
        "at_limit": (),
        "form_price": 0.0,
        "squares": (),
        "law_price": 0.0,
        "raw_square": float("nan"),
        "prior_price": 0.0,
        "imitated_price": 0.0,
    }
    return Row(**{field.name: values[field.name] for field in fields(Row)})  # type: ignore[arg-type]


def table(
    squares: Mapping[Kinds, float],
    *,
    n: float = 200.0,
    floor: float = 1.0,
    judged: bool = True,
    slip: float = 1.0,
    readings: int = 1000,
) -> EvidenceTable:
    """Return a table of mean squares by hypothesis."""
    noise = NoiseView({}, n, floor, judged, slip)
    return EvidenceTable({kinds: row(kinds, square) for kinds, square in squares.items()}, noise, readings)
