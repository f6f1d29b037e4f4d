"""Inverse statics: hidden actuations are recovered, bounds and rates are respected, unreachable targets are named."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.inverse_statics import two_segments
from scipy.optimize import minimize

from pliant import api
from pliant.errors import UserError
from pliant.interfaces.simulation import Simulation
from pliant.inverse.clearance import Clearance
from pliant.inverse.statics import InverseStatics
from pliant.inverse.target import Target
from pliant.mechanics.signed_distance import solid_from_shape
from pliant.records.chain import Actuator, ChainModel
from pliant.records.law import Domain
from pliant.records.rollout import Inputs
from pliant.records.shape import Shape
from pliant.testing.samples import linear_law, sample_chain, softening_law
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

BOUNDS = {"pressure_pa": (0.0, 15e3)}
OPPOSED = (Actuator("pressure_1_pa"), Actuator("pressure_2_pa", sign=-1.0))
OF_TWO = {"pressure_1_pa": (0.0, 12e3), "pressure_2_pa": (0.0, 9e3)}


def built(chain: ChainModel) -> Simulation:
    return Quasistatic(QuasistaticConfig()).build(chain)


def finger(**more: object) -> ChainModel:
    return sample_chain(softening_law(), modules=6, **more)


def at(simulation: Simulation, values: dict[str, float], force=(0.0, 0.0, 0.0)):
    return simulation.respond(
        Inputs(values, np.array(force, float)), np.zeros((simulation.chain.n_joints, 1))
    )


@pytest.mark.parametrize("pressure_pa", [0.0, 3e3, 9.5e3, 15e3])
def test_a_hidden_pressure_is_found(pressure_pa) -> None:
    simulation = built(finger(payload=0.01))
    tip = at(simulation, {"pressure_pa": pressure_pa}).markers_m[-1]
    found = InverseStatics(simulation, BOUNDS).solve(Target(tip_m=tip))
    assert found.reached and str(found).startswith("Reached with")
    assert found.actuation["pressure_pa"] == pytest.approx(pressure_pa, abs=0.05)


def test_a_backbone_a_direction_and_a_push_are_reached() -> None:
    simulation = built(finger())
    inverse = InverseStatics(simulation, BOUNDS)
    true = at(simulation, {"pressure_pa": 8e3})
    targets = [Target(backbone_m=true.markers_m), Target(direction=3.0 * true.tip_rotation[:, 0])]
    for target in targets:
        assert inverse.solve(target).actuation["pressure_pa"] == pytest.approx(8e3, rel=1e-5)
    push = np.array([0.02, 0.0, 0.01])
    held = at(simulation, {"pressure_pa": 11e3}, -push)
    found = inverse.solve(Target(tip_m=held.markers_m[-1], push_n=push))
    assert found.actuation["pressure_pa"] == pytest.approx(11e3, rel=1e-5)


def test_an_unreachable_pose_is_reported_with_the_closest_one() -> None:
    simulation = built(finger())
    inverse = InverseStatics(simulation, BOUNDS)
    pressures = np.linspace(0.0, 15e3, 251)
    tips = np.array([at(simulation, {"pressure_pa": p}).markers_m[-1] for p in pressures])
    random = np.random.default_rng(4)
    for _ in range(6):
        tip = tips[random.integers(len(tips))] + random.normal(0.0, 0.01, 3)
        found = inverse.solve(Target(tip_m=tip))
        closest = np.linalg.norm(tips - tip, axis=1).min()
        assert not found.reached and str(found).startswith("Out of reach by")
        assert found.distance_m <= closest + 1e-9 and found.distance_m == pytest.approx(closest, rel=1e-3)
    beyond = inverse.solve(Target(tip_m=at(simulation, {"pressure_pa": 25e3}).markers_m[-1]))
    assert beyond.at_limit == {"pressure_pa": "high"} and "pressure_pa at its high limit" in str(beyond)


def test_from_all_pressures_that_reach_it_the_smallest_in_range_shares_is_given() -> None:
    """For linear opposed chambers the tip depends on p₁ − p₂ alone, so that the rule has a closed form."""
    law = linear_law(domain=Domain(np.array([0.0, 2e4]), np.array([[-1.0, 1.0]])))
    simulation = built(sample_chain(law, modules=3).with_(actuators=OPPOSED))
    inverse = InverseStatics(simulation, OF_TWO, samples=64)
    for difference in (5e3, -4e3):
        hidden = {"pressure_1_pa": 5e3 + max(difference, 0.0), "pressure_2_pa": 5e3 + max(-difference, 0.0)}
        hidden = {name: min(value, OF_TWO[name][1]) for name, value in hidden.items()}
        tip = at(simulation, hidden).markers_m[-1]
        found = inverse.solve(Target(tip_m=tip))
        wanted = hidden["pressure_1_pa"] - hidden["pressure_2_pa"]
        assert found.reached
        # The minimum of p₁²/12² + p₂²/9² with p₁ − p₂ given and both positive: the other chamber stays empty.
        np.testing.assert_allclose(
            list(found.actuation.values()), [max(wanted, 0.0), max(-wanted, 0.0)], atol=2.0
        )


def test_along_a_path_rates_hold_and_the_next_is_the_nearest() -> None:
    simulation = built(finger())
    inverse = InverseStatics(simulation, BOUNDS)
    pressures = [2e3, 4e3, 9e3, 9.5e3]
    targets = [Target(tip_m=at(simulation, {"pressure_pa": p}).markers_m[-1]) for p in pressures]
    free = [one.actuation["pressure_pa"] for one in inverse.path(targets)]
    np.testing.assert_allclose(free, pressures, rtol=1e-5)
    limited = inverse.path(targets, {"pressure_pa": 3e4}, time_step_s=0.1)
    got = np.array([one.actuation["pressure_pa"] for one in limited])
    np.testing.assert_allclose(got, [2e3, 4e3, 7e3, 9.5e3], rtol=1e-5)
    assert [one.reached for one in limited] == [True, True, False, True]
    assert limited[2].at_limit == {"pressure_pa": "high"}


def test_the_reachable_set_is_data_within_the_bounds(tmp_path) -> None:
    inverse = InverseStatics(built(finger()), BOUNDS, samples=17)
    found = inverse.reachable
    assert found.actuation.shape == (17, 1) and found.actuation.min() == 0.0 and found.actuation.max() == 15e3
    assert np.all(found.tips_m >= found.limits_m[:, 0]) and np.all(found.tips_m <= found.limits_m[:, 1])
    found.write(tmp_path / "set.csv")
    read = np.genfromtxt(tmp_path / "set.csv", delimiter=",", names=True)
    np.testing.assert_allclose(read["tip_z_m"], found.tips_m[:, 2], atol=1e-8)


def test_compiled_slopes_equal_differences_in_another_engine() -> None:
    chain = finger(payload=0.005)
    values, force = {"pressure_pa": 9e3}, np.array([0.01, 0.02, 0.0])
    ours = built(chain).respond(Inputs(values, force))
    theirs = Mujoco(MujocoConfig()).build(chain).respond(Inputs(values, force))
    for name in ("markers_m", "by_input", "tip_rotation", "tip_spin"):
        one, other = getattr(ours, name), getattr(theirs, name)
        np.testing.assert_allclose(one, other, atol=1e-4 * np.abs(one).max())


def test_opposed_actuators_on_one_input_add_up() -> None:
    """One signal on both sides of a joint with a linear law has no effect."""
    both = (Actuator("pressure_pa"), Actuator("pressure_pa", sign=-1.0))
    found = built(sample_chain(linear_law(), modules=3).with_(actuators=both)).respond(
        Inputs({"pressure_pa": 5e3})
    )
    assert found.by_input.shape == (1, 5, 3)
    np.testing.assert_allclose(found.by_input, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("bounds", "target", "says"),
    [
        ({"pressure_pa": (3e3, 1e3)}, Target(tip_m=np.zeros(3)), "low below high"),
        ({"presure_pa": (0.0, 1e3)}, Target(tip_m=np.zeros(3)), "did you mean 'pressure_pa'"),
        (BOUNDS, Target(push_n=np.ones(3)), "a force alone"),
        (BOUNDS, Target(tip_m=np.array([0.0, np.nan, 0.0])), "finite numbers"),
        (BOUNDS, Target(direction=np.zeros(3)), "direction is zero"),
        (BOUNDS, Target(backbone_m=np.zeros((4, 3))), "8 x 3"),
    ],
)
def test_wrong_input_is_one_sentence(bounds, target, says) -> None:
    with pytest.raises(UserError, match=says):
        InverseStatics(built(finger()), bounds).solve(target)


STUDY = """
pliant: 1
name: finger
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
  domain: {actuation: [0 kPa, 16 kPa], deformation: [-0.5, 0.6]}
