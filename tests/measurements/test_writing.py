"""Written measurements are read back number for number."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pliant.errors import UserError
from pliant.measurements.reading import read_measurement
from pliant.measurements.writing import write_measurement
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

SIZES = st.floats(1e-25, 1e12)  # values below 1e-30 are read as zero
NUMBER = st.one_of(st.just(0.0), SIZES, SIZES.map(lambda size: -size))
READING = st.one_of(NUMBER, st.just(np.nan))
NAMES = st.text(st.characters(exclude_categories=("Cs", "Cc", "Zl", "Zp")), min_size=1, max_size=12).filter(
    lambda text: text == text.strip()
)


@st.composite
def measurements(draw):
    timed, weighed, specimens = draw(st.booleans()), draw(st.booleans()), draw(st.booleans())
    runs = []
    for name in draw(st.lists(NAMES, min_size=1, max_size=3, unique=True)):
        n = draw(st.integers(1, 6))

        def row(elements=NUMBER, shape=None, n=n):
            return draw(arrays(float, shape or n, elements=elements))

        time_s = np.sort(draw(arrays(float, n, elements=NUMBER, unique=True))) if timed else None
        history = History(
            run=name,
            specimen=draw(NAMES) if specimens else "",
            time_s=time_s,
            actuation={"pressure_1_pa": row(), "tendon_force_n": row()},
            tip_force_n=row(shape=(n, 3)),
            moment_n_m=row(),
            temperature_c=row(),
            base_angles_rad=row(shape=(n, 3)),
            payload_kg=row() if weighed and draw(st.booleans()) else None,
        )
        angle = row(READING)
        angle[0] = 0.5  # an output has at least one reading
        sigma = {"angle_rad": row(st.floats(1e-9, 1e9))} if draw(st.booleans()) else {}
        outputs = {"angle_rad": angle, "tip_x_m": np.where(np.arange(n) == 0, 1.0, row(READING))}
        runs.append(
            MeasuredRun(
                history, outputs, sigma, draw(arrays(float, n, elements=st.integers(1, 99))), np.zeros(0)
            )
        )
    arms = tuple(draw(st.lists(st.floats(0, 1e3), max_size=2)))
    return Measurement(tuple(runs), ("angle_rad", "tip_x_m"), marker_arms_m=arms)


@given(measurements())
def test_what_is_written_is_read_again(tmp_path_factory, written):
    path = tmp_path_factory.mktemp("round") / "trip.csv"
    write_measurement(written, path)
    read = read_measurement(path, actuation=["pressure_1_pa", "tendon_force_n"])
    assert read.outputs == written.outputs and read.marker_arms_m == written.marker_arms_m
    assert [run.name for run in read.runs] == [run.name for run in written.runs]
    for a, b in zip(read.runs, written.runs, strict=True):
        assert a.history.specimen == b.history.specimen
        assert (a.history.time_s is None) == (b.history.time_s is None)
        assert set(a.sigma) == set(b.sigma)
        ours, theirs = numbers(a), numbers(b)
        assert ours.keys() == theirs.keys()
        for name, values in theirs.items():
            np.testing.assert_allclose(ours[name], values, rtol=1e-12, atol=0, err_msg=name)


def numbers(run):
    clock = {} if run.history.time_s is None else {"time_s": run.history.time_s}
    sigma = {f"sigma {name}": values for name, values in run.sigma.items()}
    return {**clock, **run.history.signals(), "cycle": run.cycle, **run.outputs, **sigma}


def test_what_a_table_cannot_hold_is_told(tmp_path):
    def one(name, time_s):
        history = History.from_arrays({"pressure_pa": [0.0, 1.0]}, time_s, run=name)
        return MeasuredRun(history, {"angle_rad": np.zeros(2)}, {}, np.ones(2), np.zeros(0))

    with pytest.raises(UserError, match="line breaks"):
        write_measurement(Measurement((one("a\nb", None),), ("angle_rad",)), tmp_path / "a.csv")
    with pytest.raises(UserError, match="two files"):
        mixed = Measurement((one("a", None), one("b", np.array([0.0, 1.0]))), ("angle_rad",))
        write_measurement(mixed, tmp_path / "a.csv")
    assert not list(tmp_path.iterdir())
