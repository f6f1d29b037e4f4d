"""A tapered silicone tentacle that two tendons pull: which effect explains what its stated numbers do not?

python -m benchmarks.real.tentacle [--page]    prints, and writes benchmarks/out/tentacle.json

The chain follows from what the authors state (two cones, modulus, density, tendons parallel to the surface, pulley of
the motors): 15 hinges, each with the compliance ∫ ds/EI and the mass of its piece, the tendon's distance as its arm.
One tendon is pulled at a time and the base axis is along gravity, so that the body bends in the tendon's plane, to
which the base is turned. Read is the tip, whose place on the body is sure. Shapes that nothing is fitted to were drawn
from the names (`held_out.py`) before anybody had plotted one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from benchmarks.output import write
from benchmarks.real.held_out import held_out
from benchmarks.real.recordings import (
    Row,
    finish,
    first_sentence,
    improved,
    publish,
    read_runs,
    residuals,
    run_script,
    table,
    write_rows,
)

import pliant
from pliant.notebook.study import StudyHandle
from pliant.records.design import Array

matplotlib.use("Agg")
import matplotlib.pyplot as plt

FILE = "tendon_tentacle.csv"
# Stated by the authors; the last number of a cone is into how many modules it is cut.
CONES = ((0.305, 0.01541, 0.00642, 12), (0.055, 0.00642, 0.00480, 3))
MODULUS_PA, DENSITY_KG_M3 = 505e3, 1500.0
TENDON_M, SLOPE, TENDON_END_M = 0.0114, -0.0295, 0.305
PULLEY_M = 0.0325  # of the motors, whose unit is their torque in N·m
BASE_MARKER_M = np.array([0.03, 0.0, -0.013])  # in the world of the study: the base at 0, z up
# From the plate's marker to markers 1, 2, 3, 4, of their places as stated: 129.1, 219.5, 280 and 368 mm along the body
# and 25, −21, 20 and 0 mm across it.
APART_M = np.array([0.1162, 0.1014, 0.0731, 0.0902])
TENDON_YAW = {"m1": np.pi / 3, "m2": -np.pi / 3}  # of the planes at 30° and 150°
TIP_MARKER_M, LENGTH_M = 0.008, 0.36
SIGMA_M = 0.003
AXES = "xyz"
STUDY = """
pliant: 1
name: tentacle
surrogate: {law}
chain:
  segments:
{segments}
physics: quasistatic
measurements:
  file: seen.csv
  markers: [{length}]
  marker_offsets: [[{beyond}, 0, 0]]
  sigma: {{marker_1_x_m: {sigma}, marker_1_y_m: {sigma}, marker_1_z_m: {sigma}}}
