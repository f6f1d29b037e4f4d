"""The two runs of a measured bending actuator with opposed bellows, as Pliant reads them.

`../shared/data/measured/two_bellow_bending.csv`: 12.5 readings a second, pressures at the pumps, the tip's angle from
a camera. Chamber 1 is filled and vented, then chamber 2, then both.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pliant import api
from pliant.config.study import Study
from pliant.evidence.prediction import Predictor
from pliant.measurements.reading import read_measurement
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement

FILE = Path(__file__).parents[3] / "shared/data/measured/two_bellow_bending.csv"
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
        assert settings is not None
        settings = type(settings).model_validate({**settings.model_dump(mode="json"), "exclude": others})
        runs[name] = read_measurement(FILE, settings=settings, actuation=CHAMBERS)
    return Bench(opened, runs)
