"""The task `crawl`: laws of friction, symmetry and scaling; work against losses; engines agree; wrong blocks."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from tests.tasks.conftest import built

from pliant.config.chain import ChainConfig
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.pipeline.chain import Module, Segment, build_chain, family_module, rod_module
from pliant.pipeline.engine_checks import check_asked
from pliant.pipeline.simulate import scene_engine
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.law import Domain, Effort
from pliant.records.rollout import Inputs
from pliant.testing.samples import SofteningLaw, linear_law, opposed_law, sample_chain, softening_law
from pliant_plugins.tasks.crawl.config import CrawlConfig
from pliant_plugins.tasks.crawl.metrics import supply_work_j
from pliant_plugins.tasks.crawl.scene import weight_n
from pliant_plugins.tasks.crawl.task import Crawl

HARD = {
    "joint_damping": 1e-3,
    "contact_stiffness": 1e6,
    "contact_damping": 2e3,
    "slip_damping": 1e3,
    "contact_timestep": "0.5 ms",
}
FEET = {"radius": "9 mm", "width": "20 mm"}
PHASED = {
    "pressure_1_pa": {"low": "2 kPa", "high": "8 kPa", "phase": 0.25},
    "pressure_2_pa": {"low": "2 kPa", "high": "8 kPa"},
}


def crawl(**keys: Any) -> Crawl:
    block = {
        "gait": PHASED,
        "feet": FEET,
        "radius": "4 mm",
        "settling_periods": 2,
        "periods": 1,
        "commands": 40,
    }
    return Crawl(CrawlConfig.model_validate({**block, **keys}))


def rods(gain: float = 1.6e-6, stiffness: float = 0.025, mass: float = 2e-3) -> ChainModel:
    """Return ten equal rods with a linear law, an input for each half."""
    return halves(rod_module(linear_law(gain, stiffness), 10e-3, mass))


def halves(module: Module) -> ChainModel:
    """Return ten modules with an input for each half."""
    chain = build_chain(ChainConfig(modules=10), [Segment(module, 10)])
    joints = tuple(replace(joint, drives=(k // 5, k // 5 + 1)) for k, joint in enumerate(chain.joints))
    return chain.with_(joints=joints, actuators=(Actuator("pressure_1_pa"), Actuator("pressure_2_pa")))


def run(task: Crawl, chain: ChainModel, kind: str = "mujoco", **settings: Any) -> dict[str, Any]:
    engine = built("physics", kind, **(settings or HARD))
    return dict(task.run(chain, scene_engine(engine, Model(chain))).metrics)


@pytest.fixture(scope="module")
def forward() -> dict[str, Any]:
    return run(crawl(), rods())


def test_it_crawls_and_is_periodic(forward: dict[str, Any]) -> None:
    assert forward["displacement_m"] > 5e-3
    assert forward["speed_m_s"] == pytest.approx(forward["displacement_m"] / 1.0)
    assert abs(forward["drift_m"]) < 0.01 * forward["displacement_m"]
    assert forward["change_ratio"] < 0.02 and "note" not in forward
    weight = 9.81 * 0.02
    cost = forward["work_j"] / (weight * forward["displacement_m"])
    assert forward["cost_of_transport_ratio"] == pytest.approx(cost)
    assert 0.0 < forward["net_work_j"] < forward["work_j"]


def test_no_amplitude_no_motion() -> None:
    still = {name: {"low": "5 kPa", "high": "5 kPa"} for name in PHASED}
    found = run(crawl(gait=still), rods())
    assert abs(found["displacement_m"]) < 2e-5 and abs(found["work_j"]) < 1e-6


def test_a_symmetric_crawler_stays_where_it_is(forward: dict[str, Any]) -> None:
    """Both halves in phase on isotropic friction: its ends slide by the same, to and fro."""
    together = {name: {"low": "2 kPa", "high": "8 kPa"} for name in PHASED}
    found = run(crawl(gait=together), rods())
    assert abs(found["displacement_m"]) < 0.02 * forward["displacement_m"]


def test_the_reversed_phase_crawls_back(forward: dict[str, Any]) -> None:
    gait = {**PHASED, "pressure_1_pa": {"low": "2 kPa", "high": "8 kPa", "phase": -0.25}}
    found = run(crawl(gait=gait), rods())
    assert found["displacement_m"] == pytest.approx(-forward["displacement_m"], rel=0.02)
    assert found["work_j"] == pytest.approx(forward["work_j"], rel=0.01)


def test_the_direction_turns_the_sign(forward: dict[str, Any]) -> None:
    found = run(crawl(direction=[-1, 0, 0]), rods())
    assert found["displacement_m"] == pytest.approx(-forward["displacement_m"], rel=1e-9)
    assert found["cost_of_transport_ratio"] == pytest.approx(forward["cost_of_transport_ratio"])


def test_twice_the_weight_and_the_stiffness_is_the_same_motion(forward: dict[str, Any]) -> None:
    """All forces doubled, friction among them: the same path, twice the work, the same cost of transport."""
    found = run(crawl(), rods(3.2e-6, 0.05, 4e-3), "mujoco", **{**HARD, "joint_damping": 2e-3})
    assert found["displacement_m"] == pytest.approx(forward["displacement_m"], rel=2e-3)
    assert found["work_j"] == pytest.approx(2.0 * forward["work_j"], rel=2e-3)
    assert found["cost_of_transport_ratio"] == pytest.approx(forward["cost_of_transport_ratio"], rel=3e-3)


def test_nothing_moves_forward_without_friction() -> None:
    """No horizontal force: the centre of mass stays, whatever the gait."""
    found = run(crawl(friction=0.0), rods())
    assert abs(found["displacement_m"]) < 2e-4


def test_the_net_work_is_lost_in_friction_and_damping() -> None:
    """Over a period the work that supplies do not get back is the work against contacts and the joints' damping."""
    task, chain, commands, step_s = crawl(commands=1000), rods(), 1000, 1e-3
    engine = built("physics", "mujoco", **{**HARD, "joint_damping": 3e-3, "contact_timestep": "0.25 ms"})
    scene, lost, damped = task.scene(chain), 0.0, 0.0
    with engine.build_scene(scene) as simulation:
        data, q, given = simulation._data, [], []
        for k in range(3 * commands):
            inputs = task.commands(chain, (k % commands + 0.5) / commands)
            if k == 2 * commands:
                q.append(simulation.snapshot().coordinates[0])
            simulation.apply([Inputs(one) for one in inputs])
            if k < 2 * commands:
                simulation.step(step_s)
                continue
            for _ in range(4):
                before = data.qvel.copy()
                simulation.step(step_s / 4)
                lost -= 0.5 * (before + data.qvel) @ data.qfrc_constraint * step_s / 4
                damped += 3e-3 * float((simulation.snapshot().rates[0] ** 2).sum()) * step_s / 4
            q.append(simulation.snapshot().coordinates[0])
            given.append(inputs[0])
    net = float(supply_work_j(chain, np.array(q), given).sum())
    assert lost > 0.0 and damped > 0.0
    assert net == pytest.approx(lost + damped, rel=0.03)


