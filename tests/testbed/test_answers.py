"""A few sealed sets, diagnosed and judged: a short version of `make bench-evidence`."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from benchmarks.evidence.sets import MeasuredSet, SetSpec, make_set

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis

# Of the faster engine: `test_testbed_truth.py` checks that both make the same sets.
HANDFUL = [
    SetSpec("none", 302, "functional", protocol="rates"),
    SetSpec("viscoelastic", 303, "functional", protocol="rates"),
    SetSpec("run_slip", 309, "functional"),
]
# Sets that `test_small_bench.py` does not have: MuJoCo's; among its own two unknown ones are judged among all
# effects there.
WITH_ALL_EFFECTS = [
    SetSpec("none", 302, "mujoco"),
    SetSpec("friction_hysteresis", 304, "functional"),
    SetSpec("actuation_gain", 306, "mujoco"),
    SetSpec("dead_zone", 307, "functional", robot="chain"),
]
CANDIDATES = ("stiffness", "viscoelastic", "friction_hysteresis", "mullins", "dead_zone", "sensor_bias")


def _name(spec: SetSpec) -> str:
    return f"{spec.kind}-{spec.engine}-{spec.robot}-{spec.protocol}"


@pytest.mark.parametrize("spec", HANDFUL, ids=_name)
def test_the_diagnosis_is_right(spec: SetSpec, tmp_path: Path) -> None:
    _judge(spec, tmp_path, CANDIDATES)


@pytest.mark.slow
@pytest.mark.parametrize("spec", WITH_ALL_EFFECTS, ids=_name)
def test_the_diagnosis_is_right_among_all_effects(spec: SetSpec, tmp_path: Path) -> None:
    _judge(spec, tmp_path, None)


def _diagnosed(spec: SetSpec, folder: Path, kinds: Sequence[str] | None) -> tuple[Diagnosis, MeasuredSet]:
    hidden = make_set(spec)
    (folder / "study.yaml").write_text(hidden.study)
    (folder / "bench.csv").write_text(hidden.csv)
    opened = api.open_study(folder / "study.yaml", store=folder / "store")
    return api.diagnose(opened, folder / "bench.csv", kinds=kinds), hidden


def _judge(spec: SetSpec, tmp_path: Path, kinds: Sequence[str] | None) -> None:
    found, hidden = _diagnosed(spec, tmp_path, kinds)
    assert found.verdict in hidden.label["right"]
    if found.verdict == "missing_effect":
        assert found.selected == (spec.kind,)
        left = found.table.over_floor(found.table.rows[found.selected].heldout_square)
        assert left < 1.2
