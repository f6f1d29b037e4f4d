"""An effect of a MuJoCo model from a user's file of at most twenty lines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco")

from tests.pliant_mjcf.stepping import REGISTRY, changes, moved, pendula, rotor

from pliant.errors import PluginFailureError, UserError
from pliant.interfaces.model import SystemParts
from pliant.registry.discovery import Registry
from pliant.registry.files import effect_files, with_files

DRAG = '''\
"""Air that drags at a joint: M = −c |v| v."""

from pliant.interfaces.effect import EffectConfig, parameter
from pliant.interfaces.model import effect_kind
from pliant_mjcf.effect_bases import JointForce


class DragConfig(EffectConfig):
    kind: str = effect_kind("drag")
    drag: float = parameter(unit="N*m*s^2", neutral=0.0, bounds=(0.0, 10.0), plausible=(0.0, 0.1))


class Drag(JointForce):
    config: DragConfig

    def force(self, q, v):
        return -self.config.drag * abs(v) * v
'''
WIND = '''\
"""Wind that pushes all degrees of freedom: f = w."""

from pliant.interfaces.effect import EffectConfig, parameter
from pliant.interfaces.model import effect_kind
from pliant_mjcf.effect_bases import GeneralForce


class WindConfig(EffectConfig):
    kind: str = effect_kind("wind")
    wind_n: float = parameter(unit="N", neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.1, 0.1))


class Wind(GeneralForce):
    config: WindConfig

    def force(self, model, q, v):
        return self.config.wind_n * model.body_mass[1] + 0.0 * v
'''


def found(folder: Path, text: str) -> Registry:
    assert len(text.splitlines()) <= 20
    file = folder / "my_effect.py"
    file.write_text(text, encoding="utf-8")
    return with_files(REGISTRY, [file])


def built(registry: Registry, kind: str, **values: Any) -> Any:
    return registry.build("effect", registry.get("effect", kind).config_model()(kind=kind, **values))


def test_air_drag_in_twenty_lines_decays_hyperbolically(tmp_path: Path) -> None:
    """I dv/dt = −c v², so that 1/v grows by c / I per second."""
    registry = found(tmp_path, DRAG)
    component = registry.get("effect", "drag")
    assert component.summary == "Air that drags at a joint: M = −c |v| v"
    assert [one.name for one in registry.fit_parameters("drag")] == ["drag"]
    assert registry.kinds("effect").count("drag") == 1
    assert "drag" not in registry.for_model("chain").kinds("effect")
    assert [one.message for one in run_checks(component) if one.status == "failed"] == []
    assert effect_files(registry) == (str(tmp_path / "my_effect.py"),)
    run = moved(rotor(), built(registry, "drag", drag=0.02), v=[[3.0]], seconds=0.5)
    assert 1.0 / run.v[-1, 0, 0] - 1.0 / 3.0 == pytest.approx(0.499 * 0.02 / 0.01, rel=0.01)


def test_it_acts_on_the_joints_that_a_pattern_names(tmp_path: Path) -> None:
    registry = found(tmp_path, DRAG)
    plain = moved(pendula(), q=[[0.5, 0.5]])
    run = moved(pendula(), built(registry, "drag@left*", drag=1.0), q=[[0.5, 0.5]])
    assert np.abs(run.q - plain.q)[:, :, 0].max() > 0.01 and np.array_equal(run.q[..., 1], plain.q[..., 1])
    with pytest.raises(UserError, match="acts on no joint"):
        moved(pendula(), built(registry, "drag@elbow", drag=1.0))


def test_a_force_may_read_the_model(tmp_path: Path) -> None:
    run = moved(rotor(), built(found(tmp_path, WIND), "wind", wind_n=0.02), seconds=0.5)
    assert run.v[-1, 0, 0] == pytest.approx(2.0 * 0.499, rel=1e-6)


def test_a_kind_may_be_one_of_another_kind_of_model_only(tmp_path: Path) -> None:
    registry = found(tmp_path, DRAG.replace('"drag")', '"inertia")'))  # chains have one
    assert "inertia" in registry.kinds("effect")
    assert registry.for_model("chain").get("effect", "inertia").shipped
    with pytest.raises(UserError, match="give yours another kind"):
        found(tmp_path, DRAG.replace('"drag")', '"stiffness")'))


def test_mistakes_of_the_file_give_sentences(tmp_path: Path) -> None:
    wrong = DRAG.replace("    def force(self, q, v):", "    def act(self, parts):").replace(
        "-self.config.drag * abs(v) * v", "None"
    )
    with pytest.raises(UserError, match="class Drag has no method force"):
        found(tmp_path, wrong)
    none = found(tmp_path, DRAG + "\n    def act(self, parts):\n        return None\n")
    with pytest.raises(PluginFailureError, match="'act' returns None; it must return SystemParts"):
        built(none, "drag", drag=1.0).apply(SystemParts())
    assert len(changes(built(found(tmp_path, DRAG), "drag"))) == 1  # neutral: checked, and no force
