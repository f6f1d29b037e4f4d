"""Change of volume in a calibration: ν of the fit, ν of FEM, and the difference between both.

Rubber is fitted as incompressible, J = 1, unless the study states `poisson_ratio`. FEM needs a finite bulk modulus, so
that the fitted block states the largest ν that FEM accepts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pliant.errors import NotReachedError
from pliant.formatting import number, percent, stress_unit
from pliant.interfaces.material import Material, MaterialConfig
from pliant.mechanics.homogeneous import INCOMPRESSIBLE_RATIO, MODES, incompressible_stress, stress_and_volume
from pliant_calibrate.fitting import RATIO
from pliant_calibrate.free_curve import FreeCurves
from pliant_calibrate.reading import BenchData

Assumption = Literal["incompressible", "stated", "fitted", "default", "law"]
DOUBTFUL_VOLUME, DOUBTFUL_STRESS = 0.01, 0.01


@dataclass(frozen=True)
class EndOfData:
    """A homogeneous test at the stretch farthest from 1, by the fitted block with FEM's ν.

    Attributes:
        stretch: λ.
        volume_ratio: J with free faces at zero stress.
        stress_change: nominal stress over that of the incompressible solid, − 1.
    """

    stretch: float
    volume_ratio: float
    stress_change: float


@dataclass(frozen=True)
class Volume:
    """Assumption of a calibration on the change of volume.

    Attributes:
        assumption: incompressible; ν stated by the study, fitted, or the block's default; or the law's own.
        poisson_ratio: ν of the fitted block, None for a law without one.
        bulk_modulus_pa: K of the fitted block.
        ends: by mode, for tests of homogeneous specimens.
        modulus_change: for a free curve with a default ν, relative change at the ν of incompressible rubber.
    """

    assumption: Assumption
    poisson_ratio: float | None
    bulk_modulus_pa: float
    ends: Mapping[str, EndOfData]
    modulus_change: float | None = None

    @property
    def sentence(self) -> str:
        """Return the assumption in words."""
        nu = f"ν = {number(self.poisson_ratio)}" if self.poisson_ratio is not None else "the law's own volume"
        ends = ", ".join(
            f"J = {number(end.volume_ratio)} at stretch {number(end.stretch, 3)} ({mode})"
            for mode, end in self.ends.items()
        )
        bulk = f"K = {stress_unit(self.bulk_modulus_pa).text(self.bulk_modulus_pa, 3)}"
        if self.assumption == "incompressible":
            return f"Fitted as incompressible; for FEM the block has {nu} ({bulk}; {ends})."
        if self.assumption == "default":
            change = self.modulus_change or 0.0
            side = "lower" if change < 0 else "higher"
            other = f"with {INCOMPRESSIBLE_RATIO} the moduli would be {percent(abs(change))} {side}"
            return f"{nu} ({bulk}) is a default, not measured: {other}."
        return f"Compressible, {nu} ({bulk}), free faces at zero stress{f': {ends}' if ends else ''}."

    def remarks(self) -> list[str]:
        """Return objections to it at the end of the data."""
        words = []
        for mode, end in self.ends.items():
            place = f"at stretch {number(end.stretch, 3)} ({mode})"
            if self.assumption == "incompressible" and abs(end.stress_change) > DOUBTFUL_STRESS:
                side = "below" if end.stress_change < 0 else "above"
                words.append(
                    f"FEM is not quite incompressible: {place} its nominal stress lies "
                    f"{percent(abs(end.stress_change))} {side} the fitted law's."
                )
            if self.assumption == "stated" and abs(end.volume_ratio - 1) > DOUBTFUL_VOLUME:
                words.append(
                    f"The study's {RATIO} of {number(self.poisson_ratio)} makes J {number(end.volume_ratio)} {place}, "
                    "which enters the constants; rubber keeps its volume. Leave it out to fit an incompressible solid."
                )
        return words


def assess_volume(
    study: MaterialConfig,
    material: Material,
    data: BenchData,
    fitted: bool,
    incompressible: bool,
    curves: FreeCurves | None,
) -> Volume:
    """Return the assumption of a calibration on the change of volume.

    Args:
        study: the study's block, which states ν or not.
        material: the fitted one.
        data: fitted data.
        fitted, incompressible: whether ν was a constant of the fit; whether J was 1.
        curves: of a free curve.
    """
    nu = getattr(material.config, RATIO, None)
    assumption: Assumption = "law"
    if nu is not None:
        stated = RATIO in study.model_fields_set
        assumption = (
            "fitted" if fitted else "incompressible" if incompressible else "stated" if stated else "default"
        )
    change = None
    if curves is not None and assumption == "default":
        other = material.config.model_copy(update={RATIO: INCOMPRESSIBLE_RATIO})
        change = curves.first_slope(other) / curves.first_slope(material.config) - 1
    return Volume(assumption, nu, material.bulk_modulus_pa, _ends(material, data), change)


def _ends(material: Material, data: BenchData) -> dict[str, EndOfData]:
    ends: dict[str, EndOfData] = {}
    for mode in MODES:
        stretch = data.x[data.mode == mode]
        if not stretch.size:
            continue
        far = stretch[[np.argmax(np.abs(np.log(stretch)))]]
        try:
            stress, volume = stress_and_volume(material, far, mode)
        except NotReachedError:
            continue
        limit = incompressible_stress(material, far, mode)
        change = float(stress[0] / limit[0] - 1) if limit[0] else 0.0
        ends[mode] = EndOfData(float(far[0]), float(volume[0]), change)
    return ends
