"""A calibration as a document: constants of a material with their uncertainty, for terminal and JSON."""

from __future__ import annotations

from typing import Any

from pliant.calibration.result import Calibration
from pliant.formatting import display_unit, number, percent, rounded_to_sd, unit_of
from pliant.report.document import Document, Table, Warned


def calibration_document(title: str, found: Calibration) -> Document:
    """The document of `pliant calibrate`."""
    error = unit_of("nominal_stress_pa" if found.data.kind == "tensile" else found.data.y_name).text(
        found.rmse, 3
    )
    return Document(
        kind="Pliant calibration",
        title=title,
        sentence=(
            f"{len(found.data)} rows, {found.covered}; rms error {error}, {percent(found.rmse_of_range)} of the range."
        ),
        data=_calibration_json(found),
        brief=(_constants_table(found),),
        warnings=tuple(Warned(remark) for remark in found.remarks),
    )


def _calibration_json(found: Calibration) -> dict[str, Any]:
    """The keys of docs/calibrate_a_material.md."""
    data, sd = found.data, found.certainty.sd.tolist()
    return {
        "data": data.source,
        "data_sha256": data.sha256,
        "test": data.kind,
        "material": found.config.kind,
        "parameters": {
            c.name: {"value": c.value, "sd": s, "unit": c.unit}
            for c, s in zip(found.constants, sd, strict=True)
        },
        "correlation": found.certainty.correlation,
        "shear_modulus": {
            "value": found.shear_modulus_pa,
            "sd": found.shear_modulus_sd_pa,
            "unit": "Pa",
        },
        "rmse": found.rmse,
        "rmse_unit": "Pa" if data.kind == "tensile" else data.y_name.rpartition("_")[2],
        "rmse_of_range": found.rmse_of_range,
        "n": len(data),
        "n_effective": found.certainty.n_effective,
        "sd_from": found.certainty.source,
        "range": {data.x_name: [float(data.x.min()), float(data.x.max())]},
        "undetermined": [c.name for c in found.undetermined],
        "converged": found.converged,
        "fem_states": found.fem_states,
        "remarks": list(found.remarks),
    }


def _constants_table(found: Calibration) -> Table:
    rows = [
        [constant.written, *_cells(constant.value, sd, constant.is_modulus)]
        for constant, sd in zip(found.constants, found.certainty.sd.tolist(), strict=True)
    ]
    if len(rows) > 1:
        rows.append(["shear modulus", *_cells(found.shear_modulus_pa, found.shear_modulus_sd_pa, True)])
    return Table("", ["constant", "value", "sd", "unit"], rows)


def _cells(value: float, sd: float, modulus: bool) -> list[str]:
    unit = display_unit("Pa" if modulus else "1")
    return [rounded_to_sd(value * unit.factor, sd * unit.factor), number(sd * unit.factor, 2), unit.symbol]
