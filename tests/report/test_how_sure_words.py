"""A wide band is reported as a limitation, and the remaining error and limits follow the added effects."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.diagnosis.quick import P, make_measurement, ramp

from pliant.diagnosis.bands import Bands
from pliant.diagnosis.uncertainty import Estimate
from pliant.interfaces.effect import EffectParameter
from pliant.report.improvement import doubts
from pliant.report.posterior import bands_words


def _band(half: float) -> tuple[Bands, Any]:
    run = ramp("a", 3e3, 0.5, (P, 0.0))
    read = {"angle_rad": np.zeros(len(run))}
    ends = ({"angle_rad": np.full(len(run), sign * half)} for sign in (-1, 1))
    return Bands(0.9, (read,), *((end,) for end in ends)), make_measurement([run], [read])


def test_a_band_as_wide_as_the_misfit_says_so() -> None:
    band, measured = _band(0.3)
    assert bands_words(band, measured, "all runs", 1.1).startswith("The 90 % band holds 100 %")
    assert bands_words(band, measured, "all runs") == bands_words(band, measured, "all runs", 1.1)
    wide = bands_words(band, measured, "all runs", 4.6)
    assert "4.6 times the noise" in wide
    assert "is no evidence for the model" in wide


def _improved(left: float, share: float, sd: float) -> Any:
    declared = EffectParameter("share", "1", 0.0, (0.0, 5.0), (0.05, 0.6))
    fitted = Estimate("viscoelastic.share", declared, share, sd, share - sd, share + sd, False, False, False)
    final = SimpleNamespace(uncertainty=SimpleNamespace(estimates=(fitted,)))
    step = SimpleNamespace(locked=SimpleNamespace(over_floor=left), locked_se=0.1)
    return SimpleNamespace(steps=(step,), final=final)


@pytest.mark.parametrize(
    ("left", "share", "sd", "count"), [(4.6, 2.3, 0.9, 2), (1.05, 0.3, 0.02, 0), (4.6, 0.3, 0.02, 1)]
)
def test_what_is_left_and_what_cannot_be_is_said_behind_the_effects(left, share, sd, count) -> None:
    said = doubts(_improved(left, share, sd))
    assert len(said) == count
    if left > 4:
        assert said[0] == "4.6 times the noise is left: none of these explains all of the error."
    if share > 1:
        assert "outside its plausible range" in said[1]
