"""Segments of a chain: relative turns, separate regulators, ends as long as modules."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pliant import api
from pliant.config.chain import ChainConfig
from pliant.records.law import JointLaw
from pliant.records.rollout import Equilibrium

LAW = {
    "kind": "polynomial",
    "form": "study",
    "odd": True,
    "coefficients": {"k_n": 1.637e-6, "m_a": -1.704e-6, "b_a": 0.0, "m_e": 0.1012, "b_e": 0.0245},
    "domain": {"actuation": ["0 kPa", "15 kPa"], "deformation": [-0.3, 0.6]},
}


def segments(*each: dict[str, Any]) -> ChainConfig:
    return ChainConfig.model_validate({"segments": list(each)})


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run_chain(
    *each: dict[str, Any], pressure: str = "12 kPa", engine: str = "quasistatic", **chain: Any
) -> Any:
    """Return a hanging chain of stated modules, run."""
    chain = {"module_length": "11 mm", "module_mass": "2 g", "segments": list(each), **chain}
    task = {"kind": "free_bending", "pressure": pressure}
    blocks = {
        "pliant": 1,
        "name": "turns",
        "surrogate": LAW,
        "chain": chain,
        "physics": {"kind": engine},
        "task": task,
    }
    Path("study.yaml").write_text(json.dumps(blocks))
    return api.simulate(api.open_study("study.yaml"))


def settled(*each: dict[str, Any], **more: Any) -> tuple[tuple[JointLaw, ...], Equilibrium]:
    """Return the chain's laws and its settled pose."""
    run = run_chain(*each, **more)
    return run.chain.laws, run.engines[0].result.final


def test_a_turn_is_relative_to_the_modules_before_it() -> None:
    turned = segments(
        {"modules": 2, "turn": 0.2},
        {"rigid": {"length": "1 mm"}},
        {"modules": 2, "turn": 0.5},
        {"modules": 2, "rotation": 1.0},
        {"modules": 2, "turn": -0.3},
        {"modules": 2},
    )
    wanted = (0.2, 0.0, 0.7, 1.0, 0.7, 0.0)
    assert [s.rotation_rad for s in turned.as_segments()] == pytest.approx(wanted)
    assert all(s.turn_rad is None for s in turned.as_segments())


def test_turns_and_rotations_make_one_chain() -> None:
    turned = settled({"modules": 2}, {"modules": 2, "turn": 0.4}, {"modules": 1, "turn": "20 deg"})
    rotated = settled(
        {"modules": 2}, {"modules": 2, "rotation": 0.4}, {"modules": 1, "rotation": 0.4 + np.pi / 9}
    )
    np.testing.assert_allclose(turned[1].tip_m, rotated[1].tip_m, atol=1e-12)
    straight = settled({"modules": 5})
    assert np.linalg.norm(turned[1].tip_m - straight[1].tip_m) > 1e-3


@pytest.mark.parametrize("engine", ["quasistatic", "mujoco"])
def test_a_share_is_a_lower_pressure(engine: str) -> None:
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    shared = settled({"modules": 4, "actuation_share": 0.75}, pressure="12 kPa", engine=engine)[1]
    lower = settled({"modules": 4}, pressure="9 kPa", engine=engine)[1]
    np.testing.assert_allclose(shared.joint_angles, lower.joint_angles, atol=1e-8)
    full = settled({"modules": 4}, pressure="12 kPa", engine=engine)[1]
    assert np.abs(full.joint_angles - lower.joint_angles).max() > 0.02


def test_each_segment_has_its_own_share() -> None:
    half = {"modules": 1, "actuation_share": 0.5}
    laws, final = settled({"modules": 2}, {**half, "modules": 2}, half, gravity=[0, 0, 0])
    assert len(laws) == 2, "equal shares of one law are one law"
    for modules, pressure in ((slice(0, 2), "12 kPa"), (slice(2, 5), "6 kPa")):
        alone = settled({"modules": 5}, pressure=pressure, gravity=[0, 0, 0])[1]
        np.testing.assert_allclose(final.joint_angles[modules], alone.joint_angles[modules], atol=1e-9)


def test_a_rigid_end_follows_its_modules_length() -> None:
    def length(module: str) -> float:
        end = {"module_lengths": 1, "length": "3 mm", "section": "module"}
        measures = {"module_length": module, "module_radius": "8 mm"}
        return float(run_chain({"modules": 3}, {"rigid": end}, **measures).chain.length_m)

    assert length("8 mm") == pytest.approx(4 * 8e-3 + 3e-3)
    assert length("12 mm") == pytest.approx(4 * 12e-3 + 3e-3)


def test_a_unit_share_leaves_the_law_and_pressure_beyond_it_is_reported_where_it_acts() -> None:
    (plain,), before = settled({"modules": 4})
    (told,), after = settled({"modules": 4, "actuation_share": 1.0})
    assert type(plain) is type(told)
    np.testing.assert_array_equal(before.joint_angles, after.joint_angles)
    inside = settled({"modules": 2, "actuation_share": 0.5}, pressure="20 kPa")[1]
    beyond = settled({"modules": 2, "actuation_share": 0.9}, pressure="20 kPa")[1]
    assert not inside.outside_domain
    assert {entry.variable for entry in beyond.outside_domain} == {"pressure_pa"}
