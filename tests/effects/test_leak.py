"""`leak`, and a closed valve without one: closed forms, an integrator, a joint that sinks, files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tests.effects.bench import followed, model_with

from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.measurements.reading import read_measurement
from pliant.records.chain import Actuator
from pliant.records.design import Array
from pliant.records.history import History, held
from pliant.testing.samples import linear_law, sample_chain

P, RATE, FILLING = 12e3, 0.05, 0.4
K, GAIN = 0.04, 8e-7
PLAIN = Model(sample_chain(linear_law(GAIN, K), modules=1, gravity=(0, 0, 0)))


def leaking(rate: float = RATE, filling_s: float = FILLING) -> Model:
    return model_with(PLAIN, "leak", rate_1_s=rate, filling_time_s=filling_s)


def reached(model: Model, history: History, name: str = "pressure_pa") -> Array:
    return model.commanded(history).actuation[name]


def closing(time_s: Array, closes_s: float) -> History:
    """Return a history at constant P whose valve is closed from `closes_s` on, with a command of zero."""
    closed = time_s > closes_s
    return History.from_arrays(
        {"pressure_pa": np.where(closed, 0.0, P)}, time_s, valve_open=np.where(closed, 0.0, 1.0)
    )


# -- the valve without a leak ----------------------------------------------------------------------


def test_a_closed_chamber_keeps_the_pressure_that_it_had_and_an_opened_one_follows() -> None:
    commanded = np.array([1.0, 3.0, 5.0, 7.0, 9.0, 2.0])
    run = History.from_arrays(
        {"pressure_1_pa": commanded, "pressure_2_pa": -commanded, "tendon_force_n": commanded},
        valve_open=np.array([1.0, 1.0, 0.0, 0.0, 1.0, 0.0]),
    )
    kept = held(run).actuation
    assert kept["pressure_1_pa"].tolist() == [1.0, 3.0, 3.0, 3.0, 9.0, 9.0]
    assert kept["pressure_2_pa"].tolist() == [-1.0, -3.0, -3.0, -3.0, -9.0, -9.0]
    assert kept["tendon_force_n"].tolist() == commanded.tolist()
    assert held(held(run)).actuation["pressure_1_pa"].tolist() == kept["pressure_1_pa"].tolist()
    assert run.actuation["pressure_1_pa"].tolist() == commanded.tolist()


def test_a_run_that_begins_closed_keeps_its_first_pressure() -> None:
    run = History.from_arrays(
        {"pressure_pa": np.array([4.0, 5.0, 6.0])}, valve_open=np.array([0.0, 0.0, 1.0])
    )
    assert held(run).actuation["pressure_pa"].tolist() == [4.0, 4.0, 6.0]


def test_every_model_sees_the_closed_valve() -> None:
    run = closing(np.arange(10.0), 4.0)
    np.testing.assert_array_equal(reached(PLAIN, run), P)
    np.testing.assert_allclose(followed(PLAIN.chain, PLAIN.commanded(run))[0][:, 0], GAIN * P / K, atol=1e-7)


def test_a_lagging_chamber_keeps_what_had_arrived() -> None:
    t = np.array([0.0, 0.001, 1.0, 2.0, 3.0, 4.0])
    run = History.from_arrays(
        {"pressure_pa": np.where(t > 0, P, 0.0)}, t, valve_open=np.array([1.0, 1.0, 1.0, 0.0, 0.0, 1.0])
    )
    late = reached(model_with(PLAIN, "supply_lag", time_s=1.0, second_ratio=1.0), run)
    assert late[2] == pytest.approx(
        P * (1 - 2 * np.exp(-1.0)), rel=1e-3
    )  # 1 − (1 + t/T) e^(−t/T) of two stages
    assert late[3] == late[4] == late[2]
    assert late[5] == pytest.approx(P * (1 - 3 * np.exp(-2.0)), rel=1e-3)  # the closed time has no effect


# -- closed forms ----------------------------------------------------------------------------------


@given(st.lists(st.floats(1e-3, 20.0), min_size=1, max_size=20), st.floats(1e-4, 1.0))
def test_a_closed_chamber_empties_as_its_exponential_at_any_step(steps: list[float], rate: float) -> None:
    t = np.cumsum([0.0, *steps])
    pressure = reached(leaking(rate), closing(t, 0.0))
    np.testing.assert_allclose(pressure, P / (1 + rate * FILLING) * np.exp(-rate * t), atol=1e-11 * P)


def test_a_regulated_chamber_lacks_a_share_and_gets_it_back_with_the_filling_time() -> None:
    """Closed for a long time, then opened: d falls to λ T/(1 + λ T) p with T/(1 + λ T)."""
    t = np.array([0.0, 1.0, 1e3, 1e3 + 1e-9, *(1e3 + 0.1 * np.arange(1, 40))])
    valve = np.where((t > 0.5) & (t <= 1e3), 0.0, 1.0)
    lacking = P - reached(
        leaking(), History.from_arrays({"pressure_pa": np.full(len(t), P)}, t, valve_open=valve)
    )
    end = RATE * FILLING / (1 + RATE * FILLING) * P
    since = t[3:] - t[3]
    wanted = end + (lacking[3] - end) * np.exp(-since * (1 + RATE * FILLING) / FILLING)
    assert lacking[0] == pytest.approx(end)
    assert lacking[3] == pytest.approx(P, rel=1e-6)
    np.testing.assert_allclose(lacking[3:], wanted, rtol=1e-6)


def test_ramps_and_valves_equal_an_integrator() -> None:
    rng = np.random.default_rng(5)
    t = np.cumsum([0.0, *rng.uniform(0.05, 1.0, 40)])
    valve = (np.arange(41) % 10 < 6).astype(float)
    run = History.from_arrays({"pressure_pa": rng.uniform(-P, P, 41)}, t, valve_open=valve)
    plain, wet = reached(PLAIN, run), reached(leaking(0.3), run)
    lacking = [plain[0] - wet[0]]
    for k in range(1, 41):
        supply = valve[k] / FILLING

        def rise(time: float, d: Array, k: int = k, supply: float = supply) -> Array:
            return np.asarray(0.3 * (np.interp(time, t, plain) - d) - supply * d)

        lacking.append(solve_ivp(rise, (t[k - 1], t[k]), [lacking[-1]], rtol=1e-10, atol=1e-9).y[0, -1])
    np.testing.assert_allclose(plain - wet, lacking, atol=1e-5)


def test_it_vanishes_gently_with_its_rate() -> None:
    t = np.linspace(0.0, 20.0, 101)
    run = History.from_arrays({"pressure_pa": P * np.sin(t)}, t, valve_open=(t < 12).astype(float))
    plain = reached(PLAIN, run)
    np.testing.assert_array_equal(reached(leaking(0.0), run), plain)
    small, smaller = (np.abs(plain - reached(leaking(rate), run)).max() for rate in (1e-5, 1e-6))
    assert small == pytest.approx(10 * smaller, rel=1e-3)


def test_states_without_a_clock_lack_the_share_only() -> None:
    run = History.from_arrays({"pressure_pa": np.array([P, 2 * P])}, valve_open=np.array([1.0, 0.0]))
    np.testing.assert_allclose(reached(leaking(), run), P / (1 + RATE * FILLING))


def test_each_chamber_leaks_and_no_tendon() -> None:
    chain = PLAIN.chain.with_(actuators=(Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0)))
    model = model_with(chain, "leak", rate_1_s=0.1)
    t = np.arange(5.0)
    run = History.from_arrays(
        {"pressure_1_pa": P, "pressure_2_pa": -P, "tendon_force_n": 3.0}, t, valve_open=t < 1
    )
    assert reached(model, run, "pressure_1_pa")[-1] == pytest.approx(P / 1.02 * np.exp(-0.4))
    assert reached(model, run, "pressure_2_pa")[-1] == pytest.approx(-P / 1.02 * np.exp(-0.4))
    assert set(reached(model, run, "tendon_force_n")) == {3.0}


def test_the_joint_sinks_and_without_a_valve_it_hardly_shows() -> None:
    t = np.arange(0.0, 61.0)
    model = leaking(0.02, 0.2)
    runs = [
        model.commanded(closing(t, 0.0)),
        model.commanded(History.from_arrays({"pressure_pa": np.full(61, P)}, t)),
    ]
    closed, opened = (angles[:, 0] for angles in followed(model.chain, *runs))
    np.testing.assert_allclose(closed, GAIN * P / K / 1.004 * np.exp(-0.02 * t), atol=1e-7)
    np.testing.assert_allclose(opened, GAIN * P / K, rtol=0.005)


# -- files -----------------------------------------------------------------------------------------


def written(folder: Path, *valves: str) -> Path:
    rows = [f"a,{k},{1000 * k},{valve},0.1" for k, valve in enumerate(valves)]
    path = folder / "bench.csv"
    path.write_text("\n".join(["run,time_s,pressure_pa,valve_open,angle_rad", *rows]) + "\n")
    return path


def test_the_column_is_read_and_other_numbers_are_refused_with_their_rows(tmp_path: Path) -> None:
    history = read_measurement(written(tmp_path, "1", "1", "0", "0")).runs[0].history
    assert history.valve_open is not None
    assert held(history).actuation["pressure_pa"].tolist() == [0.0, 1000.0, 1000.0, 1000.0]
    for wrong in ("0.5", "2", "-1"):
        with pytest.raises(UserError, match=r"bench\.csv, line 4: valve_open should be 1 .* or 0"):
            read_measurement(written(tmp_path, "1", "0", wrong, "1"))
