"""Scores on designs left out: closed forms, parts, resumption after an interruption."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.execution.progress import Silent
from pliant.records.law import Effort, JointLaw
from pliant.testing.samples import linear_law
from pliant_designs.cross_validation import (
    Scores,
    cross_validation_folds,
    free_branch,
    misses_left_out,
    scores_by_place,
)
from pliant_designs.meta_model import DesignLaws, FittedMetaModel, MetaModel, MetaModelConfig
from pliant_designs.samples import (
    PRESSURE_PA,
    sample_law,
    solved_designs,
    solved_spherical_designs,
    spherical_sample_law,
)
from pliant_designs.stand_in import StandInMetaModel, StandInMetaModelConfig


@dataclass(frozen=True, eq=False)
class Off(JointLaw):
    """A law with a constant error."""

    law: JointLaw
    by: float

    def __post_init__(self):
        for name in ("joint", "axes", "actuation_name", "domain"):
            object.__setattr__(self, name, getattr(self.law, name))

    def evaluate(self, actuation, deformation):
        effort = self.law.evaluate(actuation, deformation)
        return Effort(effort.tau + self.by, effort.dtau_dp, effort.dtau_du)

    def record(self):
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class KnownLaws(DesignLaws):
    """The true laws with a constant error."""

    true: object
    by: float

    def law(self, values):
        return Off(self.true(values), self.by)

    def record(self):
        raise NotImplementedError


class Known(MetaModel):
    """A model that knows the law of every design without a fit; `fits` counts them, `stop` interrupts one."""

    def __init__(self, true=sample_law, by=0.0, stop=None):
        super().__init__(MetaModelConfig(kind="known"))
        self.true, self.by, self.stop, self.fits = true, by, stop, 0

    def fit(self, designs):
        if self.fits == self.stop:
            raise KeyboardInterrupt
        self.fits += 1
        return FittedMetaModel(KnownLaws(self.true, self.by))

    def load(self, record):
        raise NotImplementedError


def scores(model, designs, folder, folds=4):
    parts = cross_validation_folds(designs, folds, model.fewest)
    return scores_by_place(designs, misses_left_out(model, designs, parts, folder, Silent()))


def test_a_true_law_has_no_error(tmp_path):
    found = scores(Known(), solved_designs(), tmp_path)
    assert {place: one.n_designs for place, one in found.items()} == {"all": 16, "interior": 4, "border": 12}
    assert found["all"].axes["y"].worst < 1e-12
    assert found["all"].r2 == pytest.approx(1.0, abs=1e-12)
    assert found["all"].free_worst < 1e-8
    assert found["all"].free_lost == 0


def test_a_constant_error_is_the_rmse_and_the_worst(tmp_path):
    designs, by = solved_designs(), 3e-4
    found = scores(Known(by=by), designs, tmp_path)["all"].axes["y"]
    tau = np.concatenate([one.tau[:, 0] for one in designs.data])
    narrowest = min(float(np.ptp(one.tau)) for one in designs.data)
    assert found.n_states == len(tau)
    assert found.rmse == pytest.approx(by)
    assert found.worst == pytest.approx(by)
    assert found.worst_of_range == pytest.approx(by / narrowest)
    assert found.r2 == pytest.approx(1 - by**2 / tau.var())


@pytest.mark.slow
def test_three_axes_are_scored_each(tmp_path):
    found = scores(Known(spherical_sample_law), solved_spherical_designs(), tmp_path)["all"]
    assert set(found.axes) == {"x", "y", "z"}
    assert found.axes["x"].n_states < found.axes["y"].n_states  # others do not move x
    assert found.worst_of_range < 1e-9


def test_untrusted_states_are_not_scored(tmp_path):
    designs = solved_designs((2, 4))
    first = designs.data[0]
    status = first.status.astype("<U12")
    status[-3:] = "self_contact"
    marred = replace(first, status=status, tau=np.where(status[:, None] == "ok", first.tau, 99.0))
    found = scores(Known(), replace(designs, data=(marred, *designs.data[1:])), tmp_path)["all"]
    assert found.axes["y"].worst < 1e-12
    assert found.axes["y"].n_states == sum(map(len, designs.data)) - 3


def test_the_free_branch_with_three_axes_is_its_equilibrium():
    law = spherical_sample_law([7e-3, 1.4e-3])
    pressures = np.array([4e3, 9e3, PRESSURE_PA])
    found = free_branch(law, pressures)
    assert np.abs(law.evaluate(pressures, found).tau).max() < 1e-12
    assert np.all(np.diff(found[:, 1]) > 0.05)
    assert np.abs(found[:, [0, 2]]).max() < 1e-12  # nothing turns it out of its mirror plane


def test_a_law_without_a_free_branch_counts_as_infinitely_wrong(tmp_path):
    upside_down = linear_law(stiffness=-0.04, domain=sample_law([7e-3, 1.4e-3]).domain)
    assert np.all(np.isnan(free_branch(upside_down, np.array([5e3, 1e4]))))
    found = scores(Known(lambda values: upside_down), solved_designs((2, 4)), tmp_path)["all"]
    assert found.free_lost == found.free_states > 0
    assert found.free_median == np.inf


def test_each_design_is_left_out_once_in_the_same_parts_each_time():
    designs = solved_designs((5, 5))
    one, other = (cross_validation_folds(designs, 6, 4) for _ in range(2))
    assert sorted(np.concatenate(one)) == list(range(25))
    assert len(one) == 6
    assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_an_interruption_loses_one_part(tmp_path):
    designs = solved_designs()
    parts = cross_validation_folds(designs, 5, 4)
    with pytest.raises(KeyboardInterrupt):
        misses_left_out(Known(stop=3), designs, parts, tmp_path, Silent())
    again = Known()
    resumed = misses_left_out(again, designs, parts, tmp_path, Silent())
    assert again.fits == 2
    whole = misses_left_out(Known(), designs, parts, tmp_path / "fresh", Silent())
    assert np.array_equal(resumed.miss, whole.miss)
    assert np.array_equal(resumed.size, whole.size)


def test_a_damaged_part_is_made_anew(tmp_path):
    designs = solved_designs((2, 4))
    parts = cross_validation_folds(designs, 2, 4)
    misses_left_out(Known(), designs, parts, tmp_path, Silent())
    (tmp_path / "part-1" / "arrays.npz").write_bytes(b"torn")
    again = Known()
    misses_left_out(again, designs, parts, tmp_path, Silent())
    assert again.fits == 1


def test_scores_survive_the_store(tmp_path):
    model = StandInMetaModel(StandInMetaModelConfig())
    one = scores(model, solved_designs(), tmp_path)["border"]
    assert Scores.from_values(one.as_values()) == one


def test_few_designs_are_left_out_one_by_one_and_too_few_are_refused():
    assert len(cross_validation_folds(solved_designs((3, 4)), 8, 4)) == 12
    assert len(cross_validation_folds(solved_designs((2, 3)), 8, 4, stated=False)) == 6
    with pytest.raises(UserError, match=r"folds is 60, and there are 16 designs; at most 16"):
        cross_validation_folds(solved_designs(), 60, 4)
    with pytest.raises(UserError, match="fitted to at least 4 designs and scored on one more, so 4 are too"):
        cross_validation_folds(solved_designs((2, 2)), 4, 4)