def loop(t: int = 400) -> tuple[Array, Array]:
    """Return a closed path of joints (t + 1, 3, 1), and shares of the actuation (t,) in its steps."""
    ends, middles = np.arange(t + 1) / t, (np.arange(t) + 0.5) / t
    angle = 0.3 * np.sin(2 * np.pi * ends)[:, None] + np.array([0.1, 0.2, 0.3])
    return angle[:, :, None], 0.5 * (1.0 - np.cos(2 * np.pi * middles + 0.4))


class CurvedLaw(SofteningLaw):
    """A law that is not linear in the pressure: the worked law at p (1 + p / 10 kPa)."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        found = super().evaluate(actuation * (1.0 + actuation / 1e4), deformation)
        return replace(found, dtau_dp=found.dtau_dp * (1.0 + 2.0 * actuation / 1e4)[:, None])


@pytest.mark.parametrize("law", [softening_law(), CurvedLaw(Domain.unbounded(1))])
def test_the_work_of_a_cycle_is_the_area_of_the_loop(law: Any) -> None:
    """∮ p dV = ∮ τ du for any law that is the slope of a potential, linear in p or not."""
    q, shares = loop()
    chain = sample_chain(law, modules=3)
    work = supply_work_j(chain, q, [{"pressure_pa": 1e4 * share} for share in shares])
    middles, moved = 0.5 * (q[1:] + q[:-1]), np.diff(q, axis=0)
    area = sum(
        float((law.evaluate(np.full(3, 1e4 * share), at).tau * step).sum())
        for share, at, step in zip(shares, middles, moved, strict=True)
    )
    assert abs(area) > 1e-5
    assert float(work.sum()) == pytest.approx(area, rel=1e-3)


def test_two_actuations_of_one_law_share_the_work() -> None:
    q, shares = loop()
    law = opposed_law()
    actuators = (Actuator("pressure_1_pa"), Actuator("pressure_2_pa"))
    chain = sample_chain(law, modules=3).with_(actuators=actuators)
    commanded = [{"pressure_1_pa": 1e4 * s, "pressure_2_pa": 5e3 * s**2} for s in shares]
    work = supply_work_j(chain, q, commanded)
    assert work.shape == (len(shares), 2)
    area = 0.0
    for given, at, step in zip(commanded, 0.5 * (q[1:] + q[:-1]), np.diff(q, axis=0), strict=True):
        area += float((law.evaluate(np.tile(list(given.values()), (3, 1)), at).tau * step).sum())
    assert float(work.sum()) == pytest.approx(area, rel=1e-3)


def test_a_constant_pressure_gives_back_what_it_put_in() -> None:
    q, _ = loop()
    work = supply_work_j(sample_chain(modules=3), q, [{"pressure_pa": 8e3}] * (len(q) - 1))
    assert np.abs(work).max() > 1e-6
    assert float(work.sum()) == pytest.approx(0.0, abs=1e-12)


def test_two_chains_carry_a_body_to_either_side() -> None:
    """The chain that moves later decides the direction; the scene weighs body and chains."""
    found = []
    for phases in ((0.0, 0.25), (0.25, 0.0)):
        arms = [
            {"base": {"position": [place, 0, 0], "direction": [way, 0, 0], "roll": "180 deg"}, "phase": phase}
            for place, way, phase in (("10 mm", 1, phases[0]), ("-10 mm", -1, phases[1]))
        ]
        task = crawl(
            arms=arms,
            body={"box": ["20 mm", "30 mm", "12 mm"], "mass": "10 g"},
            feet={**FEET, "base": False},
            gait={name: {"low": "2 kPa", "high": "6 kPa"} for name in PHASED},
        )
        scene = task.scene(rods())
        assert len(scene.arms) == 2 and weight_n(scene) == pytest.approx(9.81 * 0.05)
        found.append(run(task, rods())["displacement_m"])
    assert found[0] > 5e-4 and found[1] < -5e-4


def test_stills_and_frames_move_with_the_body(forward: dict[str, Any]) -> None:
    chain, task = rods(), crawl(settling_periods=0)
    result = task.run(chain, scene_engine(built("physics", "mujoco", **HARD), Model(chain)))
    assert result.frames is not None
    moved = result.frames.positions_m[-1, 0] - result.frames.positions_m[0, 0]
    assert np.linalg.norm(moved) > 1e-3
    lowest = [
        min(shape.position_m[2] - shape.size_m[0] for shape in still.arms[0]) for still in result.stills
    ]
    assert max(map(abs, lowest)) < 1e-3  # the feet stay on the floor in every picture
    np.testing.assert_allclose(result.final.tip_m, task_tip(result.frames, task, chain), atol=1e-9)


def task_tip(frames: Any, task: Crawl, chain: ChainModel) -> Array:
    from pliant.mechanics.kinematics import ChainGeometry

    scene = task.scene(chain)
    motion = scene.base_motion(0, frames.carriage_m[-1], frames.positions_m[-1], frames.rotations[-1])
    pose = ChainGeometry.from_chain(scene.arms[0].chain).forward(frames.coordinates[0][-1]).moved(*motion)
    return np.asarray(pose.origins[-1] + pose.rotations[-1] @ np.asarray(chain.tip_offset_m))


@pytest.mark.skipif(importlib.util.find_spec("pybullet") is None, reason="pybullet is not installed")
def test_engines_agree_on_the_speed() -> None:
    """Within 2 %: MuJoCo with hardly any creep of what sticks, PyBullet without springs of what stuck before."""
    law, family = built("surrogate", "polynomial").stated(), built("family", "bellow_bending")
    bellows = halves(family_module(law, family, 1150.0))
    task = crawl(
        gait={"pressure_1_pa": {"high": "12 kPa", "phase": 0.25}, "pressure_2_pa": {"high": "12 kPa"}}
    )
    one = run(task, bellows, "mujoco", **{**HARD, "contact_timestep": "0.2 ms", "slip_damping": 2e3})
    other = run(task, bellows, "pybullet", joint_damping=1e-3, friction_anchors=False)
    assert one["displacement_m"] > 5e-3
    assert other["displacement_m"] == pytest.approx(one["displacement_m"], rel=0.02)
    assert other["work_j"] == pytest.approx(one["work_j"], rel=0.02)


def test_waveforms_meet_their_levels() -> None:
    keys = {"low": "1 kPa", "high": "5 kPa", "phase": 0.1, "rise": 0.2, "hold": 0.3, "fall": 0.1}
    gait = {"gait": {"pressure_pa": keys}}
    clock = np.array([0.1, 0.2, 0.3, 0.5, 0.6, 0.65, 0.7, 0.9, 1.1, -0.9])
    flat = crawl(**gait, waveform="trapezoid").config.gait["pressure_pa"].at(clock, "trapezoid")
    np.testing.assert_allclose(flat, 1e3 * np.array([1, 3, 5, 5, 5, 3, 1, 1, 1, 1]), atol=1e-6)
    plain = {"pressure_pa": {name: keys[name] for name in ("low", "high", "phase")}}
    sine = crawl(gait=plain).config.gait["pressure_pa"].at(np.array([0.1, 0.35, 0.6]), "sine")
    np.testing.assert_allclose(sine, [1e3, 3e3, 5e3], atol=1e-6)


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"gait": {"pressure_1_pa": {"low": "2 kPa", "high": "1 kPa"}}}, "'low' is above 'high'"),
        ({"gait": {"pressure_1_pa": {"high": "1 kPa", "rise": 0.6, "hold": 0.5}}}, "shares of one period"),
        ({"gait": {"pressure_1_pa": {"high": "1 kPa", "rise": 0.3}}}, "add 'waveform: trapezoid'"),
        ({"gait": {}}, "at least 1 item"),
        ({"direction": [0, 0, 1]}, "'direction' is horizontal"),
        ({"body": {"box": ["0 mm", "1 mm", "1 mm"], "mass": "1 g"}}, "edges of a 'box' are above 0"),
        ({"arms": [{"base": {"mount": {"file": "a.xml", "at": "b"}}}]}, "leave 'mount' out"),
    ],
)
def test_wrong_blocks_are_refused(keys: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        crawl(**keys)


def test_sentences_name_what_to_change() -> None:
    with pytest.raises(UserError, match=r"drives 'pressure_pa'.* inputs are pressure_1_pa, pressure_2_pa"):
        run(crawl(gait={"pressure_pa": {"high": "1 kPa"}}), rods())
    with pytest.raises(UserError, match="no collision shapes"):
        crawl(feet=None, radius=None).scene(rods())
    with pytest.raises(UserError, match="gravity must point down"):
        crawl().scene(rods().with_(gravity_m_s2=np.zeros(3)))
    with pytest.raises(UserError, match="physics 'quasistatic' has no contacts"):
        check_asked(built("physics", "quasistatic", max_iterations=60), crawl())


def test_a_gait_that_is_not_periodic_yet_is_noted() -> None:
    found = run(
        crawl(settling_periods=0, gait={"pressure_1_pa": {"high": "8 kPa"}}, rest_time="10 ms"), rods()
    )
    assert found["change_ratio"] > 0.02
    assert "More 'settling_periods'" in found["note"]