"""


def main() -> None:
    run_script([FILE], __doc__, bench)


def bench(folder: Path, page: bool) -> None:
    """Diagnose and improve on the training shapes, score on the others, and also fit with a free density."""
    shapes = {name: marker_positions(rows) for name, rows in read_runs([FILE]).items()}
    unseen = held_out([[name for name in shapes if name.startswith(motor)] for motor in TENDON_YAW], (2, 1))
    seen = [name for name in shapes if name not in unseen]
    for name, chosen in (("seen.csv", seen), ("unseen.csv", unseen)):
        write_rows(folder / name, [shape_row(run, shapes[run]) for run in chosen])
    path = folder / "tentacle.yaml"
    path.write_text(study_text(MODULUS_PA, DENSITY_KG_M3))
    study = pliant.open(path, store=folder / "store")
    found, final = improved(study, folder / "tentacle_improved.yaml")
    models = {"as stated": study}
    for step in found.steps[1:]:
        models[f"+ {step.named}"] = study.with_({"effects": [e.canonical() for e in step.effects]})
    floated, density = floating(study)
    models["stiffness and density float (no step of improve)"] = floated
    errors = {name: distances(model, folder) for name, model in models.items()}
    first, last = str(study.diagnose()), str(final.diagnose())
    rows = [[name, *numbers(of, seen, unseen)] for name, of in errors.items()]
    values = {} if found.final is None else dict(found.final.values)
    print(
        "\n".join([*map(" | ".join, rows), first, last, str(values), str(density), found.stop, found.reason])
    )
    write(
        "tentacle",
        {
            "unseen": unseen,
            "errors_m": errors,
            "values": values,
            "floating": density,
            "steps": [step.named for step in found.steps],
            "causes": [step.cause for step in found.steps],
            "stop": found.stop,
            "reason": found.reason,
            "diagnosis": first,
            "diagnosis_at_the_end": last,
        },
    )
    if page:
        draw(folder, shapes, {"as stated": study, "improved": final}, unseen)
        publish("tentacle", page_lines(rows, unseen, found, values, density, first, last))


def marker_positions(rows: Sequence[Row]) -> Array:
    """Return (4, 3) mean places of markers 1 to 4 in the study's world, m.

    The names in the file change from run to run. The marker on the plate is the highest one; the others are in the
    order in which they are as far apart as stated, as nearly as bending allows.
    """
    camera = np.mean(
        [[[float(row[f"marker_{k}_{c}_m"]) for c in AXES] for k in range(5)] for row in rows], axis=0
    )
    plate = int(np.argmin(camera[:, 1]))
    across = camera - camera[plate]
    world = np.stack([across[:, 0], across[:, 2], -across[:, 1]], axis=1) + BASE_MARKER_M
    others = [k for k in range(5) if k != plate]

    def odd(order: Sequence[int]) -> float:
        steps = np.linalg.norm(np.diff(world[[plate, *order]], axis=0), axis=1)
        return float(np.linalg.norm(steps - APART_M))

    return np.asarray(world[list(min(permutations(others), key=odd))])


def tension_n(run: str) -> float:
    """Return the tendon's nominal tension: `m1_u018` is 0.18 N·m at the pulley."""
    digits = run.partition("_u")[2]
    return float(f"{digits[0]}.{digits[1:]}") / PULLEY_M


def shape_row(run: str, shape: Array) -> dict[str, Any]:
    """Return the row of a shape in Pliant's format."""
    place = {f"marker_1_{axis}_m": value for axis, value in zip(AXES, shape[3], strict=True)}
    return {"run": run, "tendon_force_n": tension_n(run), "base_yaw_rad": TENDON_YAW[run[:2]], **place}


def study_text(modulus_pa: float, density_kg_m3: float) -> str:
    """Return the study of the stated cones."""
    segments, start, law = [], 0.0, ""
    for length, wide, narrow, count in CONES:
        piece = length / count
        for k in range(count):
            share = np.linspace(k / count, (k + 1) / count, 101)
            radius = wide + (narrow - wide) * share
            stiffness = 1.0 / np.trapezoid(piece / (modulus_pa * np.pi * radius**4 / 4), share * count)
            mass = density_kg_m3 * np.pi * piece * float(np.trapezoid(radius**2, share * count))
            at = start + (k + 0.5) * piece
            arm = TENDON_M + SLOPE * at if at < TENDON_END_M else 0.0
            law = (
                "{kind: polynomial, form: study, actuation_name: tendon_force_n, coefficients: "
                f"{{k_n: {arm:.6g}, m_a: 0, m_e: 0, b_e: {stiffness:.6g}}}}}"
            )
            segments.append(
                f"    - {{modules: 1, module_length: {piece:.8g}, module_mass: {mass:.6g}, surrogate: {law}}}"
            )
        start += length
    return STUDY.format(
        law=law, segments="\n".join(segments), length=LENGTH_M, beyond=TIP_MARKER_M, sigma=SIGMA_M
    )


