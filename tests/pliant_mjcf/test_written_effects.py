"""Fitted effects of MuJoCo models are written to a study that reads back as the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pliant.config.loading import load_study
from pliant.config.study import written_name
from pliant.config.writing import StudyDraft
from pliant.registry.discovery import discover

REGISTRY = discover().for_model("mjcf")
FITTED = [one.kind for one in REGISTRY.by_interface("effect") if REGISTRY.fit_parameters(one.kind)]


@pytest.mark.parametrize("kind", FITTED)
def test_every_fitted_parameter_is_written_under_a_key_that_is_read(kind: str, tmp_path: Path) -> None:
    source, target = tmp_path / "arm.yaml", tmp_path / "better.yaml"
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    source.write_text("pliant: 1\nname: arm\nmodel: {kind: mjcf, file: arm.xml}\n")
    model = REGISTRY.get("effect", kind).config_model()
    draft = StudyDraft(source, ())
    draft.set(("effects", 0, "kind"), kind)
    meant = {}
    for one in REGISTRY.fit_parameters(kind):
        meant[one.name] = float(np.mean(one.plausible))
        draft.set(("effects", 0, written_name(model, one.name)), meant[one.name], spelled=True)
    target.write_text(draft.text(target))
    (effect,) = load_study(target, discover()).effects
    assert {name: getattr(effect, name) for name in meant} == pytest.approx(meant)
