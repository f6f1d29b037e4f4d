"""Histories in the compiled loop: equal to plain stepping, with correct derivatives, and with reported failures."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from tests.diagnosis.quick import BENCH, ENGINE, MORE_VALUES, REGISTRY, VALUES, P, effect

from pliant.diagnosis.candidates import candidate_kinds
from pliant.diagnosis.diagnosis import is_record_mistake
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.interfaces.physics import Variation
from pliant.records.chain import Actuator, ChainModel
from pliant.records.history import Followed, History
from pliant.records.term import LawTerm
from pliant.testing.samples import linear_law, linear_spherical_law, sample_chain, softening_law
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.hinge import law_at
from pliant_plugins.physics.quasistatic.loop_laws import tabulate
from pliant_plugins.physics.stepping import step_through

STRENGTHS = {**VALUES, **MORE_VALUES}
KINDS = tuple(STRENGTHS)
# They change readings and no joint.
READ_ONLY = ("sensor_bias", "sensor_scale", "sensor_lag", "backlash", "link_stretch")
# Made for chains driven by a tendon or by several inputs, and tested with them.
ELSEWHERE = {"tendon_friction", "tendon_slack", "unequal_actuators"}


def history(run: str = "a", **changes: object) -> History:
    """Return a history up, down and up with loads that change on the way."""
    t = 0.25 * np.arange(41)
    p = np.interp(t, [0.0, 3.0, 5.0, 10.0], [1e3, P, 2e3, 0.8 * P])
    force = 0.01 * np.stack([np.sin(t), 0.3 * np.cos(t), 0.5 * np.sin(0.7 * t)], axis=1)
    loads = {"tip_force_n": force, "moment_n_m": 1e-3 * np.sin(0.9 * t)}
    return History.from_arrays({"pressure_pa": p}, t, run=run, temperature_c=30.0, **loads).with_(**changes)


def with_effects(chain: ChainModel, *kinds: str) -> Model:
    model = Model(chain)
    for kind in kinds:
        model = BENCH.build("effect", effect(kind)).apply(model)
    return model


def agree(chain: ChainModel, histories: list[History], atol: float = 3e-8) -> list[Followed]:
    compiled, _ = ENGINE.follow(chain, histories)
    plain, _ = step_through(ENGINE.build, chain, histories, [], ENGINE.config.longest_step_s)
    for a, b in zip(compiled, plain, strict=True):
        assert a.converged.all()
        assert b.converged.all()
        np.testing.assert_allclose(a.joint_angles, b.joint_angles, atol=atol, rtol=0)
    return list(compiled)


# -- the same as plain stepping -----------------------------------------------------------------------


@pytest.mark.parametrize("modules", [1, 3, 8])
def test_loads_payload_and_pose_equal_plain_stepping(modules: int) -> None:
    chain = sample_chain(modules=modules, turns_rad=(0.0, 0.9), payload=0.004)
    tilted = history("tilted", base_angles_rad=np.tile([0.3, -0.5, 0.8], (41, 1)))
    hung = history("hung", payload_kg=np.full(41, 0.01))
    agree(chain, [history(), tilted, hung, history("slow", time_s=None)])


def test_a_base_that_turns_and_a_payload_that_grows_are_followed_sample_by_sample() -> None:
    chain = sample_chain(modules=4, payload=0.004)
    angles = np.linspace([0, 0, 0], [0.5, 1.2, -0.4], 41)
    load = np.linspace(0.0, 0.02, 41)
    free = history(tip_force_n=np.zeros((41, 3)))
    path, _ = ENGINE.follow(chain, [free.with_(base_angles_rad=angles, payload_kg=load)])
    for k in (7, 23, 40):
        turned, hung = np.tile(angles[k], (41, 1)), np.full(41, load[k])
        there, _ = ENGINE.follow(chain, [free.with_(base_angles_rad=turned, payload_kg=hung)])
        np.testing.assert_allclose(path[0].joint_angles[k], there[0].joint_angles[k], atol=1e-8)


def test_opposed_actuators_and_segments_with_several_laws() -> None:
    chain = sample_chain(modules=3, turns_rad=(0.0, 0.5), payload=0.004)
    joints = tuple(dataclasses.replace(j, law=k % 2) for k, j in enumerate(chain.joints))
    chain = chain.with_(
        joints=joints,
        laws=(softening_law(), linear_law()),
        actuators=(Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0)),
    )
    base = history()
    p = base.actuation["pressure_pa"]
    agree(chain, [base.with_(actuation={"pressure_1_pa": p, "pressure_2_pa": 0.6 * p[::-1]})])


@pytest.mark.parametrize("kind", KINDS)
def test_every_effect_equals_plain_stepping(kind: str) -> None:
    """Includes the damage that the second run of a specimen has, and that another specimen does not have."""
    model = with_effects(sample_chain(modules=2, payload=0.004), kind)
    again = history("again", specimen="one", tip_force_n=0.4 * history().tip_force_n)
    runs = [history(specimen="one"), again, again.with_(run="other", specimen="two")]
    agree(model.chain, [model.commanded(run) for run in runs], atol=1e-7)


def test_a_long_chain_that_curls_and_snaps_is_followed() -> None:
    """22 joints are turned level: the residual must grow on the way, which plain Newton steps refuse."""
    chain = sample_chain(modules=22, payload=0.03)
    level, none = np.tile([0.0, np.pi / 2, 0.0], (41, 1)), np.zeros((41, 3))
    agree(chain, [history(base_angles_rad=level, tip_force_n=none, moment_n_m=none[:, 0])])


# -- time ---------------------------------------------------------------------------------------------


def creep_error(kind: str, longest_step_s: float) -> float:
    """Return the error after 8 s of a ramp that is one sample long, against steps of 2 ms."""
    chain = with_effects(sample_chain(linear_law(), modules=1, gravity=(0, 0, 0)), kind).chain
    run = History.from_arrays({"pressure_pa": np.array([0.0, P])}, np.array([0.0, 8.0]))

    def end(step: float) -> float:
        paths, _ = Quasistatic(QuasistaticConfig(longest_step_s=step)).follow(chain, [run])
        return float(paths[0].joint_angles[-1, 0, 0])

    return abs(end(longest_step_s) - end(0.002))


@pytest.mark.parametrize("kind", ["viscous_damping", "viscoelastic"])
def test_long_samples_are_cut_and_converge(kind: str) -> None:
    """Order ≥ 1: half the step, half the error or less."""
    errors = [creep_error(kind, step) for step in (2.0, 1.0, 0.5, 0.25)]
    assert errors[0] < 0.02
    floor = 1e-8
    for coarse, fine in itertools.pairwise(errors):
        assert fine < 0.62 * coarse + floor


# -- derivatives --------------------------------------------------------------------------------------


def differences(
    make: object, at: float, step: float, small: float, engine: Quasistatic = ENGINE
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return (engine's derivative, central difference of whole runs) of each history; `make(x)` is a Variation."""
    base, there = make(at), make(at + small)  # type: ignore[operator]
    _, (change,) = engine.follow(base.chain, base.histories, [there])
    up, _ = engine.follow(*(make(at + step).chain, make(at + step).histories))  # type: ignore[operator]
    down, _ = engine.follow(*(make(at - step).chain, make(at - step).histories))  # type: ignore[operator]
    return (
        [d.joint_angles / small for d in change],
        [(a.joint_angles - b.joint_angles) / (2 * step) for a, b in zip(up, down, strict=True)],
    )