chain: {modules: 8, module_length: 11 mm, gravity: [0, 0, 0]}
task: {kind: reach, tip: [59.451 mm, 0 mm, -7.889 mm]}
"""


@pytest.mark.slow
def test_the_worked_number_in_the_conventions_backwards(tmp_path) -> None:
    """contracts.md: eight modules at 15 kPa without gravity have their tip at (0.059451, 0, −0.007889) m."""
    (tmp_path / "finger.yaml").write_text(STUDY)
    opened = api.open_study(tmp_path / "finger.yaml", store=tmp_path / "store")
    found = api.inverse(opened).solve(Target(tip_m=np.array([0.059451, 0.0, -0.007889])))
    assert found.actuation["pressure_pa"] == pytest.approx(15e3, rel=1e-4)
    result = api.simulate(opened).engines[0].result
    assert result.metrics["pressure_pa"] == pytest.approx(15e3, rel=1e-4)
    assert result.metrics["distance_m"] < 1e-6 and not result.not_reached


@pytest.mark.slow
def test_six_pressures_come_to_the_smallest_that_a_general_optimiser_finds_too() -> None:
    """SLSQP from the answer, with the same constraint, finds nothing smaller by 1 %; bounds and target are met."""
    simulation = built(two_segments().chain)
    inverse = InverseStatics(simulation, samples=256)
    low, high = inverse.bounds.T
    for hidden in np.random.default_rng(5).uniform(low, high, (3, 6)):
        tip = simulation.respond(Inputs(dict(zip(inverse.inputs, hidden.tolist(), strict=True)))).markers_m[
            -1
        ]
        found = inverse.solve(Target(tip_m=tip))
        assert found.reached
        x = np.array(list(found.actuation.values())) / high

        def missed(shares, tip=tip):
            values = dict(zip(inverse.inputs, (shares * high).tolist(), strict=True))
            return 1e3 * (simulation.respond(Inputs(values)).markers_m[-1] - tip)

        other = minimize(
            lambda shares: shares @ shares,
            x,
            jac=lambda shares: 2 * shares,
            bounds=[(0.0, 1.0)] * 6,
            constraints={"type": "eq", "fun": missed},
            method="SLSQP",
        )
        assert np.abs(missed(other.x)).max() < 1e-2
        assert x @ x <= 1.01 * (other.x @ other.x) + 1e-6


def test_a_target_with_clearance_keeps_away_from_an_obstacle():
    """Of all pressures on the way to a target behind a ball, the nearest one that stays clear is found."""
    simulation = built(finger())
    inverse = InverseStatics(simulation, BOUNDS)
    free = inverse.solve(Target(tip_m=at(simulation, {"pressure_pa": 12e3}).markers_m[-1]))
    ball = solid_from_shape(Shape("sphere", (4e-3,), free.tip_m, np.eye(3)))
    keeps = Clearance((ball,), radius_m=3e-3, least_m=1e-3)
    clear = inverse.solve(Target(tip_m=free.tip_m, clearance=keeps))
    assert free.reached and not clear.reached
    assert keeps.smallest_m(free.response.markers_m) == pytest.approx(-7e-3)
    # the distance pulls the tip a tenth of a millimetre for each millimetre, no more, into the clearance
    assert keeps.smallest_m(clear.response.markers_m) > 0.8e-3
    # no pressure nearby has less of both
    for pressure_pa in clear.actuation["pressure_pa"] + np.array([-50.0, 50.0]):
        response = at(simulation, {"pressure_pa": pressure_pa})
        r, _ = Target(tip_m=free.tip_m, clearance=keeps).residual(response, 1.0)
        assert np.linalg.norm(r) > clear.distance_m


def test_slopes_of_the_clearance_are_differences():
    simulation = built(finger())
    ball = solid_from_shape(
        Shape("sphere", (6e-3,), at(simulation, {"pressure_pa": 9e3}).markers_m[-2], np.eye(3))
    )
    keeps = Clearance((ball,), radius_m=3e-3, least_m=1e-3)
    response = at(simulation, {"pressure_pa": 8e3})
    r, slopes = keeps.residual(response.markers_m, response.by_input)
    assert r.max() > 1e-2
    sides = [at(simulation, {"pressure_pa": 8e3 + step}) for step in (1.0, -1.0)]
    up, down = (keeps.residual(one.markers_m, one.by_input)[0] for one in sides)
    np.testing.assert_allclose(slopes[:, 0], (up - down) / 2.0, atol=1e-3 * np.abs(slopes).max())
    squared = keeps.squared(response.markers_m[None])
    assert squared[0] == pytest.approx(r @ r)
