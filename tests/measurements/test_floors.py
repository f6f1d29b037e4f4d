"""Noise floors, repeats and effective samples against noise of known size and colour."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pliant.measurements.effective import effective_samples
from pliant.measurements.floors import floor_remarks, noise_floors
from pliant.measurements.highpass import noise_variance
from pliant.measurements.repeats import repeat_groups
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement


def coloured(rng, rho: float, n: int, sd: float = 1.0):
    """Return AR(1) noise."""
    return sd * np.sqrt(1 - rho**2) * lfilter([1], [1, -rho], rng.normal(size=n + 500))[500:]


def a_run(
    rng, name: str, level_pa: float, reading, time_s, specimen: str = "", sigma=None, **loads
) -> MeasuredRun:
    """Return a run whose pressure sensor is noisy; `reading` is added to the effect of the pressure."""
    pressure = level_pa * (1 - np.cos((time_s - time_s[0]) / 5)) / 2
    noisy = pressure + rng.normal(0, 50, time_s.size)
    history = History.from_arrays({"pressure_pa": noisy}, time_s, run=name, specimen=specimen, **loads)
    stated = {} if sigma is None else {"angle_rad": np.full(time_s.size, sigma)}
    return MeasuredRun(
        history, {"angle_rad": 3e-5 * pressure + reading}, stated, np.ones(time_s.size), np.zeros(0)
    )


def bench(
    seed: int, white=1e-3, slow=2e-3, offset=3e-3, groups=4, repeats=3, n=300, uneven=False, **more
) -> Measurement:
    rng = np.random.default_rng(seed)
    runs = []
    for group in range(groups):
        for repeat in range(repeats):
            time_s = np.arange(n) * 0.1
            if uneven:
                time_s = time_s + rng.uniform(0, 0.08, n)
            reading = coloured(rng, 0.9, n, slow) + rng.normal(0, white, n) + rng.normal(0, offset)
            runs.append(a_run(rng, f"{group}-{repeat}", 1e4 * (group + 1), reading, time_s, **more))
    return Measurement(tuple(runs), ("angle_rad",))


def floors(measurement: Measurement, **arguments):
    return noise_floors(measurement, **arguments)["angle_rad"]


def test_repeats_are_found_under_noisy_inputs():
    groups = repeat_groups(bench(0))
    assert [group.runs for group in groups] == [(0, 1, 2), (3, 4, 5), (6, 7, 8), (9, 10, 11)]
    assert not any(group.specimens_differ for group in groups)


@pytest.mark.parametrize(
    "loads",
    [
        {"moment_n_m": 0.1},
        {"tip_force_n": (0.0, 0.0, -0.5)},
        {"base_angles_rad": (0.5, 0.0, 0.0)},
        {"temperature_c": 40.0},
        {"payload_kg": 0.05},
    ],
)
def test_other_loads_and_conditions_are_no_repeat(loads):
    rng, time_s = np.random.default_rng(0), np.arange(200) * 0.1
    runs = [a_run(rng, name, 1e4, 0.0, time_s, **more) for name, more in (("a", {}), ("b", loads), ("c", {}))]
    assert [group.runs for group in repeat_groups(Measurement(tuple(runs), ("angle_rad",)))] == [(0, 2)]


def test_another_rate_is_no_repeat_and_another_specimen_is_told():
    rng, time_s = np.random.default_rng(0), np.arange(200) * 0.1
    runs = (
        a_run(rng, "a", 1e4, 0.0, time_s, "s1"),
        a_run(rng, "b", 1e4, 0.0, 2 * time_s, "s1"),
        a_run(rng, "c", 1e4, 0.0, time_s + 7.0, "s2"),
    )
    (group,) = repeat_groups(Measurement(runs, ("angle_rad",)))
    assert group.runs == (0, 2) and group.specimens_differ
    floor = noise_floors(Measurement(runs, ("angle_rad",)))
    assert "different specimens" in " ".join(floor_remarks(floor))


def test_both_floors_are_recovered_under_white_slow_noise_and_offsets():
    found = [floors(bench(seed)) for seed in range(40)]
    within = np.array([floor.within for floor in found])
    between = np.array([floor.between for floor in found])
    assert np.sqrt(np.mean(within**2)) == pytest.approx(np.sqrt(5) * 1e-3, rel=0.03)
    assert np.sqrt(np.mean(between**2)) == pytest.approx(np.sqrt(14) * 1e-3, rel=0.06)
    # the standard error is the scatter of single sets, though noise is coloured and repeats are few;
    # that scatter is known to 1 / √(2 · 39) of itself
    assert np.mean([floor.se for floor in found]) == pytest.approx(np.std(between), rel=3 / np.sqrt(2 * 39))
    assert {floor.source for floor in found} == {"repeats"} and found[0].value == found[0].between


def test_interpolation_between_uneven_clocks_takes_no_noise_away():
    found = [floors(bench(seed, white=2e-3, slow=0.0, offset=0.0, uneven=True)) for seed in range(10)]
    assert np.mean([floor.within for floor in found]) == pytest.approx(2e-3, rel=0.04)


def test_residuals_replace_readings():
    clean = bench(3, slow=0.0, offset=0.0)
    drift = [5e-3 * np.arange(300) / 300 * (i % 3) for i in range(12)]  # a history effect: repeats differ
    bent = Measurement(
        tuple(
            r.with_outputs({"angle_rad": r.outputs["angle_rad"] + d})
            for r, d in zip(clean.runs, drift, strict=True)
        ),
        ("angle_rad",),
    )
    explained = [{"angle_rad": r.outputs["angle_rad"] - d} for r, d in zip(bent.runs, drift, strict=True)]
    assert floors(bent).value > 2e-3
    assert floors(bent, residuals=explained).value == pytest.approx(floors(clean).value)
    assert floors(clean).value == pytest.approx(1e-3, rel=0.05)


def test_missing_readings_are_stepped_over():
    whole = bench(5, slow=0.0, offset=0.0)
    rng = np.random.default_rng(1)
    holes = [np.where(rng.random(300) < 0.2, np.nan, run.outputs["angle_rad"]) for run in whole.runs]
    holed = Measurement(
        tuple(run.with_outputs({"angle_rad": v}) for run, v in zip(whole.runs, holes, strict=True)),
        ("angle_rad",),
    )
    assert floors(holed).within == pytest.approx(1e-3, rel=0.06)


def test_without_repeats_the_fast_noise_is_the_floor_and_slow_noise_is_not_seen():
    floor = floors(bench(0, white=2e-3, slow=0.0, offset=9e-3, repeats=1))
    assert floor.source == "high-frequency residual" and floor.between is None
    assert floor.value == pytest.approx(2e-3, rel=0.1)
    assert "slow noise" in floor_remarks({"angle_rad": floor})[0]
    assert "whether the bench repeats cannot be judged" in floor_remarks({"angle_rad": floor})[0]


def test_a_stated_sigma_is_the_floor_unless_repeats_scatter_clearly_more():
    stated = floors(bench(0, sigma=5e-3))
    assert (stated.source, stated.value) == ("stated sigma", pytest.approx(5e-3))
    scattered = floors(bench(0, sigma=1e-4))
    assert scattered.source == "repeats" and scattered.sigma == pytest.approx(1e-4)
    assert "more than the stated sigma" in " ".join(floor_remarks({"angle_rad": scattered}))


def test_nothing_to_tell_the_noise_from_is_said():
    floor = floors(bench(0, repeats=1, n=5))
    assert floor.source == "unknown" and np.isnan(floor.value)
    assert "cannot be judged" in floor_remarks({"angle_rad": floor})[0]


@pytest.mark.parametrize("uneven", [False, True])
def test_third_differences_see_white_noise_only(uneven):
    rng = np.random.default_rng(2)
    clock = np.cumsum(rng.uniform(0.2, 1.8, 20_000)) if uneven else np.arange(20_000.0)
    signal = 50 * np.sin(clock / 100) + np.where(clock > 5000, 30.0, 0.0)
    variance, dof = noise_variance(clock, signal + rng.normal(0, 0.5, clock.size))
    assert np.sqrt(variance) == pytest.approx(0.5, rel=0.02)
    assert 5000 < dof < 20_000


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.9])
def test_effective_samples_in_coloured_noise(rho):
    measured = bench(0, groups=5, repeats=4, n=400)
    ratios = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        noise = [{"angle_rad": coloured(rng, rho, 400)} for _ in measured.runs]
        ratios.append(effective_samples(noise, measured)["angle_rad"] / (8000 * (1 - rho) / (1 + rho)))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.05)
    assert np.std(ratios) < 0.15


def test_effective_samples_count_time_not_readings():
    """A process of time constant 1 s is read at uneven times with gaps."""
    rng, ratios = np.random.default_rng(0), []
    for _ in range(20):
        fine = np.arange(40_000) * 0.1
        process = coloured(rng, np.exp(-0.1), fine.size)
        chosen = np.sort(rng.choice(fine.size, 8000, replace=False))
        chosen = chosen[(chosen < 15_000) | (chosen > 22_000)]
        run = a_run(rng, "a", 1e4, 0.0, fine[chosen])
        found = effective_samples([{"angle_rad": process[chosen]}], Measurement((run,), ("angle_rad",)))[
            "angle_rad"
        ]
        # variance of the mean of these very readings
        lag = np.arange(2000)
        pairs = np.correlate(*[np.bincount(chosen, minlength=fine.size)[:8000]] * 2, mode="full")[
            7999 : 7999 + 2000
        ]
        share = pairs / pairs[0]
        ratios.append(found / (chosen.size / (1 + 2 * float(share[1:] @ np.exp(-0.1 * lag[1:])))))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.12)


def test_an_offset_in_each_run_is_worth_one_reading_per_run():
    measured = bench(0)
    rng = np.random.default_rng(0)
    offsets = [{"angle_rad": np.full(300, rng.normal())} for _ in measured.runs]
    assert effective_samples(offsets, measured)["angle_rad"] == pytest.approx(12, rel=1e-3)
    nothing = [{"angle_rad": np.full(300, np.nan)} for _ in measured.runs]
    assert effective_samples(nothing, measured)["angle_rad"] == 0.0
