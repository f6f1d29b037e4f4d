"""Measured sets: a truth scaled to the noise, followed by an engine, read with noise, written as a CSV.

What leaves this file for the diagnoser is a study and a CSV. What was hidden is in the label, which is sealed.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from benchmarks.evidence import explicit_truth, functional_truth, mujoco_truth, rod_truth
from benchmarks.evidence.bench_errors import done
from benchmarks.evidence.form_table import Split
from benchmarks.evidence.law_shapes import draw_law_shape, draw_pull
from benchmarks.evidence.protocols import ROOM_C, Protocol, Run, protocol
from benchmarks.evidence.robots import PRESSURE_MAX_PA, ROBOTS, ROD, TIPS, Array, Robot
from benchmarks.evidence.sensors import sensed
from benchmarks.evidence.skeleton import readings
from benchmarks.evidence.truths import (
    CLEAN,
    Engine,
    HiddenTruth,
    Truth,
    draw,
    hidden_kinds,
    hidden_parameters,
    right_verdicts,
    right_where_the_law_is_off,
)

from pliant.experiments.planned_run import PlannedRun

ENGINES: dict[str, Any] = {
    "functional": functional_truth,
    "mujoco": mujoco_truth,
    "explicit": explicit_truth,
}
ALL_ROBOTS = {**ROBOTS, ROD.name: ROD}
SIGMA_OF_RANGE = 0.02
SNR_RANGE = (1.5, 3.0)
EXCITED_SNR = 0.3
SCALING_TOLERANCE, SCALING_ROUNDS = 0.02, 12
# Of a strength at which the truth has no equilibrium: the largest that is tried next.
LESS = 0.8
# Share of the target below which such a truth is no set of its strength.
ENOUGH = 0.8


@dataclass(frozen=True)
class Spectrum:
    """σ² is split into a first-order autoregressive share and a white one; offsets per run come on top.

    Attributes:
        coloured_share: share of the variance within a run that is coloured.
        correlation_s: its autocorrelation falls to 1/e after this time.
        run_offset: standard deviation of a run's offset, in σ.
    """

    coloured_share: float = 0.5
    correlation_s: float = 4.0
    run_offset: float = 0.25


# Thresholds are calibrated under another spectrum than they are judged under.
SPECTRA = {"judged": Spectrum(), "calibration": Spectrum(0.65, 2.5, 0.2)}


def draw_noise(spectrum: Spectrum, clock: Array, rng: np.random.Generator) -> Array:
    """Return (t,) noise of unit σ for a run sampled at these times: coloured and white, with an offset."""
    keep = np.exp(-np.diff(clock) / spectrum.correlation_s).tolist()
    pushes = rng.standard_normal(len(clock)).tolist()
    coloured = [pushes[0]]  # the first value has the stationary spread
    for kept, push in zip(keep, pushes[1:], strict=True):
        coloured.append(kept * coloured[-1] + math.sqrt(1.0 - kept * kept) * push)
    within = np.sqrt(spectrum.coloured_share) * np.array(coloured)
    within += np.sqrt(1 - spectrum.coloured_share) * rng.standard_normal(len(clock))
    return within + spectrum.run_offset * rng.standard_normal()


Outputs = list[dict[str, Array]]
# Noiseless outputs at a strength for each part.
Follow = Callable[..., Outputs]


@dataclass(frozen=True)
class SetSpec:
    """One set; with the same spec the same bytes come out.

    `kind` is "a+b" where two effects are hidden; `snr` is the RMS change of the outputs in σ that each makes alone;
    None draws it from `SNR_RANGE`. `draw` makes other sets of the same seeds. The joint law is off by `law_error`, a
    share of its torque range, in the shape of `law_seed`; at 0 it is the truth's own, as exact as `truths.draw` has it.
    `candidates`: the hidden effect has the candidate's equation.
    """

    kind: str
    seed: int
    engine: Engine = "functional"
    robot: str = "joint"
    protocol: str = "rich"
    split: Split = "judged"
    snr: float | None = None
    draw: str = ""
    law_error: float = 0.0
    law_seed: int = 0
    candidates: bool = False

    def generator(self) -> np.random.Generator:
        """Return the random generator of this set."""
        text = f"{self.kind} {self.seed} {self.engine} {self.robot} {self.protocol} {self.split} {self.snr}{self.draw}"
        if self.law_error or self.candidates:
            text += f" {self.law_error} {self.law_seed} {self.candidates}"
        return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:16]))


@dataclass(frozen=True, eq=False)
class MeasuredSet:
    """The public (`study`, `csv`) and the hidden part (`label`) of a set.

    `clean` and `hidden` are the noiseless outputs without and with the effect, `measured` the hidden ones with noise of
    the size `sigma`.
    """

    study: str
    csv: str
    label: dict[str, Any]
    clean: Outputs
    hidden: Outputs
    measured: Outputs
    sigma: dict[str, float]


def make_set(spec: SetSpec, name: str = "hidden") -> MeasuredSet:
    """Draw the truth, scale it, measure it.

    Raises:
        ValueError: a kind, engine or protocol that is not there.
        RuntimeError: an engine did not follow the truth.
    """
    rng = spec.generator()
    robot = ALL_ROBOTS[spec.robot]
    runs = protocol(spec.protocol, robot)
    truth = draw_truth(spec, rng)
    slips = rng.standard_normal(len(runs))
    drawn_snrs = [float(rng.uniform(*SNR_RANGE)) for _ in truth.parts]
    targets = drawn_snrs if spec.snr is None else [spec.snr] * len(truth.parts)

    def output_function(part: HiddenTruth, engine: str) -> Follow:
        return lambda *strengths: follow(engine, robot, runs, part.at(*strengths), slips)

    clean = output_function(truth, spec.engine)(*_nothing(truth))
    sigma = noise_sizes(clean)
    scaled = []  # each part to its own target
    for index, target in enumerate(targets if spec.kind != CLEAN else ()):
        part, guess = truth.alone(index), target / 2
        largest = part.parts[0].largest
        if part.parts[0].unscaled:
            read = output_function(part, spec.engine)(1.0)
            scaled.append(Scaled(1.0, read, signal(clean, read, sigma)))
            continue
        if spec.engine not in ("functional", "rod"):  # the fast engine gives an approximate strength
            still = output_function(part, "functional")
            nearly = _scaled(still, largest, still(), sigma, target, guess)
            guess = nearly.strength if nearly.signal > 0 else guess
        scaled.append(_scaled(output_function(part, spec.engine), largest, clean, sigma, target, guess))
    hidden = scaled[0].outputs if len(scaled) == 1 else clean
    if len(scaled) > 1:
        hidden = output_function(truth, spec.engine)(*(part.strength for part in scaled))
    snr = signal(clean, hidden, sigma)
    measured = _with_noise(hidden, sigma, runs, spec.split, rng)
    csv = to_csv(runs, measured, robot)
    label = {
        **asdict(spec),
        "kinds": list(hidden_kinds(spec.kind)),
        "right": list((right_where_the_law_is_off if spec.law_error else right_verdicts)(spec.kind)),
        "strengths": [part.strength for part in scaled],
        "snr_wanted": [] if spec.kind == CLEAN else targets,
        "snr_alone": [part.signal for part in scaled],
        "snr_reached": snr,
        "excited": all(part.signal >= EXCITED_SNR for part in scaled),
        "sigma": sigma,
        "forms": [part.form for part in truth.parts],
        "drawn": dict(truth.drawn),
        "parameters": {
            name: value
            for part, one in zip(truth.parts, scaled, strict=False)
            if spec.candidates
            for name, value in hidden_parameters(part, one.strength).items()
        },
        **_law_label(spec, truth, output_function, clean, sigma),
        "csv_sha256": hashlib.sha256(csv.encode()).hexdigest(),
    }
    study = robot.study(name, truth.stated_gravity, exact_law=not spec.law_error)
    return MeasuredSet(study, csv, label, clean, hidden, measured, sigma)


def _nothing(truth: HiddenTruth) -> list[float]:
    """Return zero strengths of a truth."""
    return [0.0 for part in truth.parts if part.unscaled]


def draw_truth(spec: SetSpec, rng: np.random.Generator | None = None) -> HiddenTruth:
    """Draw the truth of a set without its strengths; `rng` is the set's own generator from its start."""
    robot = ALL_ROBOTS[spec.robot]
    truth = draw(spec.kind, spec.engine, robot, spec.split, rng or spec.generator(), spec.candidates)
    if not spec.law_error:
        return truth
    drawn = {name: value for name, value in truth.drawn.items() if name not in truth.error}
    if spec.engine == "rod":
        _, pull = draw_pull(spec.law_error, spec.split, np.random.default_rng(spec.law_seed))
        return replace(truth, error={}, drawn=drawn, pull=tuple(pull.tolist()))
    law = draw_law_shape(spec.law_error, spec.law_seed, spec.split, spec.robot, spec.protocol)
    return replace(
        truth, error={}, drawn=drawn | {f"law.{k}": v for k, v in law.drawn.items()}, law=law.table
    )