def floating(study: StudyHandle) -> tuple[StudyHandle, dict[str, float]]:
    """Fit modulus and density without constraints, for comparison; return the study and the values."""
    found = study.extend("stiffness", "gravity_scale")
    values = dict(found.record.fit.values)
    told = {"modulus_pa": MODULUS_PA * values["stiffness.factor"]}
    told["density_kg_m3"] = DENSITY_KG_M3 * values["gravity_scale.factor"]
    return study.with_({"effects": [e.canonical() for e in found.record.effects]}), told | values


def distances(model: StudyHandle, folder: Path) -> dict[str, float]:
    """Return the distance between measured and simulated tip by run, m."""
    found = {}
    for name in ("seen.csv", "unseen.csv"):
        for run, outputs in residuals(model, folder / name).items():
            found[run] = float(np.linalg.norm([values[0] for values in outputs.values()]))
    return found


def numbers(errors: Mapping[str, float], seen: Sequence[str], unseen: Sequence[str]) -> list[str]:
    """Return the RMS over the training shapes, of each unseen shape and over all: mm and share of the length."""
    fitted, apart = (float(np.sqrt(np.mean([errors[run] ** 2 for run in runs]))) for runs in (seen, unseen))
    each = [f"{1e3 * errors[run]:.1f}" for run in unseen]
    return [f"{1e3 * fitted:.1f}", *each, f"**{1e3 * apart:.1f}** ({apart / LENGTH_M:.1%})"]


def page_lines(
    rows: list[list[str]],
    unseen: Sequence[str],
    found: Any,
    values: Mapping[str, float],
    density: Mapping[str, float],
    first: str,
    last: str,
) -> list[str]:
    """Return the section's table and verdicts."""
    told = ", ".join(f"`{name}` {value:.3g}" for name, value in values.items())
    causes = ", ".join(f"{step.named} ({step.cause})" for step in found.steps[1:])
    heads = [
        "model",
        "seven training shapes",
        *(f"`{run}`" for run in unseen),
        "all three (share of the length)",
    ]
    return [
        f"First diagnosis: {first}",
        "",
        "Distance of the tip, mm, root mean square:",
        "",
        *table(heads, rows),
        f"Added, with how each came about: {causes or 'nothing'}. Values: {told or 'none'}. It stops with "
        f"`{found.stop}`: {first_sentence(found.reason)}",
        "",
        f"With modulus and density floating they become {density['modulus_pa'] / 1e3:.0f} kPa and "
        f"{density['density_kg_m3']:.0f} kg/m³. Diagnosis of what is left: {last}",
        "",
        "![Tips that were kept apart, and the models](pictures/tentacle.png)",
    ]


def draw(
    folder: Path, shapes: Mapping[str, Array], models: Mapping[str, StudyHandle], unseen: Sequence[str]
) -> None:
    """Draw markers of the unseen shapes in the tendon's plane, with the bodies of the models."""
    figure, panels = plt.subplots(1, len(unseen), figsize=(11, 4.4), sharey=True)
    for panel, run in zip(panels, unseen, strict=True):
        yaw = TENDON_YAW[run[:2]]
        toward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        panel.plot(1e3 * shapes[run] @ toward, 1e3 * shapes[run][:, 2], "o", color="black", label="markers")
        for (name, model), colour in zip(models.items(), ("#d98c3f", "#2f6fb0"), strict=True):
            settled = model.with_(
                {"task": {"kind": "free_bending", "tendon_force": tension_n(run)}}
            ).simulate()
            line = settled.markers
            panel.plot(1e3 * line[:, 0], 1e3 * line[:, 2], color=colour, lw=1.6, label=name)
        panel.set_title(f"{run}: {tension_n(run):.1f} N", loc="left", fontsize=10)
        panel.set_xlabel("toward the tendon (mm)")
        panel.set_aspect("equal")
    panels[0].set_ylabel("height (mm)")
    finish(figure, "tentacle")
    plt.close(figure)


if __name__ == "__main__":
    main()
