"""The choice of the next run: it splits what is left, keeps the limits, and says when no allowed run helps."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.bench.joint_study import write_study

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.report.diagnosis import diagnosis_json
from pliant_bench.beliefs import exposing, question
from pliant_bench.bench import BenchProtocol
from pliant_bench.choose import Choice, SearchEffort, choose_next, first_runs
from pliant_bench.config import ExperimentConfig
from pliant_bench.drivers.simulated import SimulatedBench, SimulatedBenchConfig
from pliant_bench.limits import check_protocol
from pliant_bench.loop.information import obtained_nats
from pliant_bench.plans import measured_run, measurement
from pliant_bench.protocol_space import ProtocolSpace
from pliant_bench.run_search import RunSearch, _Candidate

PRESSURE = {"pressure_pa": {"high": "15 kPa", "rate": "20 kPa/s", "acceleration": "100 kPa/s^2"}}
LOAD = {"moment_n_m": {"low": "-4 mN*m", "high": "4 mN*m", "rate": 0.008}}
FEW = SearchEffort(random=16, elsewhere=6, settings=2, generations=1)


def config(**settings: Any) -> ExperimentConfig:
    usual = {"inputs": PRESSURE | LOAD, "longest_run": "90 s", "period": "0.2 s"}
    return ExperimentConfig.model_validate(usual | settings)


@dataclass
class Laboratory:
    """A simulated bench, the study that does not know its truth, and the runs so far."""

    folder: Path
    effects: str
    settings: ExperimentConfig
    done: list[BenchProtocol] = field(default_factory=list)
    runs: list[MeasuredRun] = field(default_factory=list)

    def __post_init__(self) -> None:
        truth = write_study(self.folder, self.effects, "truth.yaml")
        rig = [name for name in self.settings.inputs if name != "pressure_pa"]
        given = {"truth": truth, "noise": {"angle_rad": "0.4 deg"}, "rig": rig, "seed": 3}
        self.bench = SimulatedBench(SimulatedBenchConfig.model_validate(given))
        self.bench.connect()
        self.opened = api.open_study(write_study(self.folder))
        for protocol in first_runs(self.settings, self.bench.inputs):
            self.perform(protocol)

    def perform(self, protocol: BenchProtocol) -> None:
        recording = self.bench.run(protocol, lambda sample: None)
        self.runs.append(measured_run(recording, ["pressure_pa"], "specimen 1"))
        self.done.append(protocol)

    @property
    def data(self) -> Measurement:
        return measurement(self.runs)

    def diagnose(self, kinds: list[str] | None = None) -> Diagnosis:
        return api.diagnose(self.opened, self.data, kinds=kinds)

    def choose(self, diagnosis: Diagnosis, **more: Any) -> Choice:
        return choose_next(
            self.opened,
            self.data,
            diagnosis,
            self.settings,
            self.done,
            channels=self.bench.inputs,
            effort=FEW,
            **more,
        )


def test_the_chosen_run_splits_a_pair_that_the_first_runs_cannot(tmp_path: Path) -> None:
    lab = Laboratory(tmp_path, "effects: [{kind: stiffness, factor: 1.15}]\n", config())
    before = lab.diagnose(["stiffness", "actuation_gain"])
    shares = before.judgement.probability
    assert min(shares[("stiffness",)], shares[("actuation_gain",)]) > 0.2
    choice = lab.choose(before)
    assert choice.purpose == "decide" and choice.splits and choice.expected_nats > 0.1
    assert choice.protocol is not None and "stiffness" in choice.why
    check_protocol(choice.protocol, lab.bench.inputs)
    lab.perform(choice.protocol)
    after = lab.diagnose(["stiffness", "actuation_gain"])
    assert after.judgement.probability[("stiffness",)] > 0.85
    obtained = obtained_nats(diagnosis_json(before), diagnosis_json(after))
    assert obtained is not None and obtained > 0.2


def test_where_no_allowed_run_helps_the_class_cannot_be_split(tmp_path: Path) -> None:
    still = {"pressure_pa": {**PRESSURE["pressure_pa"], "high": "9 kPa"}}  # nothing but the pressure
    lab = Laboratory(tmp_path, "effects: [{kind: stiffness, factor: 1.15}]\n", config(inputs=still))
    choice = lab.choose(lab.diagnose(["stiffness", "wall_thickness"]))
    assert choice.protocol is None and not choice.splits
    assert "stiffness" in choice.why and "wall_thickness" in choice.why


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> tuple[Laboratory, Diagnosis]:
    """Return a laboratory where nothing is missing and a person can turn the base."""
    turned = config(inputs=PRESSURE, manual={"base_pitch_rad": [0, "90 deg"]})
    lab = Laboratory(tmp_path_factory.mktemp("clean"), "", turned)
    return lab, lab.diagnose()


def test_that_nothing_is_missing_is_earned_by_the_run_that_shows_most(
    clean: tuple[Laboratory, Diagnosis],
) -> None:
    lab, diagnosis = clean
    assert diagnosis.verdict == "nothing_missing"
    choice = lab.choose(diagnosis)
    assert choice.purpose == "expose" and choice.protocol is not None and choice.expected_nats > 0.05
    asked = exposing(diagnosis, lab.opened.context.registry)
    assert all(len(belief.contenders) <= 8 and () in belief.contenders for belief in asked.beliefs)
    assert len(asked.contenders) > 15
    second = next(kinds for kinds in diagnosis.judgement.probability if kinds not in ((), ("unknown",)))
    others = [kinds for kinds in asked.contenders if kinds and kinds != second]
    assert set(others[0]) & set(diagnosis.not_excited)  # then what the runs could not show


def test_a_verdict_meets_each_rival_once(clean: tuple[Laboratory, Diagnosis]) -> None:
    lab, diagnosis = clean
    choice = lab.choose(diagnosis, met=())
    assert choice.protocol is not None and choice.purpose == "expose" and choice.exposes
    registry = lab.opened.context.registry
    left = exposing(diagnosis, registry, choice.exposes).contenders
    assert not {kind for kinds in left for kind in kinds} & set(choice.exposes)
    every = {kind for kinds in diagnosis.fits for kind in kinds}
    none = lab.choose(diagnosis, met=every)
    assert none.protocol is None and none.why == "No allowed run would show a further effect of the list."


def test_an_effect_that_no_run_excites_gets_its_run(tmp_path: Path) -> None:
    """A warm run shows softening by heat with less than half of a bit; without it the effect is never judged."""
    warm = config(inputs=PRESSURE, longest_run="14 s", manual={"temperature_c": [22.0, 42.0]})
    lab = Laboratory(tmp_path, "", warm)
    kinds = ["thermal_softening", "actuation_gain", "sensor_bias", "viscous_damping", "backlash"]
    diagnosis = lab.diagnose(kinds)
    assert "thermal_softening" in diagnosis.not_excited
    choice = lab.choose(diagnosis, met=[*kinds[1:], *(set(diagnosis.not_excited) - {kinds[0]})])
    assert choice.protocol is not None and choice.protocol.conditions["temperature_c"] == 42.0
    assert choice.exposes == ("thermal_softening",) and choice.to_set == {"temperature_c": 42.0}


def test_the_second_explanation_is_the_first_rival(clean: tuple[Laboratory, Diagnosis]) -> None:
    lab, diagnosis = clean
    second = next(kinds for kinds in diagnosis.judgement.probability if kinds not in ((), ("unknown",)))
    first = exposing(diagnosis, lab.opened.context.registry).beliefs[0].contenders
    assert set(second) & {kind for kinds in first for kind in kinds}


def test_a_person_is_charged_and_the_choice_says_what_to_set(clean: tuple[Laboratory, Diagnosis]) -> None:
    lab, diagnosis = clean
    choice = lab.choose(diagnosis)
    assert choice.protocol is not None
    visits = len(choice.to_set)
    motion = choice.protocol.duration_s / 60.0
    assert choice.minutes == pytest.approx(motion + 0.2 + 2.0 * visits)
    assert visits == 1  # the pressure alone shows no further effect
    assert all(run.conditions == choice.protocol.conditions for run in choice.then)
    near = lab.choose(diagnosis, minutes_left=2.0)  # too short for a visit
    assert not near.to_set and near.minutes <= 2.0


def test_a_run_at_rest_is_no_candidate_where_others_rested_and_the_law_may_be_off_in_all_others(
    clean: tuple[Laboratory, Diagnosis],
) -> None:
    lab, diagnosis = clean
    space = ProtocolSpace.from_settings(lab.settings, lab.bench.inputs)
    model = api.predictor(lab.opened, lab.data)
    standing = lab.done[0].conditions
    search = RunSearch(model, diagnosis, space, lab.settings, lab.done, standing, 60.0)
    still = {name: np.zeros(3) for name in lab.done[0].commands}
    here, turned = (
        BenchProtocol("r", "rest", np.arange(3.0), still, {"base_pitch_rad": angle}) for angle in (0.0, 1.5)
    )
    view = search._view([_Candidate(lab.done[0], None)], 1.0)
    assert diagnosis.law is not None and view.law_columns.shape[1] == len(diagnosis.law.basis)
    assert np.abs(view.law_columns).max() > 0.0
    assert search._is_idle(here) and not search._is_idle(turned) and not search._is_idle(lab.done[0])


def test_no_run_fits_into_no_time(clean: tuple[Laboratory, Diagnosis]) -> None:
    lab, diagnosis = clean
    assert lab.choose(diagnosis, minutes_left=0.05).protocol is None


def test_the_same_data_give_the_same_choice(clean: tuple[Laboratory, Diagnosis]) -> None:
    lab, diagnosis = clean
    first, second = lab.choose(diagnosis), lab.choose(diagnosis)
    assert first.protocol is not None and second.protocol is not None
    assert first.protocol.words == second.protocol.words and first.expected_nats == second.expected_nats


def test_what_a_named_effect_lacks_is_asked_next_to_it(tmp_path: Path) -> None:
    lab = Laboratory(tmp_path, "effects: [{kind: mullins, softening: 0.3}]\n", config())
    diagnosis = lab.diagnose()
    assert diagnosis.selected == ("mullins",)
    asked = question(diagnosis, lab.opened.context.registry)
    assert asked.purpose == "expose"
    assert all("mullins" in kinds for kinds in asked.contenders)
    choice = lab.choose(diagnosis)
    assert choice.protocol is None or "mullins" in choice.why


def test_first_runs_are_repeats_within_the_limits_and_leave_loads_at_rest() -> None:
    settings = config(first_repeats=4, manual={"payload_kg": ["10 g", 0]})
    runs = first_runs(settings)
    assert len(runs) == 4 and len({run.name for run in runs}) == 4
    for run in runs:
        np.testing.assert_array_equal(run.commands["pressure_pa"], runs[0].commands["pressure_pa"])
        assert np.all(run.commands["moment_n_m"] == 0.0)
        assert 0.3 * 15e3 < run.commands["pressure_pa"].max() < 0.8 * 15e3
        assert run.conditions == {"payload_kg": pytest.approx(0.01)}


def test_a_model_of_the_user_is_planned_for_too(tmp_path: Path) -> None:
    from pliant_systems.manifest import EXAMPLE

    model = f"pliant: 1\nname: hinge\nmodel: {{kind: python, file: {EXAMPLE}}}\n"
    (tmp_path / "truth.yaml").write_text(model + "effects: [{kind: state@coulomb, value: 0.15}]\n")
    (tmp_path / "study.yaml").write_text(model)
    given = {"truth": tmp_path / "truth.yaml", "noise": {"angle_rad": 0.02}}
    bench = SimulatedBench(SimulatedBenchConfig.model_validate(given))
    bench.connect()
    torque = {"torque_n_m": {"low": "-1 N*m", "high": "1 N*m", "rate": "2 N*m/s"}}
    settings = config(inputs=torque, period="0.05 s", longest_run="60 s")
    done = list(first_runs(settings, bench.inputs))
    assert done[0].commands["torque_n_m"].min() < -0.5  # both ways
    runs = [measured_run(bench.run(one, lambda sample: None), ["torque_n_m"]) for one in done]
    data, opened = measurement(runs), api.open_study(tmp_path / "study.yaml")
    diagnosis = api.diagnose(opened, data, kinds=["state@coulomb", "parameter@stiffness", "dead_zone"])
    choice = choose_next(opened, data, diagnosis, settings, done, channels=bench.inputs, effort=FEW)
    assert choice.purpose in ("decide", "expose")
    if choice.protocol is not None:
        check_protocol(choice.protocol, bench.inputs)
        assert np.ptp(choice.protocol.commands["torque_n_m"]) > 0.0