def _law_label(
    spec: SetSpec,
    truth: HiddenTruth,
    outputs_of: Callable[[HiddenTruth, str], Follow],
    clean: Outputs,
    sigma: dict[str, float],
) -> dict[str, Any]:
    """Return a label's entries on the law's error: its basis, its size, and its influence on these readings, in σ."""
    if not spec.law_error:
        return {}
    form, largest = "a pull", None
    exact = outputs_of(replace(truth, law=None, pull=()), spec.engine)(*_nothing(truth))
    if spec.engine != "rod":
        law = draw_law_shape(spec.law_error, spec.law_seed, spec.split, spec.robot, spec.protocol)
        form, largest = law.form, law.largest
    return {"law_form": form, "law_largest": largest, "law_snr": signal(clean, exact, sigma)}


def follow(engine: str, robot: Robot, runs: Protocol, truth: Truth, slips: Array) -> Outputs:
    """Return noiseless outputs of every run: the readings of its sensors."""
    if engine == "rod":
        every = zip(runs, rod_truth.follow(runs, truth.rod), strict=True)
        kept = ((slice(None) if run.kept is None else run.kept, read) for run, read in every)
        return [{name: read[name][part] for name in robot.outputs} for part, read in kept]
    outputs = []
    runs = done(runs, truth.bench)
    for run, angles, slip in zip(
        runs, ENGINES[engine].follow(robot, runs, truth), slips.tolist(), strict=True
    ):
        share = run.pressure_pa / PRESSURE_MAX_PA
        ideal = readings(robot, angles, run.base_angles_rad, truth.body, share)
        names = (*robot.outputs, *robot.second) if run.second else robot.outputs
        turns = [name for name in names if name.endswith("angle_rad")]
        held = (slip, run.temperature_c - ROOM_C, run.base_angles_rad[1])
        seen = {name: sensed(ideal[name], run.time_s, truth.sensor, *held) for name in turns}
        read = {name: seen.get(name, ideal[name]) for name in names}
        outputs.append(read if run.kept is None else {name: value[run.kept] for name, value in read.items()})
    return outputs


