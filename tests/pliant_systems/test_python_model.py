"""Models that are Python functions: channels, numbers, starts, derivatives, and the whole loop on a hinge."""

from __future__ import annotations

import json
import pickle
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.pliant_systems.hinge import MODEL, simulated, torques, write_bench
from typer.testing import CliRunner

from pliant import api
from pliant.cli.verbs import app
from pliant.errors import UserError
from pliant.evidence.driven_model import DrivenModel
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.model import Drive, SystemParts
from pliant.records.history import History
from pliant_systems.named_values import NamedValue, ParameterValueConfig
from pliant_systems.python_model import PythonModel, PythonModelConfig

JAX = """
import jax
import jax.numpy as jnp

jax.config.update("jax_enable_x64", True)
INPUTS = ("torque_n_m",)
OUTPUTS = ("angle_rad",)
PARAMETERS = {"stiffness": (2.0, 1.0, 4.0)}
MISSING = {"coulomb": (0.0, 0.0, 0.3)}


@jax.jit
def simulate(time_s, inputs, parameters):
    def step(state, now):
        angle, speed = state
        torque, dt = now
        friction = parameters["coulomb"] * jnp.tanh(speed / 0.02)
        speed = speed + dt * (torque - parameters["stiffness"] * angle - 0.1 * speed - friction) / 0.05
        return (angle + dt * speed, speed), angle + dt * speed

    torque = jnp.asarray(inputs["torque_n_m"])[:-1]
    _, found = jax.lax.scan(step, (0.0, 0.0), (torque, jnp.diff(jnp.asarray(time_s))))
    return {"angle_rad": jnp.concatenate([jnp.zeros(1), found])}
"""
TORCH = """
import torch

INPUTS = ("torque_n_m",)
OUTPUTS = ("angle_rad",)
PARAMETERS = {"stiffness": (2.0, 1.0, 4.0)}
MISSING = {"coulomb": (0.0, 0.0, 0.3)}
DERIVATIVES = "torch"


def simulate(time_s, inputs, parameters):
    lasting = torch.exp(-time_s / 0.3)
    angle = inputs["torque_n_m"] / parameters["stiffness"] * (1 - lasting)
    return {"angle_rad": angle - parameters["coulomb"] ** 2 * angle - torch.tanh(parameters["coulomb"] * angle)}
"""


def model_of(tmp_path: Path, text: str = MODEL) -> PythonModel:
    file = tmp_path / "hinge.py"
    file.write_text(text)
    return PythonModel(PythonModelConfig(file=file))


def drives(first: dict[str, float] | None = None) -> list[Drive]:
    return [
        Drive(History.from_arrays({"torque_n_m": torque}, clock, run=f"r{k}"), first or {})
        for k, (clock, torque) in enumerate(torques(60))
    ]


def test_channels_have_units_and_ranges(tmp_path: Path) -> None:
    model = model_of(tmp_path)
    (torque,) = model.inputs
    assert (torque.name, torque.unit, torque.low, torque.high) == ("torque_n_m", "N*m", -2.0, 2.0)
    assert [channel.name for channel in model.outputs] == ["angle_rad", "speed_rad_s"]
    assert model.attachments == {"parameter": ("stiffness", "damping"), "state": ("coulomb",)}


def test_the_function_gets_the_values(tmp_path: Path) -> None:
    model = model_of(tmp_path)
    changed = (
        SystemParts()
        .with_change(NamedValue("state", "coulomb", 0.2))
        .with_change(NamedValue("parameter", "damping", 0.3))
    )
    for drive, found in zip(drives(), model.simulate(changed, drives()), strict=True):
        assert drive.history.time_s is not None
        torque = drive.history.actuation["torque_n_m"]
        wanted = simulated(torque, drive.history.time_s, coulomb=0.2, damping=0.3)
        assert np.array_equal(found["angle_rad"], wanted["angle_rad"])


def test_a_reading_is_missing_from_the_first_that_is_not_finite(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL.replace("    return", "    found[40, 0] = np.inf\n    return"))
    for found in model.simulate(SystemParts(), drives()):
        assert np.isfinite(found["angle_rad"][:40]).all()
        assert np.isnan(found["angle_rad"][40:]).all()


