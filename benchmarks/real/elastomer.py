"""Strips of VHB 4910 under prescribed elongation: relaxation, rate dependence and softening are known to occur.

python -m benchmarks.real.elastomer [--page]    prints, and writes benchmarks/out/elastomer.json

A strip is one prismatic joint whose elongation is prescribed (`held_elongation_strain`) and whose force is read
(`blocked_force_n`, below zero; the source states no unit of stress). The initial model contains only the relaxed
rubber: a neo-Hookean law σ = μ (λ − 1/λ²) fitted to the last 50 s of the training relaxation tests, as a table.
Held-out tests were drawn from the names (`held_out.py`) before any curve was plotted. Every strip is treated as a new
specimen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    publish,
    read_runs,
    residuals,
    rms,
    run_script,
    table,
    write_rows,
)

import pliant
from pliant.records.design import Array

matplotlib.use("Agg")
import matplotlib.pyplot as plt

FILE = "elastomer_strip.csv"
GROUPS = ("cycle_0d01", "cycle_0d03", "relax")
FORCE = "blocked_force_n"
LENGTH_M = 0.08
AT_END_S = 350.0  # of the relaxation tests: fully relaxed within the recording
SAMPLES = 45  # of a test, evenly except in relaxation tests, whose first part is dense
# Effects that a passive strip can have; its supply, base and sensor are not in question.
KINDS = (
    *("viscoelastic", "viscous_damping", "friction_hysteresis", "mullins", "permanent_set", "stiffness"),
    *("bimodulus", "thermal_softening"),
)
LARGEST = 6.0  # stretch that the law's table reaches
TWINS = ("relax_2d5", "relax_3d5", "relax_5d0")  # pulled alike up to the smallest stretch of theirs
STUDY = """
pliant: 1
name: strip
surrogate: {kind: table, data: law.csv}
chain: {modules: 1, module_length: 80 mm, module_mass: 1 g, gravity: [0, 0, 0]}
physics: quasistatic
measurements: {file: seen.csv, sigma: {blocked_force_n: SIGMA}}
"""


def main() -> None:
    run_script([FILE], __doc__, bench)


def bench(folder: Path, page: bool) -> None:
    """Diagnose and improve on the training tests, score on the others."""
    tests = {name: thinned(rows) for name, rows in read_runs([FILE], "test").items()}
    unseen = held_out([[name for name in tests if name.startswith(group)] for group in GROUPS], (1, 1, 1))
    seen = [name for name in tests if name not in unseen]
    modulus, scatter = relaxed_modulus(tests, seen), specimen_scatter(tests)
    write_rows(folder / "law.csv", law_rows(modulus))
    for name, chosen in (("seen.csv", seen), ("unseen.csv", unseen)):
        write_rows(folder / name, [row for test in chosen for row in recording_rows(test, tests[test])])
    path = folder / "strip.yaml"
    path.write_text(STUDY.replace("SIGMA", f"{scatter:.3g}"))
    study = pliant.open(path, store=folder / "store")
    found = study.improve(effects=KINDS).record
    models = {"relaxed rubber alone": study}
    for step in found.steps[1:]:
        models[f"+ {step.named}"] = study.with_({"effects": [e.canonical() for e in step.effects]})
    errors = {
        name: {
            t: e[FORCE]
            for part in ("seen.csv", "unseen.csv")
            for t, e in residuals(model, folder / part).items()
        }
        for name, model in models.items()
    }
    rows = table_rows(errors, seen, unseen)
    print(
        "\n".join(
            [
                f"modulus {modulus:.2f}, scatter {scatter:.2f}",
                *map(" | ".join, rows),
                *(step.why for step in found.steps),
            ]
        )
    )
    values = {} if found.final is None else dict(found.final.values)
    print(values, found.stop, found.reason)
    write(
        "elastomer",
        {
            "modulus": modulus,
            "scatter": scatter,
            "unseen": unseen,
            "errors": {name: {t: rms(e) for t, e in of.items()} for name, of in errors.items()},
            "causes": [step.cause for step in found.steps],
            "values": values,
            "stop": found.stop,
            "reason": found.reason,
            "why": [step.why for step in found.steps],
        },
    )
    if page:
        draw(tests, errors, unseen)
        publish("elastomer", page_lines(rows, found, values, scatter))


def thinned(rows: Sequence[Row]) -> dict[str, Array]:
    """Return time_s, stretch, stress (n,) of a test, downsampled; of a hold the first samples, then fewer."""
    columns = {key: np.array([float(row[key]) for row in rows]) for key in ("time_s", "stretch", "stress")}
    n = len(rows)
    at = np.arange(n) if n <= SAMPLES else np.linspace(0, n - 1, SAMPLES).round().astype(int)
    if n > 8 * SAMPLES and np.ptp(columns["stretch"][n // 2 :]) < 1e-3:
        at = np.unique(np.concatenate([np.arange(24), np.geomspace(24, n - 1, 26).round().astype(int)]))
    return {key: values[at] for key, values in columns.items()}


def relaxed_modulus(tests: Mapping[str, Mapping[str, Array]], seen: Sequence[str]) -> float:
    """Fit μ of σ = μ (λ − 1/λ²) by least squares at the ends of the training relaxation tests."""
    ends = [tests[name] for name in seen if name.startswith("relax")]
    late = [(t["stretch"][t["time_s"] > AT_END_S], t["stress"][t["time_s"] > AT_END_S]) for t in ends]
    form = np.array([np.mean(stretch - stretch**-2) for stretch, _ in late])
    stress = np.array([np.mean(values) for _, values in late])
    return float(form @ stress / (form @ form))


def specimen_scatter(tests: Mapping[str, Mapping[str, Array]]) -> float:
    """Return the standard deviation of strips with the same test, over their common part."""
    top = min(float(tests[name]["stretch"].max()) for name in TWINS)
    grid = np.linspace(1.1, top - 0.1, 30)
    pulls = []
    for name in TWINS:
        up = int(np.argmax(tests[name]["stretch"])) + 1
        pulls.append(np.interp(grid, tests[name]["stretch"][:up], tests[name]["stress"][:up]))
    return float(np.sqrt(np.mean(np.var(np.array(pulls), axis=0, ddof=1))))


def law_rows(modulus: float) -> list[dict[str, float]]:
    """Return the relaxed law as a table; the chain has an input, a force that stays at 0."""
    stretches = np.concatenate([np.linspace(0.7, 2.0, 27), np.linspace(2.1, LARGEST, 40)])
    pulls = {
        (force, stretch): force - modulus * (stretch - stretch**-2)
        for force in (0.0, 50.0)
        for stretch in stretches
    }
    return [
        {"tendon_force_n": force, "extension_m": LENGTH_M * (stretch - 1), "force_n": pull}
        for (force, stretch), pull in pulls.items()
    ]


def recording_rows(name: str, test: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Return the rows of a test in Pliant's format: a separate specimen, its force below zero."""
    return [
        {"run": name, "specimen": name, "time_s": t, "held_elongation_strain": stretch - 1, FORCE: -stress}
        for t, stretch, stress in zip(*(test[key] for key in ("time_s", "stretch", "stress")), strict=True)
    ]