def noise_sizes(clean: Outputs) -> dict[str, float]:
    """Return σ of every output: a share of its range, of the largest range for the tip's three coordinates."""
    names = list(dict.fromkeys(name for run in clean for name in run))
    ranges = {name: float(np.ptp(_joined(clean, name))) for name in names}
    widest = max((ranges[name] for name in names if name in TIPS), default=0.0)
    return {name: SIGMA_OF_RANGE * (widest if name in TIPS else ranges[name]) for name in names}


def signal(clean: Outputs, hidden: Outputs, sigma: dict[str, float]) -> float:
    """Return RMS change over all readings, in σ."""
    changes = [(_joined(hidden, key) - _joined(clean, key)) / sigma[key] for key in sigma]
    return float(np.sqrt(np.mean(np.concatenate(changes) ** 2)))


class Scaled(NamedTuple):
    """One effect alone at its strength: the bench's readings, and their difference from clean ones, in σ."""

    strength: float
    outputs: Outputs
    signal: float


def _scaled(
    outputs: Follow, largest: float, clean: Outputs, sigma: dict[str, float], target: float, guess: float
) -> Scaled:
    """Return the truth with the target signal, or at the largest sensible strength if that is below it.

    The signal grows about as a power of the strength: secants of their logarithms. Where the truth has no equilibrium
    at a strength, that is beyond the largest sensible one.

    Raises:
        RuntimeError: the truth has no equilibrium at strengths that come near the target.
    """
    strength, power, stopped = min(guess, largest), 1.0, False
    before: tuple[float, float] | None = None
    found: tuple[float, Outputs, float] | None = None
    for _ in range(SCALING_ROUNDS):
        try:
            hidden = outputs(strength)
        except RuntimeError:
            largest, stopped = LESS * strength, True
            strength = largest if before is None else min(largest, 0.5 * (strength + before[0]))
            continue
        reached = signal(clean, hidden, sigma)
        found = strength, hidden, reached
        met = abs(reached - target) <= SCALING_TOLERANCE * target
        if met or reached == 0 or (reached < target and strength >= largest):
            break
        if before is not None and before[0] != strength:
            power = math.log(reached / before[1]) / math.log(strength / before[0])
        before = (strength, reached)
        strength = min(strength * (target / reached) ** (1 / min(max(power, 0.3), 3.0)), largest)
    if found is None or (stopped and found[2] < ENOUGH * target):
        raise RuntimeError("the truth has no equilibrium at the strength that is wanted, nor near it")
    return Scaled(*found)


