"""Learning curves over states: nested spread subsets, decreasing errors, unfittable subsets, cached results."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pliant.pipeline.learning import (
    WITH,
    WITHOUT,
    learning_curve,
    learning_stage,
    spread_order,
    states_needed,
    subset_sizes,
    with_checks,
)
from pliant.pipeline.residuals import Residuals, as_module_data, as_scored, module_from_axes
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import ModuleData
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore
from pliant.testing.samples import linear_law, sample_table, softening_law
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial


def data(noise_n_m: float = 0.0) -> ModuleData:
    return as_module_data(sample_table(softening_law(), noise_n_m=noise_n_m))


def polynomial() -> Polynomial:
    return Polynomial(PolynomialConfig(kind="polynomial", max_degree=3))


def test_an_order_is_spread_from_its_beginning() -> None:
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 5), np.linspace(-2, 2, 5)))
    places, one = np.stack([x, y], axis=1), np.full(25, "y")
    order = spread_order(places, one, seed=0)
    assert sorted(order) == list(range(25))
    assert {tuple(places[i]) for i in order[:4]} == {(0, -2), (0, 2), (1, -2), (1, 2)}
    assert tuple(places[order[4]]) == (0.5, 0)  # the farthest from the corners, by shares of the ranges
    assert np.array_equal(order, spread_order(places, one, seed=0))
    other = spread_order(places, one, seed=1)
    assert not np.array_equal(order, other) and sorted(other) == list(range(25))


def test_errors_vanish_for_a_law_in_the_surrogates_own_form() -> None:
    curve = learning_curve(
        Polynomial(PolynomialConfig(kind="polynomial")), as_module_data(sample_table(linear_law()))
    )
    assert curve["n_check"] == 10
    last = [p for p in curve["points"] if p["n"] == max(curve["sizes"])]
    assert {p["slopes"] for p in last} == {WITH, WITHOUT}
    assert all(p["worst"] < 1e-8 for p in last)
    assert {p["n"] for p in curve["left_out"]} == {4}
    assert "at least 6 states" in curve["left_out"][0]["cause"]


def test_scores_equal_the_law_from_all_states() -> None:
    module = data(noise_n_m=5e-5)
    curve = learning_curve(polynomial(), module)
    law = polynomial().fit_module(module).law
    check = module.role == "check"
    missed = law.evaluate(module.actuation, module.deformation).tau[check] - module.tau[check]
    share = np.abs(missed) / np.ptp(module.tau)
    point = next(p for p in curve["points"] if p["slopes"] == WITH and p["n"] == 42)
    assert point["worst"] == pytest.approx(share.max(), rel=1e-9)
    assert point["rms"] == pytest.approx(np.sqrt(np.mean(share**2)), rel=1e-9)


def test_slopes_are_blanked_and_check_states_never_fitted() -> None:
    seen = []

    class WatchedPolynomial(Polynomial):
        def fit_module(self, module):  # type: ignore[no-untyped-def]
            seen.append(module)
            return super().fit_module(module)

    curve = learning_curve(WatchedPolynomial(PolynomialConfig(kind="polynomial", max_degree=2)), data())
    assert len(seen) == 2 * len(curve["sizes"])
    with_slopes, without = seen[: len(seen) // 2], seen[len(seen) // 2 :]
    assert all(np.isfinite(one.dtau_du).all() for one in with_slopes)
    assert all(np.isnan(one.dtau_du).all() and np.isnan(one.dtau_dp).all() for one in without)
    sizes = [int((one.role == "fit").sum()) for one in with_slopes]
    assert sizes == curve["sizes"]
    for few, more in pairwise(with_slopes):
        states = [set(map(tuple, np.column_stack([m.actuation, m.deformation]))) for m in (few, more)]
        assert states[0] <= states[1]


def test_states_needed_are_those_from_which_on_all_are_good() -> None:
    points = [
        {"slopes": WITH, "order": 0, "n": n, "rms": e}
        for n, e in ((6, 9e-5), (8, 2e-4), (11, 9e-5), (16, 1e-5))
    ]
    assert states_needed({"points": points}, 1e-4) == 11
    assert states_needed({"points": points}, 1e-6) is None
    assert states_needed({"points": points}, 1e-4, WITHOUT) is None


def test_a_table_without_check_states_holds_out_inner_ones() -> None:
    module = replace(data(), role=np.full(len(data()), "fit"))
    held = with_checks(module)
    check = held.role == "check"
    assert check.sum() == round(0.2 * len(module))
    p, u = module.actuation[check], module.deformation[check, 0]
    assert p.min() > module.actuation.min() and p.max() < module.actuation.max()
    assert u.min() > module.deformation.min() and u.max() < module.deformation.max()
    assert with_checks(data()).role.tolist() == data().role.tolist()


def test_an_interrupted_curve_goes_on_and_a_damaged_one_starts_anew(tmp_path: Path) -> None:
    kept = tmp_path / "points.json"
    first = learning_curve(polynomial(), data(), kept=kept)
    never = SimpleNamespace(fit_module=None)  # would fail if it were evaluated
    assert learning_curve(never, data(), kept=kept) == first  # type: ignore[arg-type]
    kept.write_text("{")
    again = learning_curve(polynomial(), data(), kept=kept)
    assert [p["worst"] for p in again["points"]] == [p["worst"] for p in first["points"]]


def test_the_store_gives_the_curve_again(tmp_path: Path) -> None:
    context = RunContext(discover(), ArtifactStore(tmp_path))
    config = PolynomialConfig(kind="polynomial", max_degree=2)
    first = learning_stage(context, config, data(), {"law": "a"})
    again = learning_stage(context, config, data(), {"law": "a"})
    assert not first.cached and again.cached and again.value == first.value
    assert not learning_stage(context, config, data(), {"law": "b"}).cached


def test_misses_count_each_axis_in_its_own_states_and_all_where_all_are_held() -> None:
    one = sample_table(linear_law())
    module = module_from_axes({"y": one, "x": replace(one, axis="x")}, ("x", "y"))
    together = replace(module, explored=np.where(np.arange(len(module)) < 3, "coupling", module.explored))
    missed = Residuals.from_prediction(
        together, ("x", "y"), lambda p, u: np.nan_to_num(together.tau) + [0.0, 1e-3], box(2)
    )
    assert missed.ranges == pytest.approx([np.ptp(one.moment_n_m[: len(one)])] * 2)
    assert (missed.axis[missed.state >= 3] == (module.explored[missed.state[missed.state >= 3]] == "y")).all()
    assert missed.share[missed.axis == 1] == pytest.approx(1e-3 / missed.ranges[1])
    assert np.all(missed.share[missed.axis == 0] == 0)
    inner = missed.rows(missed.check)
    assert len(inner.state) == 20 and inner.worst == pytest.approx(1e-3 / missed.ranges[1])


def test_states_outside_the_box_or_not_trusted_are_not_scored() -> None:
    module = data()
    law = replace(softening_law())
    every = Residuals.from_law(module, law)
    assert len(every.state) == len(module) and every.worst < 1e-15
    narrow = Residuals.from_prediction(
        module, ("y",), lambda p, u: 0 * u, np.array([[0.0, 7e3], [-0.1, 0.2]])
    )
    assert module.actuation[narrow.state].max() <= 7e3 and module.deformation[narrow.state].max() <= 0.2
    touching = replace(module, status=np.where(np.arange(len(module)) < 5, "self_contact", "ok"))
    assert len(Residuals.from_law(touching, law).state) == len(module) - 5


def test_the_scored_states_in_a_table_are_found_again() -> None:
    module = replace(data(), role=np.full(len(data()), "fit"))
    report = polynomial().fit_module(module).report
    scored = as_scored(module, report)
    assert (scored.role == "check").sum() == report.n_heldout
    assert Residuals.from_law(scored, polynomial().fit_module(module).law).rows(
        scored.role == "check"
    ).worst == (pytest.approx(report.worst_of_range, rel=1e-9))


def box(axes: int) -> np.ndarray:
    return np.tile([-np.inf, np.inf], (1 + axes, 1))


def test_axes_take_turns_and_sizes_grow_by_root_two_to_all_states() -> None:
    groups = np.array(["y"] * 8 + ["x"] * 4)
    order = spread_order(np.random.default_rng(0).random((12, 3)), groups, seed=0)
    assert groups[order][:8].tolist() == ["y", "x"] * 4
    assert (subset_sizes(30), subset_sizes(4)) == ([4, 6, 8, 11, 16, 23, 30], [4])