def test_a_run_starts_at_its_first_reading_where_the_function_asks(tmp_path: Path) -> None:
    text = MODEL.replace("parameters):", "parameters, first):").replace(
        'angle, speed = inputs["torque_n_m"], 0.0, 0.0',
        'angle, speed = inputs["torque_n_m"], first.get("angle_rad", 0.0), 0.0',
    )
    text = text.replace("found = np.zeros((len(time_s), 2))", "found = np.full((len(time_s), 2), angle)")
    model = model_of(tmp_path, text)
    for found in model.simulate(SystemParts(), drives({"angle_rad": 0.3})):
        assert found["angle_rad"][0] == 0.3
    for found in model.simulate(SystemParts(), drives()):
        assert found["angle_rad"][0] == 0.0


def test_a_copy_in_a_worker_gives_the_same(tmp_path: Path) -> None:
    model = model_of(tmp_path)
    again = pickle.loads(pickle.dumps(model))
    one, two = (some.simulate(SystemParts(), drives()[:1])[0] for some in (model, again))
    assert np.array_equal(one["angle_rad"], two["angle_rad"])


def test_the_fingerprint_changes_with_the_file(tmp_path: Path) -> None:
    before = model_of(tmp_path).fingerprint()
    assert model_of(tmp_path).fingerprint() == before
    assert model_of(tmp_path, MODEL + "# other\n").fingerprint() != before


def test_a_number_has_the_units_words_and_range_of_the_file(tmp_path: Path) -> None:
    model = model_of(tmp_path)
    (declared,) = ParameterValueConfig.fit_parameters()
    adapted = model.adapted("parameter@stiffness", declared)
    assert (adapted.unit, adapted.neutral, adapted.plausible) == ("N*m/rad", 2.0, (1.0, 4.0))
    assert adapted.bounds == (0.0, 10.0)
    assert model.words("parameter@stiffness") == "stiffness of the hinge"
    assert (model.words("parameter@damping"), model.words("supply_lag")) == ("", "")


def _agree_with_differences(model: PythonModel, step: float = 1e-4) -> None:
    """Require the model's own derivatives, up to the second-order term of a central difference."""
    names = {"stiffness": 2.0, "coulomb": 0.05}
    at = SystemParts().with_change(NamedValue("state", "coulomb", 0.05))
    towards = [
        at.with_change(NamedValue("state" if name == "coulomb" else "parameter", name, value + step))
        for name, value in names.items()
    ]
    back = [
        at.with_change(NamedValue("state" if name == "coulomb" else "parameter", name, value - step))
        for name, value in names.items()
    ]
    found = model.vary(at, towards, drives())
    assert found is not None
    base, changes = found
    plain = model.simulate(at, drives())
    for k, change in enumerate(changes):
        up, down = model.simulate(towards[k], drives()), model.simulate(back[k], drives())
        for run, slope in enumerate(change):
            central = (up[run]["angle_rad"] - down[run]["angle_rad"]) / 2
            assert np.abs(central).max() > 1e-7
            assert slope["angle_rad"] == pytest.approx(central, abs=1e-5 * np.abs(central).max())
            assert base[run]["angle_rad"] == pytest.approx(plain[run]["angle_rad"], abs=1e-12)