def _with_noise(outputs: Outputs, sigma: dict[str, float], runs: Protocol, split: Split, rng: Any) -> Outputs:
    """Return the readings with noise of each output in turn, run by run."""
    clocks = [run.recorded().time_s for run in runs]
    drawn = {key: [draw_noise(SPECTRA[split], clock, rng) for clock in clocks] for key in sigma}
    return [
        {key: values + sigma[key] * drawn[key][i] for key, values in run.items()}
        for i, run in enumerate(outputs)
    ]


def _joined(outputs: Outputs, key: str) -> Array:
    """Return the output over the runs that have it."""
    return np.concatenate([run[key] for run in outputs if key in run])


def to_csv(runs: Protocol, outputs: Outputs, robot: Robot) -> str:
    """Return the measurement CSV of docs/measurement_files.md: commanded and read values only."""
    runs = tuple(run.recorded() for run in runs)
    names = list(dict.fromkeys(name for run in outputs for name in run))
    turns = ["base_roll_rad", "base_pitch_rad"]
    payload = ["payload_kg"] if any(run.payload_kg for run in runs) else []
    valve = [] if all(run.valve_open is None for run in runs) else ["valve_open"]
    columns = [
        "run",
        "specimen",
        "time_s",
        robot.drive,
        "moment_n_m",
        "temperature_c",
        *turns,
        *payload,
        *valve,
    ]
    lines = [",".join([*columns, *names])]
    per_pressure = robot.drive_max / PRESSURE_MAX_PA
    for number, (run, read) in enumerate(zip(runs, outputs, strict=True), 1):
        roll, pitch, _ = run.base_angles_rad
        fixed = f"{run.temperature_c:.1f},{roll:.6f},{pitch:.6f}"
        fixed += f",{run.payload_kg:.4f}" if payload else ""
        drive = [f"{value * per_pressure:.{1 if per_pressure == 1.0 else 5}f}" for value in run.pressure_pa]
        cells = [
            [f"{value:.6f}" for value in read[name]] if name in read else [""] * len(run) for name in names
        ]
        state = [[f"{value:.0f}" for value in run.valve]] if valve else []
        head = f"r{number:02d},{run.specimen}"
        for t, p, m, *row in zip(run.time_s, drive, run.moment_n_m, *state, *cells, strict=True):
            lines.append(",".join([f"{head},{t:.2f},{p},{m:.6f},{fixed}", *row]))
    return "\n".join(lines) + "\n"


def bench_run(run: PlannedRun, robot: Robot, number: int = 1) -> Run:
    """Return a run of the catalogue as performed: same inputs, loads and conditions; `number` names a new specimen."""
    history = run.history
    roll, pitch, yaw = (float(angle) for angle in history.base_angles_rad[0])
    return Run(
        run.name,
        f"new {number}" if run.new_specimen else history.specimen,
        history.actuation[robot.drive] * (PRESSURE_MAX_PA / robot.drive_max),
        history.moment_n_m,
        temperature_c=float(history.temperature_c[0]),
        base_angles_rad=(roll, pitch, yaw),
        valve_open=history.valve_open,
        second=bool(run.adds),
        time_s=history.time_s,
    )


def added_csv(spec: SetSpec, made: MeasuredSet, runs: Sequence[PlannedRun], seed: int = 0) -> str:
    """Return the CSV of these runs, recorded after the set: `pliant diagnose --data set.csv --data added.csv`.

    The truth, its strength and the noise's size are those of the set; the noise is new, and the same for the same
    seed.
    """
    robot, before = ALL_ROBOTS[spec.robot], protocol(spec.protocol, ALL_ROBOTS[spec.robot])
    truth = draw_truth(spec)
    added = [bench_run(run, robot, number) for number, run in enumerate(runs, 1)]
    every = (*before, *added)
    rng = np.random.default_rng([seed, *spec.generator().integers(0, 2**31, 4)])
    slips = rng.standard_normal(len(every))
    read = follow(spec.engine, robot, every, truth.at(*made.label["strengths"]), slips)[len(before) :]
    sizes = noise_sizes(read) | made.sigma
    sigma = {name: sizes[name] for run in read for name in run}
    noisy = _with_noise(read, sigma, tuple(added), spec.split, rng)
    return to_csv(tuple(added), noisy, robot)
