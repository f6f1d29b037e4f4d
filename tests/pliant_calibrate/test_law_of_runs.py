"""Fit the numbers of a stated law to runs: known values are recovered, undetermined ones are reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pliant import api
from pliant.errors import UserError
from pliant.records.design import Array

TRUE = {"k_n": 1.6e-6, "m_a": -1.7e-6, "m_e": 0.1, "b_e": 0.03}
ROUGH = {"k_n": 1.1e-6, "m_a": -0.8e-6, "m_e": 0.05, "b_e": 0.03}
SIGMA_RAD = 2e-3


def study(folder: Path, numbers: dict[str, float], effects: str = "[]", **parts: str) -> Path:
    """Return a joint with opposed chambers and the law with these numbers."""
    path = folder / "joint.yaml"
    law = ", ".join(f"{name}: {value}" for name, value in numbers.items())
    surrogate = parts.get(
        "surrogate", f"{{kind: polynomial, form: study, odd: true, coefficients: {{{law}}}}}"
    )
    path.write_text(
        f"""pliant: 1
name: opposed
surrogate: {surrogate}
chain:
  modules: 1
  module_length: 70 mm
  module_mass: 33 g
  gravity: [0, 0, 0]
  actuators: [{{input: pressure_1_pa, sign: 1}}, {{input: pressure_2_pa, sign: -1}}]
effects: {effects}
measurements: {{file: bench.csv}}
"""
    )
    return path


def record(folder: Path, effects: str = "[]", load_n_m: float = 0.0, noise_rad: float = 0.0) -> None:
    """Return runs of the true law: both chambers filled and vented in turn, then together."""
    time = np.arange(0.0, 60.0, 0.25)
    first = 2e4 * np.clip(np.sin(2 * np.pi * time / 40), 0, None)
    second = 2e4 * np.clip(np.sin(2 * np.pi * (time - 20) / 40), 0, None) + 5e3 * (time > 40)
    moment = load_n_m * (np.sin(2 * np.pi * time / 7) > 0)
    write(folder / "bench.csv", time, first, second, moment, np.zeros_like(time))
    opened = api.open_study(study(folder, TRUE, effects), store=folder / "store")
    angle = api.predictor(opened).predict()[0]["angle_rad"]
    noise = noise_rad * np.random.default_rng(5).standard_normal(len(time))
    write(folder / "bench.csv", time, first, second, moment, angle + noise)


def write(path: Path, *columns: Array) -> None:
    """Write the measurement CSV."""
    names = "time_s,pressure_1_pa,pressure_2_pa,moment_n_m,angle_rad"
    rows = [",".join(f"{value:.9g}" for value in row) for row in np.column_stack(columns)]
    path.write_text("\n".join(["run," + names, *(f"a,{row}" for row in rows)]) + "\n")


@pytest.mark.parametrize("effects", ["[]", "[{kind: viscoelastic, share: 0.3, time: 8 s}]"])
def test_ratios_for_a_run_without_load(tmp_path: Path, effects: str) -> None:
    record(tmp_path, effects)
    opened = api.open_study(study(tmp_path, ROUGH, effects), store=tmp_path / "store")
    found = api.fit_stated_law(opened, held=["b_e"])
    for name, value in TRUE.items():
        assert found.coefficients[name] == pytest.approx(value, rel=2e-3), name
    assert found.after["angle_rad"] < 1e-4 < found.before["angle_rad"]
    assert "b_e" not in found.sd
    again = api.OpenStudy(found.study, opened.context)
    assert api.compare(again).outputs["angle_rad"].rmse < 1e-4


def test_loads_tell_all_coefficients(tmp_path: Path) -> None:
    record(tmp_path, load_n_m=8e-3)
    opened = api.open_study(study(tmp_path, {**ROUGH, "b_e": 0.05}), store=tmp_path / "store")
    found = api.fit_stated_law(opened)
    for name, value in TRUE.items():
        assert found.coefficients[name] == pytest.approx(value, rel=5e-3), name


def test_deviations_cover_the_truth(tmp_path: Path) -> None:
    record(tmp_path, noise_rad=SIGMA_RAD)
    opened = api.open_study(study(tmp_path, ROUGH), store=tmp_path / "store")
    found = api.fit_stated_law(opened, held=["b_e"])
    assert found.after["angle_rad"] == pytest.approx(SIGMA_RAD, rel=0.15)
    for name, sd in found.sd.items():
        assert 0 < sd < 0.1 * abs(TRUE[name])
        assert abs(found.coefficients[name] - TRUE[name]) < 4 * sd, name


def test_what_runs_without_load_cannot_tell(tmp_path: Path) -> None:
    record(tmp_path)
    opened = api.open_study(study(tmp_path, ROUGH), store=tmp_path / "store")
    with pytest.raises(UserError, match="only their ratios are identifiable. Hold one of them, e.g. b_e"):
        api.fit_stated_law(opened)


def test_a_name_that_the_law_does_not_have(tmp_path: Path) -> None:
    record(tmp_path)
    opened = api.open_study(study(tmp_path, ROUGH), store=tmp_path / "store")
    with pytest.raises(UserError, match=r"no coefficient 'be' to hold; did you mean 'b_e'\?"):
        api.fit_stated_law(opened, held=["be"])
    with pytest.raises(UserError, match="No coefficient is left to fit"):
        api.fit_stated_law(opened, held=list(TRUE))


def test_a_law_that_is_not_stated(tmp_path: Path) -> None:
    record(tmp_path)
    states = [(p, u) for p in np.linspace(0, 2e4, 6) for u in np.linspace(-0.4, 0.4, 6)]
    rows = [f"{p},{u},{1.6e-6 * p - 0.03 * u}" for p, u in states]
    (tmp_path / "table.csv").write_text("\n".join(["pressure_pa,angle_rad,moment_n_m", *rows]) + "\n")
    path = study(tmp_path, ROUGH, surrogate="{kind: polynomial, data: table.csv}")
    with pytest.raises(UserError, match="Only a law that is stated by its coefficients"):
        api.fit_stated_law(api.open_study(path, store=tmp_path / "store"))