BASE = sample_chain(modules=3, payload=0.01)
DRIVES = {
    "gain": lambda x: history().with_actuation(pressure_pa=x * history().actuation["pressure_pa"]),
    "force": lambda x: history(tip_force_n=x * history().tip_force_n),
    "moment": lambda x: history(moment_n_m=x * history().moment_n_m),
    "payload": lambda x: history(payload_kg=np.full(41, 0.01 * x)),
    "gravity": lambda x: history(),
}


@pytest.mark.parametrize("name", DRIVES)
def test_derivatives_by_what_drives_the_chain(name: str) -> None:
    def scaled_gravity(x: float) -> ChainModel:
        return BASE.with_(gravity_m_s2=x * BASE.gravity_m_s2) if name == "gravity" else BASE

    got, wanted = differences(lambda x: Variation(scaled_gravity(x), (DRIVES[name](x),)), 1.0, 1e-3, 1e-6)
    np.testing.assert_allclose(got[0], wanted[0], atol=2e-5 * np.abs(wanted[0]).max())
    assert np.abs(wanted[0]).max() > 1e-4


def test_derivatives_by_temperature() -> None:
    warm = with_effects(BASE, "thermal_softening").chain
    got, wanted = differences(
        lambda x: Variation(warm, (history(temperature_c=np.full(41, x)),)), 30.0, 1e-2, 1e-4
    )
    np.testing.assert_allclose(got[0], wanted[0], atol=1e-4 * np.abs(wanted[0]).max())


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in READ_ONLY])
def test_derivatives_by_an_effect_strength_over_two_runs_on_one_specimen(kind: str) -> None:
    name, value = next(iter(STRENGTHS[kind].items()))

    def varied(x: float) -> Variation:
        config = effect(kind, **{**STRENGTHS[kind], name: value * x})
        model = BENCH.build("effect", config).apply(Model(BASE))
        runs = (history(specimen="A"), history("b", specimen="A"), history("c", specimen="B"))
        return Variation(model.chain, tuple(model.commanded(h) for h in runs))

    got, wanted = differences(varied, 1.0, 1e-3, 1e-6)
    for a, b in zip(got, wanted, strict=True):
        # At a sample where the largest angle is just reached the central difference spans a kink.
        assert np.quantile(np.abs(a - b), 0.97) < 3e-3 * np.abs(b).max() + 1e-6
        np.testing.assert_allclose(a, b, atol=2e-2 * np.abs(b).max() + 1e-6)
    assert np.abs(wanted[1]).max() > 1e-5


