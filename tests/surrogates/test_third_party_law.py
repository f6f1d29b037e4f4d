"""Laws and surrogates of other packages: their own bands are used, and untrusted states are left out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pytest

from pliant.fem_tables.reading import read_table
from pliant.interfaces.surrogate import FittedLaw, Surrogate, SurrogateConfig
from pliant.mechanics.law_draws import draws
from pliant.mechanics.shared_actuation import SharedActuation
from pliant.mechanics.shared_elasticity import SharedElasticity
from pliant.pipeline.simulate import drawn_chains
from pliant.pipeline.surrogate import law_stage
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, Effort, FitReport, JointLaw, LawRecord
from pliant.registry.component import Component
from pliant.registry.discovery import Registry
from pliant.store.store import ArtifactStore
from pliant.testing.samples import sample_chain

HALF_N_M = 3e-4


@dataclass(frozen=True, eq=False)
class Banded(JointLaw):
    """τ = g p − k u, correct to ± 3e-4 N·m with a probability of 90 %, which its own `band` states."""

    domain: Domain
    error: Any = None
    joint = "revolute"
    axes = ("y",)
    actuation_name = "pressure_pa"

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        ones = np.ones((len(deformation), 1))
        tau = 8e-7 * np.asarray(actuation)[:, None] - 0.04 * deformation
        return Effort(tau, 8e-7 * ones, -0.04 * ones[:, :, None])

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array:
        # equally wide at any level: the test reads the width itself
        return HALF_N_M * (1.0 + np.asarray(actuation, float)[:, None] / 1e4) * np.ones_like(deformation)

    def record(self) -> LawRecord:
        return LawRecord("banded", {}, {"box": self.domain.box})


class Wide:
    """An error that is no `ErrorBar`."""

    def half_width(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array:
        return HALF_N_M * (1.0 + np.asarray(actuation, float)[:, None] / 1e4) * np.ones_like(deformation)


class WithError(Banded):
    """The same by an object with `half_width`."""

    band = JointLaw.band  # type: ignore[assignment]


BOX = Domain(np.array([0.0, 1e4]), np.array([[-0.2, 0.4]]))
LAWS = [Banded(BOX), WithError(BOX, Wide())]


class BandedConfig(SurrogateConfig):
    """A config without settings."""

    kind: Literal["banded"] = "banded"


class BandedFit(Surrogate):
    """A fit that stores its input."""

    seen: ClassVar[list[FemDataset]] = []

    def fit(self, data: FemDataset) -> FittedLaw:
        self.seen.append(data)
        return FittedLaw(Banded(BOX), FitReport(len(data), 0, 0.0, 0.0, 0.0, 1.0, 1.0, {}))

    def load(self, record: LawRecord) -> JointLaw:
        return Banded(BOX)


class Judging(BandedFit):
    """A fit that requests all states."""

    gets_untrusted = True


@pytest.mark.parametrize("law", LAWS)
def test_a_separate_band_counts_as_an_error(law: JointLaw) -> None:
    assert law.states_error
    assert SharedElasticity(law, 2).states_error
    chains = drawn_chains(sample_chain(law, modules=1), 200, seed=1)
    p, u = np.array([0.0, 1e4]), np.array([[0.1], [0.1]])
    taus = np.array([chain.laws[0].evaluate(p, u).tau[:, 0] for chain in chains])
    # a random function as large as the band at one σ, whatever its level here; twice as large at 10 kPa
    spread = taus.std(axis=0)
    assert spread[1] / spread[0] == pytest.approx(2.0, rel=0.35)


def test_a_law_without_either_states_none() -> None:
    assert not replace(WithError(BOX), error=None).states_error
    with pytest.raises(ValueError, match="no error bar"):
        draws(WithError(BOX), 2, 0)


def test_the_error_behind_a_share_in_the_actuation_is_that_at_the_share() -> None:
    half = SharedActuation(WithError(BOX, Wide()), 0.5)
    p, u = np.array([1e4]), np.zeros((1, 1))
    assert half.error is not None
    assert half.error.half_width(p, u)[0, 0] == pytest.approx(1.5 * HALF_N_M)
    band = half.band(p, u)
    assert band is not None and band[0, 0] == pytest.approx(1.5 * HALF_N_M)


TABLE = """\
pressure_pa,angle_rad,moment_n_m,status,role
0,0,0,ok,fit
0,0.1,-0.004,ok,fit
5000,0,0.004,touching,fit
5000,0.1,0,passed_through,fit
9000,0.3,0.5,self_contact,fit
9000,0.2,0.4,self_contact,check
"""


@pytest.mark.parametrize(("cls", "states"), [("BandedFit", 4), ("Judging", 6)])
def test_states_in_self_contact_reach_the_fits_that_ask_for_them(
    tmp_path: Path, cls: str, states: int
) -> None:
    (tmp_path / "fem.csv").write_text(TABLE)
    here = f"{__name__}:"
    component = Component("surrogate", "banded", f"{here}BandedConfig", f"{here}{cls}", "a stand-in")
    context = RunContext(Registry((component,)), ArtifactStore(tmp_path / "store"))
    BandedFit.seen.clear()
    stage = law_stage(context, BandedConfig(data=tmp_path / "fem.csv"), None)
    (seen,) = BandedFit.seen
    assert len(seen) == states
    assert ("self_contact" in seen.status) == (states == 6)
    assert stage.data is not None and len(stage.data) == 6  # pictures show them


def test_a_role_is_selected_among_trusted_states(tmp_path: Path) -> None:
    (tmp_path / "fem.csv").write_text(TABLE)
    data = read_table(tmp_path / "fem.csv")
    assert sorted(data.select("fit").status) == ["ok", "ok", "passed_through", "touching"]
    assert len(data.select("check")) == 0
