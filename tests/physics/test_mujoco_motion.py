"""MuJoCo: efforts at its dofs are conservative, compiled motion equals that of Python, with and without law terms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.physics.conftest import SCALAR, ScalarSpatial, SpatialLaw

from pliant.interfaces.physics import Run
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.rotations import right_jacobian
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.law import JointLaw
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant.records.term import LawTerm
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.simulation import MujocoSimulation
from pliant_plugins.physics.stepping import step_through

INPUTS = Inputs({"pressure_pa": 9e3})


def make_engine(chain: ChainModel) -> MujocoSimulation:
    engine = MujocoSimulation(chain, MujocoConfig())
    engine.model.opt.timestep = 0.01
    return engine


@pytest.mark.parametrize("law", [ScalarSpatial, SpatialLaw])
def test_no_work_on_closed_paths(law: type[JointLaw], make_finger: Callable[..., ChainModel]) -> None:
    """Σ force · ω over a loop of large turns vanishes relative to the elastic energy on it."""
    chain = make_finger("spherical", 3).with_(laws=(law(),))
    engine, loads = make_engine(chain), Loads.from_inputs(chain, INPUTS)
    random = np.random.default_rng(3)
    size, phase = random.uniform(0.3, 0.9, (3, 3)), random.uniform(0, 6, (3, 3))
    work, energy, steps = 0.0, 0.0, 400
    for s in 2 * np.pi * np.arange(steps) / steps:
        q, rate = size * np.sin(s + phase), size * np.cos(s + phase)
        engine.halt(q)
        engine.joints.drive(loads, 0.0)
        spin = np.einsum("nij,nj->ni", right_jacobian(q), rate)
        work += float(engine.data.qfrc_applied @ spin.ravel()) * 2 * np.pi / steps
        energy = max(energy, abs(engine.statics.efforts.potential(q, loads.actuation)))
    assert abs(work) <= 1e-6 * energy


@pytest.mark.parametrize("moment", [0.0, 2e-3])
def test_compiled_and_plain_efforts_are_the_same(
    moment: float, make_finger: Callable[..., ChainModel]
) -> None:
    q = np.random.default_rng(5).uniform(-0.9, 0.9, (4, 3))
    found = []
    for law in (ScalarSpatial(), SpatialLaw()):
        chain = make_finger("spherical", 4).with_(laws=(law,))
        engine = make_engine(chain)
        engine.halt(q)
        loads = Loads.from_inputs(chain, Inputs({"pressure_pa": 9e3}, moment_n_m=moment))
        engine.joints.drive(loads, 1e-3, np.full(4, 0.01), 2.0)
        found.append((engine.data.qfrc_applied.copy(), engine.model.dof_damping.copy()))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-12)


def test_an_undamped_swing_keeps_its_energy_as_steps_shrink(make_finger: Callable[..., ChainModel]) -> None:
    """The loss of the implicit integrator is proportional to the step and vanishes with it."""
    chain = make_finger("spherical", 4).with_(laws=(ScalarSpatial(),))
    statics, loads = ChainStatics(chain), Loads.from_inputs(chain, INPUTS)

    def energy(state: SimulationState) -> float:
        rates = state.velocity.ravel()
        kinetic = 0.5 * rates @ mass_matrix(chain, state.position) @ rates
        return float(kinetic + statics.potential(state.position, loads))

    lost = []
    for step in (4e-6, 2e-6):
        config = MujocoConfig(timestep_s=step, joint_damping=0.0, drag_1_s=0.0)
        with Mujoco(config).build(chain) as simulation:
            simulation.apply(INPUTS)
            start = energy(simulation.snapshot())
            simulation.step(0.01)
            end = simulation.snapshot()
            lost.append(start - energy(end))
            moved = statics.efforts.potential(end.position, loads.actuation)
    assert abs(moved) > 1e-5
    assert lost[0] / lost[1] == pytest.approx(2.0, rel=0.15)
    assert 0.0 < lost[1] < 0.05 * abs(moved)


def test_point_loads_and_cords_move_the_chain_to_static_equilibrium(
    make_finger: Callable[..., ChainModel],
) -> None:
    """Stepped through time, not settled, MuJoCo's own forces on its bodies end in the equilibrium of statics."""
    chain = make_finger("spherical", 4).with_(laws=(ScalarSpatial(),))
    inputs = Inputs(
        {"pressure_pa": 9e3},
        forces=(PointForce(2, np.array([0.003, 0.004, 0.0]), np.array([0.05, 0.1, 0.0])),),
        cords=(Cord(4, np.array([0.0, 0.005, 0.0]), np.array([0.05, 0.0, 0.02]), 0.2),),
    )
    with Mujoco(MujocoConfig(joint_damping=1e-3)).build(chain) as simulation:
        simulation.apply(inputs)
        simulation.step(4.0)
        q = simulation.snapshot().position
        settled = simulation.settle()
    residual = np.abs(ChainStatics(chain).residual(q, Loads.from_inputs(chain, inputs))).max()
    assert settled.converged
    assert residual < 1e-6
    np.testing.assert_allclose(q, settled.joint_angles, atol=1e-4)


def branch(angle, rate, dt_s, actuation, temperature_c, old, new, c):  # type: ignore[no-untyped-def]
    """Return a moment with memory, rate and temperature."""
    new[0] = 0.8 * old[0] + angle
    new[1] = max(old[1], angle)
    return float(-c[0] * rate - c[1] * old[0] * angle**2 + 1e-4 * (temperature_c - 22.0))


def factor(angle, rate, dt_s, actuation, temperature_c, old, new, c):  # type: ignore[no-untyped-def]
    """Return a factor that depends on angle and memory."""
    new[0] = old[0] + min(dt_s, 1.0) * abs(angle)
    return 1.0 + c[0] * angle * angle + 0.1 * old[0]