def test_derivatives_stay_bounded_in_holds_with_a_dashpot_that_thickens_with_the_rate() -> None:
    """A change of the past that is larger than the tolerance of rest must not grow from step to step."""
    t = 0.02 * np.arange(400)
    steps = np.repeat([0.0, 1.0, 0.5, 0.0], 100)
    chain = (
        BENCH.build("effect", effect("viscous_damping", time=0.5, rate_power=1.3)).apply(Model(BASE)).chain
    )

    def pushed(x: float) -> Variation:
        return Variation(chain, (History.from_arrays({"pressure_pa": 0.5 * P * (steps + x)}, t, run="a"),))

    base, there = pushed(0.0), pushed(1e-3)
    _, (change,) = ENGINE.follow(base.chain, base.histories, [there])
    moved, _ = ENGINE.follow(there.chain, there.histories)
    plain, _ = ENGINE.follow(base.chain, base.histories)
    exact = moved[0].joint_angles - plain[0].joint_angles
    np.testing.assert_allclose(change[0].joint_angles, exact, atol=0.02 * np.abs(exact).max())


def test_derivatives_by_what_changes_the_body_follow_the_varied_chain() -> None:
    def longer(x: float) -> Variation:
        joints = tuple(dataclasses.replace(j, offset_m=x * j.offset_m) for j in BASE.joints)
        return Variation(BASE.with_(joints=joints), (history(),))

    got, wanted = differences(longer, 1.0, 1e-3, 1e-4)
    np.testing.assert_allclose(got[0], wanted[0], atol=1e-3 * np.abs(wanted[0]).max())


