"""Soft joints and an engine's tolerance: the remark, the error that it is about, and that it is absent elsewhere."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.metamorphic.random_studies import Raw, changed, random_study, settled_tip

from pliant import api
from pliant.interfaces.physics import PhysicsConfig
from pliant.pipeline.equilibrium_tolerance import tolerance_remarks
from pliant.pipeline.study import build_study_chain


def scaled(raw: Raw, factor: float, tolerance: float) -> Raw:
    """Return the study with all efforts times the factor, which leaves every pose as it is."""
    coefficients = {name: factor * value for name, value in raw["surrogate"]["coefficients"].items()}
    mass = {name: factor * raw["chain"][name] for name in ("module_mass_kg", "payload_kg")}
    force = [factor * one for one in raw["task"]["tip_force_n"]]
    physics = {"tolerance": tolerance}
    return changed(
        raw,
        surrogate={"coefficients": coefficients},
        chain=mass,
        task={"tip_force_n": force},
        physics=physics,
    )


def remarks(raw: Raw, folder: Path, kind: str = "quasistatic") -> tuple[str, ...]:
    """Return the remarks on a study's chain in an engine with the study's tolerance."""
    (folder / "study.yaml").write_text(json.dumps(raw), encoding="utf-8")
    opened = api.open_study(folder / "study.yaml", store=folder / "store")
    config = opened.context.registry.get("physics", kind).config_model()
    engine: PhysicsConfig = config(kind=kind, tolerance=raw["physics"]["tolerance"])
    chain = build_study_chain(opened.context, opened.study).chain
    return tolerance_remarks(chain, [opened.context.build("physics", engine)])


@pytest.mark.parametrize("kind", ["quasistatic", "mujoco"])
def test_a_soft_joint_is_named_with_a_tolerance_that_suits_it(kind: str, tmp_path: Path) -> None:
    raw = random_study(np.random.default_rng(0))
    soft = 1e-6 * raw["surrogate"]["coefficients"]["b_e"]
    (said,) = remarks(scaled(raw, 1e-6, 1e-9), tmp_path, kind)
    assert said.startswith(f"{kind} settles within an effort of 1e-09 N·m")
    assert f"{soft:.2g} N·m/rad" in said and f"off by {1e-9 / soft:.2g} rad" in said
    assert "tolerance: 1e-14" in said
    assert remarks(scaled(raw, 1e-6, 1e-14), tmp_path, kind) == ()
    assert remarks(scaled(raw, 1.0, 1e-9), tmp_path, kind) == ()


def test_the_proposed_tolerance_restores_the_pose(tmp_path: Path) -> None:
    """At 1e-6 of the efforts the default tolerance moves the tip by percents; the proposed one does not."""
    raw = random_study(np.random.default_rng(0))
    wanted = settled_tip(raw, tmp_path)
    size = float(np.linalg.norm(wanted))
    coarse, fine = (settled_tip(scaled(raw, 1e-6, one), tmp_path) for one in (1e-9, 1e-14))
    assert np.linalg.norm(fine - wanted) < 1e-6 * size
    assert np.linalg.norm(coarse - wanted) > 1e-4 * size
