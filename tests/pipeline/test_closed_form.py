"""A family with a law in closed form needs no mesh, and a stated law uses the family's geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.families import check_design
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.material import Material
from pliant.interfaces.surrogate import FittedLaw, Surrogate, SurrogateConfig
from pliant.pipeline.run_folder import read_folder, write_folder
from pliant.pipeline.study import StudyRun, simulate_study
from pliant.pipeline.workbench import RunContext
from pliant.records.design import MassProperties, ModuleMass
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointLaw, LawRecord
from pliant.registry.component import Component
from pliant.registry.discovery import Registry, discover
from pliant.store.store import ArtifactStore
from pliant.testing import run_checks
from pliant.testing.samples import LinearLaw
from pliant.units import Length

SHEAR_PA, PRESSURE_PA = 200e3, 5e3


class HoseConfig(FamilyConfig):
    """A hose that bends like a beam under a pressure with an offset from its axis."""

    kind: Literal["hose"] = "hose"
    radius_m: Length = 4e-3
    module_length_m: Length = 20e-3


def hose_law(radius_m: float, length_m: float, shear_pa: float) -> JointLaw:
    """Return τ = r³ p − E π r⁴ u / (4 l) of a full rod with E = 3 G."""
    stiffness = 3 * shear_pa * np.pi * radius_m**4 / (4 * length_m)
    box = Domain(np.array([0.0, 20e3]), np.array([[-1.0, 1.0]]))
    return LinearLaw(np.array([radius_m**3]), np.array([[stiffness]]), box)


class Hose(ActuatorFamily):
    """A hose without a mesh."""

    config: HoseConfig

    def __init__(self, config: HoseConfig) -> None:
        super().__init__(config)
        check_design(config, [])

    @property
    def module_length_m(self) -> float:
        return self.config.module_length_m

    def closed_form(self, material: Material | None) -> JointLaw | None:
        if material is None:
            raise UserError("family 'hose' needs a 'material' block.")
        return hose_law(self.config.radius_m, self.module_length_m, material.shear_modulus_pa)

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = {}) -> ModuleMass:
        half = density_kg_m3 * np.pi * self.config.radius_m**2 * self.module_length_m / 2
        places = [np.array([s * self.module_length_m / 4, 0.0, 0.0]) for s in (-1, 1)]
        return ModuleMass(*[MassProperties(half, place, 1e-9 * np.eye(3)) for place in places])


class HoseLawConfig(SurrogateConfig):
    """The law of a hose of this modulus, whatever the study's material."""

    kind: Literal["hose_law"] = "hose_law"


class HoseLaw(Surrogate):
    """A surrogate that states a law for the given family."""

    def stated_for(self, family: ActuatorFamily | None, material: Material | None) -> JointLaw | None:
        assert isinstance(family, Hose)
        return hose_law(family.config.radius_m, family.module_length_m, SHEAR_PA)

    def fit(self, data: FemDataset) -> FittedLaw:
        raise UserError("nothing is fitted")

    def load(self, record: LawRecord) -> JointLaw:
        raise UserError("nothing is stored")


HERE = f"{__name__}:"
FAMILY = Component("family", "hose", f"{HERE}HoseConfig", f"{HERE}Hose", "a hose")
LAW = Component("surrogate", "hose_law", f"{HERE}HoseLawConfig", f"{HERE}HoseLaw", "its law")
STUDY = """\
pliant: 1
name: hose
family: {kind: hose, radius: 4 mm}
material: {kind: neo_hookean, shear_modulus: 200 kPa}
chain: {modules: 1, gravity: [0, 0, 0]}
task: {kind: free_bending, pressure: 5 kPa}
"""


@pytest.fixture(scope="module")
def registry() -> Registry:
    found = discover()
    return replace(found, components=(*found.components, FAMILY, LAW))


def run(folder: Path, registry: Registry, *overrides: str) -> StudyRun:
    (folder / "study.yaml").write_text(STUDY)
    study = load_study(folder / "study.yaml", registry, overrides)
    return simulate_study(RunContext(registry, ArtifactStore(folder / "store")), study)


def angle(done: StudyRun) -> float:
    (engine,) = done.engines
    assert engine.result is not None
    return float(engine.result.final.joint_angles[0, 0])


def bend(radius_m: float, shear_pa: float) -> float:
    """Return u at τ = 0: r³ p · 4 l / (3 G π r⁴)."""
    return PRESSURE_PA * 4 * 20e-3 / (3 * shear_pa * np.pi * radius_m)


@pytest.mark.parametrize("law", ["", "surrogate.kind=hose_law"])
def test_the_law_follows_the_design(tmp_path: Path, registry: Registry, law: str) -> None:
    """One store serves all: a law stated for one design or material must not be used for another."""
    own = [law] if law else []
    assert angle(run(tmp_path, registry, *own)) == pytest.approx(bend(4e-3, SHEAR_PA), rel=1e-6)
    wide = run(tmp_path, registry, "family.radius=6 mm", *own)
    assert angle(wide) == pytest.approx(bend(6e-3, SHEAR_PA), rel=1e-6)
    stiff = run(tmp_path, registry, "material.shear_modulus=400 kPa", *own)
    # the surrogate has its own modulus
    assert angle(stiff) == pytest.approx(bend(4e-3, SHEAR_PA if law else 2 * SHEAR_PA), rel=1e-6)


@pytest.mark.parametrize("law", ["", "surrogate.kind=hose_law"])
def test_a_folder_is_read_again_with_its_law(tmp_path: Path, registry: Registry, law: str) -> None:
    done = run(tmp_path, registry, "family.radius=6 mm", *([law] if law else []))
    write_folder(tmp_path / "out", done, {})
    (design,) = read_folder(tmp_path / "out", registry).designs
    p, u = np.array([PRESSURE_PA]), np.array([[bend(6e-3, SHEAR_PA)]])
    assert design.law.evaluate(p, u).tau[0, 0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (["fem.kind=skfem", "fem.pressure_max=8 kPa"], "family 'hose' has no mesh: its law is a closed form"),
        (["material=null"], "family 'hose' needs a 'material' block"),
    ],
)
def test_what_a_closed_form_cannot_do_is_said(
    tmp_path: Path, registry: Registry, overrides: list[str], says: str
) -> None:
    with pytest.raises(UserError, match=says):
        run(tmp_path, registry, *overrides)


def test_it_passes_the_suite_without_a_mesh() -> None:
    outcomes: dict[str, Any] = {o.name: o for o in run_checks(FAMILY)}
    assert [o.message for o in outcomes.values() if o.status == "failed"] == []
    assert outcomes["closed_form_matches_the_module"].status == "passed"
    assert "has no mesh" in outcomes["elements_are_valid"].message
