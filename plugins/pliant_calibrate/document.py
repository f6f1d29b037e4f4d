"""A calibration as a document: constants of a material with their uncertainty, for terminal and JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pliant.formatting import display_unit, number, output_unit, percent, rounded_to_sd
from pliant.report.document import Document, Table, Warned
from pliant_calibrate.result import Calibration
from pliant_calibrate.volume import Volume


def calibration_document(title: str, calibration: Calibration) -> Document:
    """Return the document of `pliant calibrate`; its JSON by the keys of docs/calibrate_a_material.md."""
    data, tensile = calibration.data, calibration.data.kind == "tensile"
    constants = list(zip(calibration.constants, calibration.certainty.sd.tolist(), strict=True))
    rows = [[one.written, *_cells(one.value, sd, one.is_modulus)] for one, sd in constants]
    if len(rows) > 1:
        rows.append(
            ["shear modulus", *_cells(calibration.shear_modulus_pa, calibration.shear_modulus_sd_pa, True)]
        )
    error = output_unit("nominal_stress_pa" if tensile else data.y_name).text(calibration.rmse, 3)
    whole = f"rms error {error}, {percent(calibration.rmse_of_range)} of the range."
    shear = {"value": calibration.shear_modulus_pa, "sd": calibration.shear_modulus_sd_pa, "unit": "Pa"}
    return Document(
        kind="Pliant calibration",
        title=title,
        sentence=f"{len(data)} rows, {calibration.covered}; {whole} {calibration.volume.sentence}{_near(calibration)}",
        data={
            "data": data.source,
            "data_sha256": data.sha256,
            "test": data.kind,
            "material": calibration.config.kind,
            "parameters": {c.name: {"value": c.value, "sd": sd, "unit": c.unit} for c, sd in constants},
            "correlation": calibration.certainty.correlation,
            "shear_modulus": shear,
            "volume": _volume(calibration.volume),
            "nearest": [{"name": n.preset.name, "stiffness_ratio": n.stiffness} for n in calibration.nearest],
            "rmse": calibration.rmse,
            "rmse_unit": "Pa" if tensile else data.y_name.rpartition("_")[2],
            "rmse_of_range": calibration.rmse_of_range,
            "n": len(data),
            "n_effective": calibration.certainty.n_effective,
            "sd_from": calibration.certainty.source,
            "range": {data.x_name: [float(data.x.min()), float(data.x.max())]},
            "undetermined": [c.name for c in calibration.undetermined],
            "converged": calibration.converged,
            "fem_states": calibration.fem_states,
            "remarks": list(calibration.remarks),
        },
        brief=(Table("", ["constant", "value", "sd", "unit"], rows),),
        warnings=tuple(map(Warned, calibration.remarks)),
    )


def _near(calibration: Calibration) -> str:
    """Return a sentence on the nearest named rubbers, an empty one where none is near."""
    names = [f"{one.preset.name} ({one.stiffness:.2f} × as stiff)" for one in calibration.nearest]
    return f" Nearest named materials: {', '.join(names)}." if names else ""


def _volume(volume: Volume) -> dict[str, Any]:
    return {
        "assumption": volume.assumption,
        "poisson_ratio": volume.poisson_ratio,
        "bulk_modulus": {"value": volume.bulk_modulus_pa, "unit": "Pa"},
        "end_of_data": {mode: asdict(end) for mode, end in volume.ends.items()},
        "modulus_change_if_incompressible": volume.modulus_change,
    }


def _cells(value: float, sd: float, modulus: bool) -> list[str]:
    unit = display_unit("Pa" if modulus else "1")
    return [rounded_to_sd(value * unit.factor, sd * unit.factor), number(sd * unit.factor, 2), unit.symbol]