def table_rows(
    errors: Mapping[str, Mapping[str, Array]], seen: Sequence[str], unseen: Sequence[str]
) -> list[list[str]]:
    """Return model, rms error over the training tests, and that of each held-out test."""
    rows = []
    for name, of in errors.items():
        whole = rms(np.concatenate([of[test] for test in seen]))
        apart = rms(np.concatenate([of[test] for test in unseen]))
        rows.append([name, f"{whole:.2f}", *(f"{rms(of[test]):.2f}" for test in unseen), f"**{apart:.2f}**"])
    return rows


def page_lines(rows: list[list[str]], found: Any, values: Mapping[str, float], scatter: float) -> list[str]:
    """Return the section's table and verdicts."""
    apart = held_words(rows)
    told = ", ".join(f"`{name}` {value:.3g}" for name, value in values.items())
    causes = ", ".join(f"{step.named} ({step.cause})" for step in found.steps[1:])
    return [
        "Root mean square error of the stress, in the source's unit:",
        "",
        *table(["model", "nine training tests", *apart, "all three kept apart"], rows),
        f"Added, with how each came about: {causes or 'nothing'}. Values: {told or 'none'}. It stops with "
        f"`{found.stop}`: {first_sentence(found.reason)}",
        "",
        f"Strips that were pulled alike differ by {scatter:.2f} (standard deviation), which is stated as sigma.",
        "",
        "![Measured and predicted stress of the tests that were kept apart](pictures/elastomer.png)",
    ]


def held_words(rows: list[list[str]]) -> list[str]:
    """Return heads of the held-out tests."""
    names = held_out([NAMES[group] for group in GROUPS], (1, 1, 1))
    assert len(rows[0]) == len(names) + 3
    return [f"`{name}`" for name in names]


STRETCHES = {"cycle": ("1d5", "2d0", "2d5", "3d0"), "relax": ("1d5", "2d5", "3d5", "5d0")}
NAMES = {group: [f"{group}_{end}" for end in STRETCHES[group.partition("_")[0]]] for group in GROUPS}


def draw(
    tests: Mapping[str, Mapping[str, Array]],
    errors: Mapping[str, Mapping[str, Array]],
    unseen: Sequence[str],
) -> None:
    """Draw the held-out tests: stress over stretch or time, by the first and the last model."""
    figure, panels = plt.subplots(1, len(unseen), figsize=(11, 3.6))
    first, *_, last = errors
    for panel, name in zip(panels, unseen, strict=True):
        test, holds = tests[name], name.startswith("relax")
        across = test["time_s"] if holds else test["stretch"]
        panel.plot(across, test["stress"], color="black", lw=1.4, label="measured")
        for label, colour in ((first, "#d98c3f"), (last, "#2f6fb0")):
            model = test["stress"] + errors[label][name]
            panel.plot(across, model, color=colour, lw=1.2, label="improved" if label == last else label)
        if holds:
            panel.set_xscale("symlog", linthresh=1.0)
        panel.set_xlabel("time (s)" if holds else "stretch")
        panel.set_title(name, loc="left", fontsize=10)
    panels[0].set_ylabel("stress (unit not stated)")
    finish(figure, "elastomer")
    plt.close(figure)


if __name__ == "__main__":
    main()
