"""Measured sets: a truth scaled to the noise, followed by an engine, read with noise, written as a CSV.

What leaves this file for the diagnoser is a study and a CSV. What was hidden is in the label, which is sealed.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from benchmarks.evidence import functional_truth, mujoco_truth, noise
from benchmarks.evidence.protocols import SAMPLE_S, Protocol, protocol
from benchmarks.evidence.robots import ROBOTS, Array, Robot, readings
from benchmarks.evidence.truths import (
    CLEAN,
    Engine,
    HiddenTruth,
    Sensor,
    Split,
    Truth,
    draw,
    hidden_kinds,
    right_verdicts,
)

ENGINES: dict[str, Any] = {"functional": functional_truth, "mujoco": mujoco_truth}
SIGMA_OF_RANGE = 0.02
SNR_RANGE = (1.5, 3.0)
EXCITED_SNR = 0.3
SCALING_TOLERANCE, SCALING_ROUNDS = 0.02, 12

Outputs = list[dict[str, Array]]
# Noiseless outputs at a strength for each part.
Follow = Callable[..., Outputs]


@dataclass(frozen=True)
class SetSpec:
    """One set; with the same spec the same bytes come out.

    `kind` is "a+b" where two effects are hidden; `snr` is the RMS change of the outputs in σ that each makes alone;
    None draws it from `SNR_RANGE`.
    """

    kind: str
    seed: int
    engine: Engine = "functional"
    robot: str = "joint"
    protocol: str = "rich"
    split: Split = "judged"
    snr: float | None = None

    def generator(self) -> np.random.Generator:
        """Random numbers of this set alone."""
        text = f"{self.kind} {self.seed} {self.engine} {self.robot} {self.protocol} {self.split} {self.snr}"
        return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:16]))


@dataclass(frozen=True, eq=False)
class MeasuredSet:
    """What the bench gives away (`study`, `csv`) and what it hides (`label`).

    `clean` and `hidden` are the noiseless outputs without and with the effect, `sigma` the noise's size.
    """

    study: str
    csv: str
    label: dict[str, Any]
    clean: Outputs
    hidden: Outputs
    sigma: dict[str, float]


def make_set(spec: SetSpec, name: str = "hidden") -> MeasuredSet:
    """Draw the truth, scale it, measure it.

    Raises:
        ValueError: a kind, engine or protocol that is not there.
        RuntimeError: an engine did not follow the truth.
    """
    rng = spec.generator()
    robot, runs = ROBOTS[spec.robot], protocol(spec.protocol)
    truth = draw(spec.kind, spec.engine, robot, spec.split, rng)
    slips = rng.standard_normal(len(runs))
    drawn_snrs = [float(rng.uniform(*SNR_RANGE)) for _ in truth.parts]
    targets = drawn_snrs if spec.snr is None else [spec.snr] * len(truth.parts)

    def outputs_of(part: HiddenTruth, engine: str) -> Follow:
        return lambda *strengths: follow(engine, robot, runs, part.at(*strengths), slips)

    clean = outputs_of(truth, spec.engine)()
    sigma = {key: SIGMA_OF_RANGE * float(np.ptp(_joined(clean, key))) for key in robot.outputs}
    scaled = _each_alone(spec, truth, outputs_of, clean, sigma, targets)
    hidden = scaled[0].outputs if len(scaled) == 1 else clean
    if len(scaled) > 1:
        hidden = outputs_of(truth, spec.engine)(*(part.strength for part in scaled))
    snr = signal(clean, hidden, sigma)
    measured = _with_noise(hidden, sigma, runs, noise.SPECTRA[spec.split], rng)
    csv = to_csv(runs, measured, robot)
    label = {
        **asdict(spec),
        "kinds": list(hidden_kinds(spec.kind)),
        "right": list(right_verdicts(spec.kind)),
        "strengths": [part.strength for part in scaled],
        "snr_wanted": [] if spec.kind == CLEAN else targets,
        "snr_alone": [part.signal for part in scaled],
        "snr_reached": snr,
        "excited": all(part.signal >= EXCITED_SNR for part in scaled),
        "sigma": sigma,
        "drawn": dict(truth.drawn),
        "csv_sha256": hashlib.sha256(csv.encode()).hexdigest(),
    }
    return MeasuredSet(robot.study(name), csv, label, clean, hidden, sigma)


def follow(engine: str, robot: Robot, runs: Protocol, truth: Truth, slips: Array) -> Outputs:
    """Noiseless outputs of every run."""
    angles = ENGINES[engine].follow(robot, runs, truth)
    pitches = [np.full(len(run), run.base_pitch_rad) for run in runs]
    ideal = [readings(robot, q, pitch) for q, pitch in zip(angles, pitches, strict=True)]
    return [
        {**reading, "angle_rad": sensed(reading["angle_rad"], truth.sensor, slip)}
        for reading, slip in zip(ideal, slips, strict=True)
    ]


def sensed(angle: Array, sensor: Sensor, slip: float) -> Array:
    """What the angle sensor says: lost motion, scale, bias, and where it was put for this run."""
    seen: Array = _play(angle, sensor.play_rad) if sensor.play_rad else angle
    return seen * (1 + sensor.scale) + sensor.bias_rad + sensor.slip_rad * slip


def _play(angle: Array, width: float) -> Array:
    """The play operator: the output is dragged by either side of a gap of this width; it starts in the middle."""
    out = angle.copy()
    for i in range(1, len(out)):
        out[i] = min(max(out[i - 1], angle[i] - width / 2), angle[i] + width / 2)
    return out


def signal(clean: Outputs, hidden: Outputs, sigma: dict[str, float]) -> float:
    """RMS change over samples and outputs, in σ."""
    squares = [np.mean((_joined(hidden, key) - _joined(clean, key)) ** 2) / sigma[key] ** 2 for key in sigma]
    return float(np.sqrt(np.mean(squares)))


@dataclass(frozen=True)
class Scaled:
    """One effect alone at its strength: what the bench would read, and how far that is from clean, in σ."""

    strength: float
    outputs: Outputs
    signal: float


def _each_alone(
    spec: SetSpec,
    truth: HiddenTruth,
    outputs_of: Callable[[HiddenTruth, str], Follow],
    clean: Outputs,
    sigma: dict[str, float],
    targets: list[float],
) -> list[Scaled]:
    """Every part scaled to its own target; nothing for a clean set."""
    if spec.kind == CLEAN:
        return []
    found = []
    for index, target in enumerate(targets):
        part, guess = truth.alone(index), target / 2
        largest = part.parts[0].largest
        if spec.engine != "functional":  # the fast engine knows nearly the strength
            still = outputs_of(part, "functional")
            nearly = _scaled(still, largest, still(), sigma, target, guess)
            guess = nearly.strength if nearly.signal > 0 else guess
        found.append(_scaled(outputs_of(part, spec.engine), largest, clean, sigma, target, guess))
    return found


def _scaled(
    outputs: Follow,
    largest: float,
    clean: Outputs,
    sigma: dict[str, float],
    target: float,
    guess: float,
) -> Scaled:
    """At the strength at which the signal is the target, or at the largest sensible one below it.

    The signal grows about as a power of the strength: secants of their logarithms.
    """
    strength, power = min(guess, largest), 1.0
    before: tuple[float, float] | None = None
    for _ in range(SCALING_ROUNDS):
        hidden = outputs(strength)
        reached = signal(clean, hidden, sigma)
        met = abs(reached - target) <= SCALING_TOLERANCE * target
        if met or reached == 0 or (reached < target and strength >= largest):
            break
        if before is not None and before[0] != strength:
            power = math.log(reached / before[1]) / math.log(strength / before[0])
        before = (strength, reached)
        strength = min(strength * (target / reached) ** (1 / min(max(power, 0.3), 3.0)), largest)
    return Scaled(strength, hidden, reached)


def _with_noise(
    outputs: Outputs,
    sigma: dict[str, float],
    runs: Protocol,
    spectrum: noise.Spectrum,
    rng: np.random.Generator,
) -> Outputs:
    lengths = [len(run) for run in runs]
    drawn = {key: noise.draw(spectrum, lengths, SAMPLE_S, rng) for key in sigma}
    return [{key: run[key] + sigma[key] * drawn[key][i] for key in sigma} for i, run in enumerate(outputs)]


def _joined(outputs: Outputs, key: str) -> Array:
    return np.concatenate([run[key] for run in outputs])


def to_csv(runs: Protocol, outputs: Outputs, robot: Robot) -> str:
    """The measurement CSV of docs/conventions.md: what was commanded and read, nothing else."""
    columns = ["run", "specimen", "time_s", "pressure_pa", "moment_n_m", "temperature_c", "base_pitch_rad"]
    lines = [",".join([*columns, *robot.outputs])]
    for number, (run, read) in enumerate(zip(runs, outputs, strict=True), 1):
        conditions = f"{run.temperature_c:.1f},{run.base_pitch_rad:.6f}"
        values = np.column_stack([read[key] for key in robot.outputs])
        for t, p, m, row in zip(run.time_s, run.pressure_pa, run.moment_n_m, values, strict=True):
            numbers = ",".join(f"{value:.6f}" for value in row)
            lines.append(f"r{number:02d},{run.specimen},{t:.1f},{p:.1f},{m:.6f},{conditions},{numbers}")
    return "\n".join(lines) + "\n"


def expected_samples(name: str) -> int:
    """Samples of a protocol."""
    return sum(len(run) for run in protocol(name))


def minutes(name: str) -> float:
    """Bench time of a protocol's motion, without rests."""
    return math.fsum(len(run) for run in protocol(name)) * SAMPLE_S / 60
