"""Several axes: lateral laws with the main axis free, symmetry tested, coupling recorded, rows of the data."""

from __future__ import annotations

import numpy as np
import pytest
from tests.pipeline.analytic import full_and_main, helix

from pliant.pipeline.dataset import module_rows
from pliant.records.design import Design
from pliant.records.fem import ModuleData

AXES = ("x", "y", "z")


def run(folder, potential, **changes: object):
    sampling, _, full = full_and_main(potential, folder, **changes)
    return sampling, full


def data(sampling) -> ModuleData:
    return ModuleData(
        design=Design("helix", {}),
        joint="spherical",
        axes=AXES,
        main_axis="y",
        actuation_name="pressure_pa",
        sampling=sampling.summary,
        **module_rows(sampling, AXES, "y"),
    )


def test_lateral_states_leave_the_main_axis_free(tmp_path):
    sampling, _ = run(tmp_path, helix())
    for axis in ("x", "z"):
        k = AXES.index(axis)
        lateral = [s.state for s in sampling.solved if s.target.explored == axis]
        assert len(lateral) >= 4
        for state in lateral:
            assert state.held == (axis,)
            assert abs(state.tau[1]) < 1e-12
        reached = [abs(float(state.deformation[k])) for state in lateral]
        assert max(reached) == pytest.approx(0.3)


def test_a_symmetric_module_is_recognised_and_copied_to_the_other_side(tmp_path):
    sampling, full = run(tmp_path, helix())
    module = data(sampling)
    assert sampling.mirrored == ("x", "z")
    assert sampling.summary["axes"]["z"]["difference_of_sides"] < 1e-9
    for axis in ("x", "z"):
        law = module.axis(axis).select("fit")
        assert law.angle_rad.min() == -law.angle_rad.max() == pytest.approx(-0.3)
    copies = np.flatnonzero(module.wall_s == 0)
    assert copies.size > 0
    for row in copies:  # each copy is an equilibrium of the potential
        tau, by_p, K = full.potential.law(module.actuation[row], module.deformation[row])
        np.testing.assert_allclose(module.tau[row], tau, atol=1e-12)
        np.testing.assert_allclose(module.dtau_dp[row], by_p, atol=1e-12)
        np.testing.assert_allclose(module.dtau_du[row], K, atol=1e-12)


@pytest.mark.slow
def test_a_module_without_mirror_planes_is_sampled_on_both_sides(tmp_path):
    sampling, _ = run(tmp_path, helix(one_sided=0.5), lateral_states=12)
    assert "z" not in sampling.mirrored
    assert sampling.summary["axes"]["z"]["difference_of_sides"] > 1e-3
    fit = [s.state for s in sampling.solved if s.target.explored == "z" and s.target.role == "fit"]
    angles = np.array([s.deformation[2] for s in fit])
    assert np.sum(angles < 0) >= 2
    assert np.sum(angles > 0) >= 2


@pytest.mark.slow
def test_lateral_axis_slopes_follow_the_free_main_axis(tmp_path):
    sampling, full = run(tmp_path, helix())
    law = data(sampling).axis("z")
    far = np.flatnonzero((np.abs(law.angle_rad) > 0.1) & (law.branch == "constrained"))
    h = 1e-5
    assert far.size
    for row in far:
        p, u = law.actuation[row], law.angle_rad[row]

        def tau(dp: float, du: float, p=p, u=u) -> float:
            return full.constrained(p + dp, {"z": u + du}, full.rest()).tau[2]

        assert law.dmoment_du[row] == pytest.approx((tau(0, h) - tau(0, -h)) / (2 * h), rel=1e-6)
        assert law.dmoment_dp[row] == pytest.approx((tau(h, 0) - tau(-h, 0)) / (2 * h), rel=1e-5, abs=1e-8)


@pytest.mark.slow
def test_coupling_states_hold_everything_and_the_coupling_is_recorded(tmp_path):
    sampling, full = run(tmp_path, helix(), coupling_states=6)
    module = data(sampling)
    mixed = np.flatnonzero(module.explored == "coupling")
    assert len(mixed) == 6
    assert np.all(np.abs(module.tau[mixed, 1]) > 1e-9)
    record = sampling.summary["coupling"]
    assert record["largest_asymmetry"] < 1e-12
    assert record["pieces_differ"] < 1e-12
    K = full.potential.law(record["actuation"], np.array(record["deformation"]))[2]
    i, j = (AXES.index(axis) for axis in record["between"])
    assert record["largest"] == pytest.approx(abs(K[i, j]) / np.sqrt(K[i, i] * K[j, j]))


@pytest.mark.slow
def test_rows_on_the_main_axis_alone_say_what_they_do_not_know(tmp_path):
    sampling, full = run(tmp_path, helix())
    module = data(sampling)
    main = module.explored == "y"
    assert np.all(module.deformation[main][:, [0, 2]] == 0)
    assert np.isnan(module.dtau_du[main][:, 2, 2]).all()
    law = module.axis("y")
    assert np.isfinite(law.dmoment_du).all()
    for p, u, tau in zip(law.actuation, law.angle_rad, law.moment_n_m, strict=True):
        assert tau == pytest.approx(full.potential.law(p, np.array([0.0, u, 0.0]))[0][1], abs=1e-12)
    assert module.explored_axes() == ("y", "x", "z")


@pytest.mark.slow
def test_an_interrupted_sampling_with_several_axes_solves_nothing_twice(tmp_path):
    whole, _, _ = full_and_main(helix(), tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        full_and_main(helix(), tmp_path / "part", stop_after=7)
    resumed, main, full = full_and_main(helix(), tmp_path / "part")
    assert (
        main.solved == []
        and len(full.solved) == len([s for s in whole.solved if s.target.piece == "full"]) - 7
    )
    assert [s.target for s in resumed.solved] == [s.target for s in whole.solved]