@pytest.mark.parametrize("change", ["clock", "signs", "laws"])
def test_variations_that_look_alike_are_not_taken_for_linear(change: str) -> None:
    chain = with_effects(BASE, "viscous_damping").chain
    near = {
        "clock": Variation(chain, (history(time_s=1.01 * history().time_s),)),
        "signs": Variation(chain.with_(actuators=(Actuator("pressure_pa", 0.99),)), (history(),)),
        "laws": Variation(chain.with_(laws=(*chain.laws, linear_law())), (history(),)),
    }[change]
    base, (moved,) = ENGINE.follow(chain, [history()], [near])
    there, _ = ENGINE.follow(near.chain, near.histories)
    np.testing.assert_allclose(moved[0].joint_angles, there[0].joint_angles - base[0].joint_angles, atol=1e-9)


# -- specimens ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "lasts"), [("mullins", True), ("permanent_set", True), ("viscoelastic", False)]
)
def test_damage_goes_on_in_its_own_specimen_only(kind: str, lasts: bool) -> None:
    chain = with_effects(BASE, kind).chain
    first, again, other = history("1", specimen="A"), history("2", specimen="A"), history("3", specimen="B")
    (a, b, c), _ = ENGINE.follow(chain, [first, again, other])
    np.testing.assert_array_equal(a.joint_angles, c.joint_angles)
    assert bool(np.abs(a.joint_angles - b.joint_angles).max() > 1e-4) is lasts
    (_, _, b2), _ = ENGINE.follow(chain, [first, other, again])
    np.testing.assert_array_equal(b.joint_angles, b2.joint_angles)


# -- law tables ---------------------------------------------------------------------------------------


def test_a_table_is_the_law() -> None:
    law = softening_law()
    table = tabulate(law, (-0.25 * 2**15, 2.0**15))
    rng = np.random.default_rng(0)
    p, u = rng.uniform(0, P, 400), rng.uniform(-1.0, 1.0, 400)
    got = np.array(
        [
            law_at.py_func(table.cells.ravel(), table.grid[None], table.cells.shape[:2], 0, a, b)
            for a, b in zip(p, u, strict=True)
        ]
    )
    wanted = law.evaluate(p, u[:, None])
    span = np.ptp(wanted.tau)
    assert np.abs(got[:, 0] - wanted.tau[:, 0]).max() < 2e-6 * span
    slopes = wanted.dtau_du[:, 0, 0]
    assert np.abs(got[:, 1] - slopes).max() < 2e-3 * np.abs(slopes).max()


def test_a_table_is_smooth_across_cells_and_straight_outside() -> None:
    table = tabulate(softening_law(), (0.0, P))
    cells, grid, size = table.cells.ravel(), table.grid[None], table.cells.shape[:2]

    def law(p: float, u: float) -> tuple[float, float]:
        return law_at.py_func(cells, grid, size, 0, p, u)

    u_node = table.grid[2] + 130 * table.grid[3]
    p_node = table.grid[0] + 11 * table.grid[1]
    tiny = 1e-9
    left, right = law(p_node - tiny * P, u_node - tiny), law(p_node + tiny * P, u_node + tiny)
    assert left == pytest.approx(right, abs=1e-8)
    end = table.grid[2] + table.cells.shape[1] * table.grid[3]
    (a, slope), (b, _), (c, _) = law(5e3, end), law(5e3, end + 0.5), law(5e3, end + 1.0)
    assert b - a == pytest.approx(0.5 * slope, rel=1e-9)
    assert c - b == pytest.approx(0.5 * slope, rel=1e-9)


# -- failures -----------------------------------------------------------------------------------------


def runaway(angle, rate, dt, p, t, old, new, c):  # type: ignore[no-untyped-def]
    """Return a moment beyond any spring between 9 and 11 kPa."""
    return 1e9 if 9e3 < p < 11e3 else 0.0