def shift(angle, rate, dt_s, actuation, temperature_c, old, new, c):  # type: ignore[no-untyped-def]
    """Return a resting position that follows the input."""
    return float(c[0] * actuation * angle)


TERMS = (
    LawTerm("moment", branch, (2e-3, 1e-3), n_states=2, needs_time=True),
    LawTerm("elastic", factor, (0.3,), n_states=1, needs_time=True),
    LawTerm("rest", shift, (1e-6,)),
    LawTerm("actuation", factor, (-0.2,), n_states=1, needs_time=True),
)


@pytest.mark.parametrize("terms", [(), TERMS])
@pytest.mark.parametrize("kind", SCALAR)
def test_compiled_motion_equals_python(
    kind: str, terms: tuple[LawTerm, ...], make_finger: Callable[..., ChainModel]
) -> None:
    chain = make_finger(kind, 3).with_(laws=(SCALAR[kind](),), terms=terms)
    pushed = {"tip_force_n": np.array([0.01, 0.02, 0.005])}
    if kind != "prismatic":
        pushed["moment_n_m"] = 1e-3  # type: ignore[assignment]
    ends = []
    for how in ("whole motion", "step by step", "python"):
        with MujocoSimulation(chain, MujocoConfig(timestep_s=0.004)) as simulation:
            assert simulation.addresses is not None
            if how != "whole motion":
                simulation.addresses = None
            if how == "python":
                simulation.joints.laws = None
            simulation.warm(31.0)
            for pressure, duration in ((9e3, 0.05), (4e3, 0.013), (12e3, 0.001)):
                simulation.apply(Inputs({"pressure_pa": pressure}, **pushed))  # type: ignore[arg-type]
                simulation.step(duration)
            ends.append(simulation.snapshot())
    *compiled, python = ends
    assert np.abs(python.velocity).max() > 1e-4
    for one in compiled:
        np.testing.assert_allclose(one.position, python.position, rtol=0, atol=1e-10)
        np.testing.assert_allclose(one.velocity, python.velocity, rtol=0, atol=1e-7)
        if terms:
            assert one.memory is not None and python.memory is not None
            assert np.abs(one.memory).max() > 1e-3
            np.testing.assert_allclose(one.memory, python.memory, rtol=0, atol=1e-9)


def test_a_batch_is_the_same_runs_one_by_one_to_the_bit(make_finger: Callable[..., ChainModel]) -> None:
    """Chains in turn, uneven times and loads are compared with `apply` and `step` sample by sample."""
    t = np.array([0.0, 0.02, 0.05, 0.0507, 0.12, 0.2, 0.22])
    chains = [make_finger(kind, 3).with_(laws=(SCALAR[kind](),), terms=TERMS) for kind in SCALAR]
    runs = []
    for k in range(7):
        pressure = 9e3 * np.sin(9 * t + k) ** 2
        history = History.from_arrays(
            {"pressure_pa": pressure}, t, run=f"{k}", tip_force_n=[0.01, 0.002 * k, 0.0]
        )
        runs.append(Run(chains[k % len(chains)], history))
    backend = Mujoco(MujocoConfig(timestep_s=0.006))
    for run, rollout in zip(runs, backend.rollout_batch(runs), strict=True):
        with backend.build(run.chain) as simulation:
            for k in range(len(t)):
                simulation.apply(run.history.at(k))
                simulation.step(float(t[k] - t[k - 1]) if k else 0.0)
                np.testing.assert_array_equal(rollout.joint_angles[k], simulation.snapshot().position)
                np.testing.assert_array_equal(rollout.markers_m[k], simulation.markers())
        assert np.abs(np.diff(rollout.joint_angles, axis=0)).max(axis=(1, 2)).min() > 0.0


@pytest.mark.parametrize("kind", SCALAR)
def test_a_compiled_path_equals_single_steps(kind: str, make_finger: Callable[..., ChainModel]) -> None:
    """`follow` has samples further apart than its steps, with linear interpolation between them."""
    chain = make_finger(kind, 2).with_(laws=(SCALAR[kind](),), terms=TERMS)
    t = np.array([0.0, 0.1, 0.13, 0.4])
    history = History.from_arrays(
        {"pressure_pa": 1e3 * np.array([2, 9, 4, 6])}, t, temperature_c=[20, 25, 30, 35]
    )
    backend = Mujoco(MujocoConfig(timestep_s=0.007))
    (path,), _ = backend.follow(chain, [history])
    (plain,), _ = step_through(backend.build, chain, [history], [], 0.007)
    assert path.converged.all()
    assert np.ptp(path.joint_angles) > 1e-3
    np.testing.assert_allclose(path.joint_angles, plain.joint_angles, rtol=0, atol=1e-9)


def test_a_path_that_explodes_is_taken_back_and_told(make_finger: Callable[..., ChainModel]) -> None:
    """A term's moment grows without bound: the reached part is kept, the rest has not converged."""
    runaway = LawTerm("moment", explode, (), needs_time=True)
    chain = make_finger("revolute", 2).with_(laws=(SCALAR["revolute"](),), terms=(runaway,))
    t = 0.1 * np.arange(6)
    history = History.from_arrays({"pressure_pa": 1e3}, t, temperature_c=[22, 22, 22, 90, 90, 90])
    (path,), _ = Mujoco(MujocoConfig()).follow(chain, [history])
    assert path.converged.tolist() == [True, True, True, False, False, False]
    assert np.isfinite(path.joint_angles).all()


def explode(angle, rate, dt_s, actuation, temperature_c, old, new, c):  # type: ignore[no-untyped-def]
    """Return zero below 80 °C and an unbounded moment above."""
    return 0.0 if temperature_c < 80.0 else 1e30
