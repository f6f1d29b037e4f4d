"""A diagnosis of a user's own model asks for few simulations, and is complete: next run, stored answer, import."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.command import called
from tests.pliant_systems.hinge import write_bench

from pliant import api
from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.excitation import excitations
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.isolating_run import isolating_run
from pliant.diagnosis.readings import readings_over_floor
from pliant.evidence.driven_model import DrivenModel
from pliant.evidence.error_bins import run_residuals
from pliant.experiments.system_catalogue import system_catalogue
from pliant_systems.python_model import PythonModel


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that gets the number of runs of each simulation."""
    sizes: list[int] = []
    simulate = PythonModel.simulate

    def noting(self: PythonModel, parts: Any, drives: Any) -> Any:
        sizes.append(len(drives))
        return simulate(self, parts, drives)

    monkeypatch.setattr(PythonModel, "simulate", noting)
    return sizes


def model_of(study: Path) -> DrivenModel:
    model = api.predictor(api.open_study(study, store=study.parent / "store"))
    assert isinstance(model, DrivenModel)
    return model


def fitter_of(model: DrivenModel) -> Fitter:
    residuals = run_residuals(model.measurement, model.predict())
    return Fitter(model, readings_over_floor(model.measurement, residuals)[0])


def test_effects_of_readings_need_no_simulation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of(write_bench(tmp_path))
    sizes = counted(monkeypatch)
    plain = model.evaluate().runs
    registry = model.context.registry
    scaled = EffectSet.from_kinds(registry, ("sensor_scale",))
    read = model.evaluate(scaled.configs(np.array([0.5]))).runs
    assert len(sizes) == 1
    factor = scaled.parameters[0].value(0.5)
    assert factor != 1.0
    np.testing.assert_allclose(read[0]["angle_rad"], factor * plain[0]["angle_rad"])
    gain = EffectSet.from_kinds(registry, ("actuation_gain",))
    moved = model.evaluate(gain.configs(np.array([0.5]))).runs
    assert len(sizes) == 2 and not np.allclose(moved[0]["angle_rad"], plain[0]["angle_rad"])


def test_a_fit_takes_slopes_only_where_it_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fitted value is that of a fit with slopes at every trial, without more simulations."""
    study = write_bench(tmp_path, coulomb=0.15)
    found, numbers = [], []
    for sparing in (False, True):
        monkeypatch.setattr(DrivenModel, "costly_slopes", sparing)
        model = model_of(study)
        fitter, sizes = fitter_of(model), counted(monkeypatch)
        fit = fitter.fit(EffectSet.from_kinds(model.context.registry, ("state@coulomb",)))
        found.append(fit.values["state@coulomb.value"])
        numbers.append(sum(sizes))
        monkeypatch.undo()
    assert found[0] == pytest.approx(0.15, rel=0.05) and found[1] == pytest.approx(found[0], rel=1e-3)
    assert numbers[1] <= numbers[0]


def test_excitations_are_those_of_both_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study, kinds = write_bench(tmp_path), ["actuation_gain", "state@coulomb", "sensor_delay"]
    shown = []
    for sparing in (False, True):
        monkeypatch.setattr(DrivenModel, "costly_slopes", sparing)
        model = model_of(study)
        fitter, registry = fitter_of(model), model.context.registry
        nothing = fitter.fit(EffectSet.from_kinds(registry, ()))
        shown.append(excitations(registry, fitter, nothing, kinds))
    for kind in kinds:
        assert shown[1][kind].snr == pytest.approx(shown[0][kind].snr)
        np.testing.assert_allclose(shown[1][kind].x, shown[0][kind].x)
        np.testing.assert_allclose(shown[1][kind].slopes, shown[0][kind].slopes, rtol=1e-3, atol=1e-3)


def test_the_run_that_isolates_an_unknown_cause(tmp_path: Path) -> None:
    runs = system_catalogue(model_of(write_bench(tmp_path)))
    names = [run.name for run in runs]

    def asked(depends_on: dict[str, float], *done: str) -> str:
        found = isolating_run(runs, depends_on, [names.index(name) for name in done])
        return found.name if found else ""

    assert asked({"rate_n_m_s × direction": 0.4}) == "fast_cycles"
    assert asked({"rate_n_m_s": 0.4, "direction": 0.2}, "fast_cycles") == "small_loops"
    assert asked({"run_number": 0.5, "hold_s": 0.3}) == "holds"
    assert asked({}) == "slow_cycles"
    assert asked({}, *names) == ""
    found = isolating_run(runs, {"hold_s": 0.3})
    assert found is not None and found.planned in runs and "fades with time" in found.why


def test_a_stored_answer_serves_without_its_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_bench(tmp_path, n=60, coulomb=0.15)
    asked = ("diagnose", "study.yaml", "--effect", "state@coulomb", "--effect", "sensor_scale")
    first = called(*asked).done().out

    def never(*_: Any, **__: Any) -> None:
        raise AssertionError("the diagnosis was computed again")

    monkeypatch.setattr(api, "diagnose", never)
    again = called(*asked, "--no-page", "--json", "result.json").done().out
    assert again.splitlines()[0] == first.splitlines()[0] and (tmp_path / "result.json").is_file()
    with pytest.raises(AssertionError, match="computed again"):
        called(*asked, "--effect", "sensor_bias", "--no-page")


def test_a_recording_is_imported_by_the_columns_of_a_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_bench(tmp_path, n=30)
    (tmp_path / "other.csv").write_bytes((tmp_path / "bench.csv").read_bytes())
    said = called("import", "other.csv", "--study", "study.yaml", "--out", "new.yaml").done().out
    assert "torque_n_m" in said and "angle_rad" in said
    called("compare", "new.yaml").done()
    assert "other.csv" in (tmp_path / "new.yaml").read_text()
    refused = called("import", "other.csv")
    assert refused.code == 2
    assert "A recording for a model of your own has the columns of its study" in " ".join(refused.err.split())
