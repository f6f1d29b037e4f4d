"""A study and a bench CSV with chosen effects, written as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tests.diagnosis.quick import BENCH, REGISTRY, blank, colour, make_measurement, ramp

from pliant.config.loading import load_study
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.records.history import History
from pliant.records.measurement import Measurement

STUDY = """\
# a joint on the bench
pliant: 1
name: joint
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, m_e: 0.1012, b_e: 0.0245}
law_error: 0.2 %  # it is exact
chain: {modules: 1, module_length: 80 mm, module_mass: 40 g}  # heavy
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa}
"""
SIGMA = 5e-3
PRESSURE = 15e3


def histories(repeats: int = 2) -> list[History]:
    """Return six conditions, each repeated `repeats` times."""
    levels = (0.4 * PRESSURE, 0.0, 0.7 * PRESSURE, 0.0, PRESSURE, 0.0, PRESSURE, 0.0)
    found = []
    for k in range(repeats):
        body = {"specimen": "ABC"[k]}
        found += [
            ramp(f"virgin{k}", 3e3, 0.5, levels, **body),
            ramp(f"slow{k}", 500.0, 1.0, **body),
            ramp(f"fast{k}", 15e3, 0.1, (PRESSURE, 0.0, PRESSURE, 0.0), **body),
            ramp(f"half{k}", 2e3, 0.5, (0.5 * PRESSURE, 0.0, 0.5 * PRESSURE, 0.0), **body),
            ramp(f"level{k}", 3e3, 0.5, base_angles_rad=[0.0, np.pi / 2, 0.0], **body),
            ramp(f"pressed{k}", 3e3, 0.5, moment_n_m=6e-3, **body),
        ]
    return found


def study(folder: Path, text: str = STUDY, name: str = "joint.yaml"):
    """Write the study and return it as read."""
    path = folder / name
    path.write_text(text)
    return load_study(path, REGISTRY)


def bench(
    folder: Path,
    *effects: EffectConfig,
    text: str = STUDY,
    seed: int = 0,
    runs: Sequence[History] | None = None,
) -> Measurement:
    """Return readings of a bench with these effects: the study's model, coloured noise, small offsets between runs."""
    rng = np.random.default_rng(seed)
    driven = histories() if runs is None else list(runs)
    truth = Predictor.from_study(BENCH, study(folder, text, "truth.yaml"), blank(driven)).predict(effects)
    readings = [
        {
            name: values + colour(rng, len(values), SIGMA, 0.6) + rng.normal(0, 0.1 * SIGMA)
            for name, values in run.items()
        }
        for run in truth
    ]
    return make_measurement(driven, readings)


def csv(measurement: Measurement) -> str:
    """Return the measurement as the CSV text that a bench writes."""
    lines = ["run,specimen,time_s,pressure_pa,moment_n_m,base_pitch_rad,angle_rad"]
    for run in measurement.runs:
        h = run.history
        assert h.time_s is not None
        for i, time in enumerate(h.time_s):
            lines.append(
                f"{run.name},{h.specimen},{time:.3f},{h.actuation['pressure_pa'][i]:.3f},{h.moment_n_m[i]:.6f},"
                f"{h.base_angles_rad[i, 1]:.6f},{run.outputs['angle_rad'][i]:.6f}"
            )
    return "\n".join(lines) + "\n"
