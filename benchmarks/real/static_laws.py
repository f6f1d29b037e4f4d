"""The two runs of a measured bending actuator with opposed bellows, as Pliant reads them, and static laws of them.

`../shared/data/measured/two_bellow_bending.csv`: 12.5 readings a second, pressures at the pumps, the tip's angle from
a camera. Chamber 1 is filled and vented, then chamber 2, then both. The static laws are what effects have to beat:
polynomials of the pressures without any memory, their degree chosen on one run by blocks of it that are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from benchmarks.output import REFERENCE
from numpy.typing import NDArray

from pliant import api
from pliant.config.study import Study
from pliant.evidence.prediction import Predictor
from pliant.measurements.reading import read_measurement
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement

FILE = REFERENCE.parent / "measured/two_bellow_bending.csv"
RUNS = ("12V", "7V")
ANGLE = "angle_rad"
CHAMBERS = ("pressure_1_pa", "pressure_2_pa")
# Rough numbers of a stiff law. Nobody measured a moment, so that b_e stands for a unit and is never fitted.
STUDY = """
pliant: 1
name: two-bellow
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {{k_n: 2.0e-6, m_a: -1.0e-6, m_e: 0.1, b_e: 0.05}}
chain:
  modules: 1
  module_length: 70 mm
  module_mass: 33.2 g
  gravity: [0, 0, 0]
  actuators: [{{input: pressure_1_pa, sign: 1}}, {{input: pressure_2_pa, sign: -1}}]
physics: quasistatic
measurements:
  file: {file}
  outputs: [angle_rad]
  rename: {{bend_angle_rad: angle_rad}}
"""


BLOCK_S = 5.0  # longer than the camera's jitter remembers, shorter than a filling
FOLDS = 6

DEGREES = (1, 2, 3)
UNIT_PA = 5e4  # keeps the powers of the pressures near 1


@dataclass(frozen=True, eq=False)
class Bench:
    """The model before anything is fitted, and the two runs by name."""

    opened: api.OpenStudy
    runs: dict[str, Measurement]

    def predictor(self, study: Study, run: str) -> Predictor:
        """A study's model under the pressures of a run."""
        return Predictor.of_study(self.opened.bench, study, self.runs[run])

    def error(self, study: Study, run: str) -> Array:
        """(t,) reading − model, rad."""
        return self.measured(run) - self.predictor(study, run).predict()[0][ANGLE]

    def measured(self, run: str) -> Array:
        """(t,) the angle, rad."""
        return self.runs[run].runs[0].outputs[ANGLE]

    def history(self, run: str) -> History:
        return self.runs[run].runs[0].history

    def pressures(self, run: str) -> tuple[Array, Array]:
        """(t,) of both chambers, Pa."""
        actuation = self.history(run).actuation
        return actuation[CHAMBERS[0]], actuation[CHAMBERS[1]]

    def covered(self, run: str, by: str) -> NDArray[np.bool_]:
        """(t,) samples of a run in which no chamber is above the highest pressure of the other run."""
        return np.maximum(*self.pressures(run)) <= max(float(p.max()) for p in self.pressures(by))


def open_bench(folder: Path) -> Bench:
    """Read the file once for each run, the other left out; `folder` holds the study and its finished stages."""
    path = folder / "joint.yaml"
    path.write_text(STUDY.format(file=FILE))
    opened = api.open_study(path, store=folder / "store")
    runs = {}
    for name in RUNS:
        others = [{"run": other} for other in RUNS if other != name]
        settings = opened.study.measurements
        settings = type(settings).model_validate({**settings.model_dump(mode="json"), "exclude": others})
        runs[name] = read_measurement(FILE, settings=settings, actuation=CHAMBERS)
    return Bench(opened, runs)


def folds(time_s: Array, block_s: float = BLOCK_S) -> NDArray[np.intp]:
    """(t,) number of the fold: blocks of the run are dealt out in turn."""
    return np.asarray(np.floor(time_s / block_s).astype(np.intp) % FOLDS)


def rms(values: Array) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


@dataclass(frozen=True, eq=False)
class StaticLaw:
    """angle = polynomial of p₁ − p₂, or of p₁ and p₂ apart (total degree), fitted to one run.

    Attributes:
        apart: whether the chambers are two variables.
        training, blocked: rms error of the run that was fitted, and of its blocks left out, rad.
    """

    degree: int
    apart: bool
    weights: Array
    training: float
    blocked: float

    @property
    def name(self) -> str:
        return f"degree {self.degree} in {'p1 and p2' if self.apart else 'p1 - p2'}"

    def predict(self, p1: Array, p2: Array) -> Array:
        """(t,) the angle that the law predicts, rad."""
        return np.asarray(_columns(p1, p2, self.degree, self.apart) @ self.weights, float)


def static_laws(p1: Array, p2: Array, angle: Array, time_s: Array) -> list[StaticLaw]:
    """All degrees, chambers together and apart."""
    number = folds(time_s)
    laws = []
    for apart in (False, True):
        for degree in DEGREES:
            columns = _columns(p1, p2, degree, apart)
            left = np.empty_like(angle)
            for fold in np.unique(number):
                out = number == fold
                left[out] = angle[out] - columns[out] @ _fit(columns[~out], angle[~out])
            weights = _fit(columns, angle)
            laws.append(StaticLaw(degree, apart, weights, rms(angle - columns @ weights), rms(left)))
    return laws


def _fit(columns: Array, angle: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns, angle, rcond=None)[0], float)


def _columns(p1: Array, p2: Array, degree: int, apart: bool) -> Array:
    a, b = p1 / UNIT_PA, p2 / UNIT_PA
    if not apart:
        return np.stack([(a - b) ** k for k in range(degree + 1)], axis=1)
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.stack([a**i * b**j for i, j in powers], axis=1)