def not_a_number(angle, rate, dt, p, t, old, new, c):  # type: ignore[no-untyped-def]
    return (p - 10e3) ** 0.5 if p > 10e3 else math_nan(p)


def math_nan(p: float) -> float:
    return float("nan") * p


def clumsy(angle, rate, dt, p, t, old, new, c):  # type: ignore[no-untyped-def]
    return {"a": [angle]}["a"][0] + str(p)


def steady(angle, rate, dt_s, actuation, temperature_c, old, new, parameters):
    return parameters[0]


def swept() -> History:
    return History.from_arrays(
        {"pressure_pa": np.array([0.0, 4e3, 8e3, 10e3, 12e3, P])}, 0.5 * np.arange(6.0)
    )


def test_a_failed_sample_is_flagged_and_leaves_no_trace() -> None:
    chain = sample_chain(modules=3)
    bad = chain.with_(terms=(LawTerm("moment", runaway, ()),))
    (path,), _ = ENGINE.follow(bad, [swept()])
    (good,), _ = ENGINE.follow(chain, [swept()])
    assert path.converged.tolist() == [True, True, True, False, True, True]
    there = path.converged
    np.testing.assert_allclose(path.joint_angles[there], good.joint_angles[there], atol=1e-8)


def test_a_moment_that_is_no_number_is_no_equilibrium() -> None:
    bad = sample_chain(modules=2).with_(terms=(LawTerm("moment", not_a_number, ()),))
    (path,), _ = ENGINE.follow(bad, [swept()])
    assert not path.converged[0]
    assert np.isfinite(path.joint_angles[path.converged]).all()


def test_many_terms_add_up() -> None:
    many = sample_chain(modules=2).with_(terms=(LawTerm("moment", steady, (1e-4,)),) * 20)
    one = sample_chain(modules=2).with_(terms=(LawTerm("moment", steady, (20e-4,)),))
    (path,), _ = ENGINE.follow(many, [swept()])
    (wanted,), _ = ENGINE.follow(one, [swept()])
    np.testing.assert_allclose(path.joint_angles, wanted.joint_angles, atol=1e-7)
    (plain,), _ = ENGINE.follow(sample_chain(modules=2), [swept()])
    assert np.abs(path.joint_angles - plain.joint_angles).max() > 1e-3


def test_a_term_that_cannot_be_compiled_names_its_file_and_line() -> None:
    chain = sample_chain(modules=1).with_(terms=(LawTerm("moment", clumsy, ()),))
    with pytest.raises(UserError, match=r"test_histories.py, line \d+: the law term 'clumsy'"):
        ENGINE.follow(chain, [swept()])


@pytest.mark.parametrize("name", ["pressure_pa", "moment_n_m", "temperature_c", "base_angles_rad", "time_s"])
def test_a_gap_in_what_drives_the_chain_names_run_and_sample(name: str) -> None:
    gap = history("gap")
    values = (gap.actuation["pressure_pa"] if name == "pressure_pa" else getattr(gap, name)).copy()
    values[4] = np.nan
    gap = gap.with_actuation(pressure_pa=values) if name == "pressure_pa" else gap.with_(**{name: values})
    with pytest.raises(UserError, match=f"run 'gap', sample 5: {name}"):
        ENGINE.follow(BASE, [gap])


# -- joints that the compiled loop does not have ------------------------------------------------------


def test_spatial_joints_feel_the_temperature() -> None:
    chain = with_effects(sample_chain(linear_spherical_law(), modules=2), "thermal_softening").chain
    (warm, cold), _ = ENGINE.follow(chain, [history(), history(temperature_c=np.full(41, 22.0))])
    assert np.abs(warm.joint_angles - cold.joint_angles).max() > 1e-3


def test_all_shipped_effects_are_tested_here() -> None:
    shipped = {kind for kind in candidate_kinds(REGISTRY) if not is_record_mistake(REGISTRY, kind)}
    assert set(KINDS) == shipped - ELSEWHERE