def test_derivatives_by_torch(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    _agree_with_differences(model_of(tmp_path, TORCH))


@pytest.mark.parametrize("stated", [True, False])
def test_derivatives_by_jax(tmp_path: Path, stated: bool) -> None:
    pytest.importorskip("jax")
    _agree_with_differences(model_of(tmp_path, JAX + ('DERIVATIVES = "jax"\n' if stated else "")))


def test_a_file_of_numpy_has_no_derivatives(tmp_path: Path) -> None:
    assert model_of(tmp_path).vary(SystemParts(), [], drives()) is None


def test_a_function_that_leaves_torch_is_told(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    text = TORCH.replace("angle = inputs", "assert not isinstance(lasting, float)\n    angle = inputs")
    text = text.replace("torch.tanh(parameters", "torch.nothing(parameters")
    assert not hasattr(torch, "nothing")
    model = model_of(tmp_path, text)
    towards = [SystemParts().with_change(NamedValue("parameter", "stiffness", 2.1))]
    with pytest.raises(UserError, match=r"hinge.py, line 15: simulate cannot be differentiated by torch"):
        model.vary(SystemParts(), towards, drives())


def test_a_fit_uses_the_models_derivatives(tmp_path: Path) -> None:
    """Slopes of numbers are the model's, those of inputs and outputs differences through it."""
    pytest.importorskip("torch")
    study = write_bench(tmp_path, n=60)
    (tmp_path / "hinge.py").write_text(TORCH)
    driven = api.predictor(api.open_study(study, store=tmp_path / "store"))
    assert isinstance(driven, DrivenModel)
    calls: list[int] = []
    system = driven.system

    class Counted(PythonModel):
        def vary(self, parts: SystemParts, towards: Sequence[SystemParts], drives: Sequence[Drive]) -> Any:
            calls.append(len(towards))
            return super().vary(parts, towards, drives)

    driven.system = Counted(system.config)  # type: ignore[arg-type]
    build = driven.context.registry.get("effect", "sensor_scale").config_model().model_validate
    at = (
        build({"kind": "sensor_scale", "factor": 2.0}),
        ParameterValueConfig(kind="parameter@stiffness", value=2.0),
    )
    towards: list[tuple[EffectConfig, ...]] = [
        (at[0], ParameterValueConfig(kind="parameter@stiffness", value=2.0 + 1e-4)),
        (build({"kind": "sensor_scale", "factor": 2.0 + 1e-4}), at[1]),
    ]
    base, changes = driven.vary(at, towards)  # type: ignore[arg-type]
    assert calls == [1]
    for run, by_stiffness, by_scale in zip(base.runs, *changes, strict=True):
        angle = run["angle_rad"]
        assert by_stiffness["angle_rad"] == pytest.approx(-angle * 1e-4 / 2.0, abs=1e-12)
        assert by_scale["angle_rad"] == pytest.approx(angle * 1e-4 / 2.0, abs=1e-12)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bench(tmp_path_factory.mktemp("hinge"), coulomb=0.12)


def run(study: Path, verb: str, *options: str) -> tuple[str, dict[str, Any]]:
    """Return the output and the JSON of a command."""
    folder = study.parent
    target = folder / f"{verb}.json"
    where = ["--store", str(folder / "store"), "--json", str(target)]
    out = [] if verb == "improve" else ["--out", str(folder / verb)]
    done = CliRunner().invoke(app, [verb, str(study), *out, *where, *options])
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split()), json.loads(target.read_text())


def test_the_loop_names_the_hidden_effect_and_writes_a_study(bench: Path) -> None:
    """compare → diagnose → improve → compare the written study."""
    text, before = run(bench, "compare")
    assert "mm/s" not in text
    text, found = run(bench, "diagnose", "--effect", "state@coulomb", "--effect", "parameter@stiffness")
    assert found["verdict"] == "missing_effect"
    assert (
        "state@coulomb, dry friction of the hinge" in text
        or "state@coulomb: dry friction of the hinge" in text
    )
    assert re.search(r"state@coulomb: value 1\d\d ± \d+(\.\d+)? mN·m", text) or "mN·m" in text
    for word in ("chain", "joint", "pressure"):
        assert word not in text, text
    better = bench.with_name("better.yaml")
    report = str(bench.parent / "improve")
    candidates = ["--effect", "state@coulomb", "--effect", "supply_lag", "--effect", "sensor_lag"]
    run(bench, "improve", "--out", str(better), "--report", report, *candidates)
    (effect,) = api.open_study(better).study.effects
    assert effect.kind == "state@coulomb"
    assert effect.value == pytest.approx(0.12, abs=0.01)  # type: ignore[attr-defined]
    _, after = run(better, "compare")
    rms = [one["outputs"]["angle_rad"]["rmse"] for one in (before, after)]
    assert rms[1] < 0.2 * rms[0]
