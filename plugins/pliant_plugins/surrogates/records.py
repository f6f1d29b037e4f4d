"""What all fitted laws share: the choice of a stable one, and their records: joint, axes, actuation, box, error bar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, JointLaw, LawRecord

# Stability may cost this factor and share of the effort's range; snap-through that is in the data costs more.
PRICE = (3.0, 2e-3)


def affordable(error: float) -> float:
    """Return the relative error up to which a stable law counts as about as good as one of `error`."""
    return PRICE[0] * error + PRICE[1]


def stable_choice(errors: Sequence[float], slopes: Sequence[float]) -> int:
    """Return the index of the best stable law (largest ∂τ/∂u < 0) if it is about as good as the best, else the best."""
    best = int(np.argmin(errors))
    limit = affordable(errors[best])
    stable = [k for k, slope in enumerate(slopes) if slope < 0 and errors[k] <= limit]
    return min(stable, key=lambda k: errors[k]) if stable else best


def law_record(kind: str, law: JointLaw, arrays: Mapping[str, Array], **values: Any) -> LawRecord:
    """Return the record of a law: its own arrays and values and the shared ones."""
    shared = {
        "domain_actuation": law.domain.actuation,
        "domain_deformation": law.domain.deformation,
        **(law.error.arrays() if isinstance(law.error, ErrorBar) else {}),
    }
    named = {"joint": law.joint, "axes": list(law.axes), "actuation_name": law.actuation_name}
    return LawRecord(kind, {**named, **values}, {**arrays, **shared})


def require_kind(record: LawRecord, kind: str) -> None:
    """Raise `UserError` for the record of another surrogate."""
    if record.kind != kind:
        raise UserError(f"surrogate '{kind}' cannot read a law of kind '{record.kind}'")


def shared_fields(record: LawRecord) -> dict[str, Any]:
    """Return the shared attributes of the law of a record, by name."""
    arrays, values = record.arrays, record.values
    box = (np.asarray(arrays[f"domain_{side}"], float) for side in ("actuation", "deformation"))
    return {
        "domain": Domain(*box),
        "axes": tuple(values["axes"]),
        "joint": values["joint"],
        "actuation_name": str(values["actuation_name"]),
        "error": ErrorBar.from_arrays(arrays),
    }


def float_arrays(record: LawRecord, *names: str) -> dict[str, Any]:
    """Return arrays of a record as floating-point numbers, by name."""
    return {name: np.asarray(record.arrays[name], float) for name in names}
