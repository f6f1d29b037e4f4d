"""Measured sets: a truth scaled to the noise, read with noise, as a CSV, a study and the file of the model.

What was hidden is in the label, which is sealed. An effect that would need an implausible strength at a place is hidden
at another one (`benchmarks.systems.plausible`).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from benchmarks.evidence.form_table import Split
from benchmarks.evidence.sets import Outputs, Scaled, Spectrum, draw_noise, signal
from benchmarks.evidence.truths import CLEAN
from benchmarks.systems.form_table import EVERY, KINDS, UNKNOWN
from benchmarks.systems.number_equations import size_m as size_of_body_m
from benchmarks.systems.plausible import PLAUSIBLE
from benchmarks.systems.protocol import Run, protocol
from benchmarks.systems.robots import ROBOTS, Robot, mjcf
from benchmarks.systems.truth import FailedTruthError, Hidden, Truth

from pliant.interfaces.effect import AT

SIGMA_OF_RANGE = (0.01, 0.02)
SNR_RANGE = (1.5, 4.0)
# Thresholds are calibrated under another spectrum than they are judged under.
SPECTRA = {"judged": Spectrum(0.5, 0.5, 0.1), "calibration": Spectrum(0.5, 0.3, 0.05)}
TOLERANCE, ROUNDS, FIRST = 0.03, 14, 0.5
# Share of the strength below which an effect does not show at its place, and places that are tried.
ENOUGH, TRIES = 0.8, 4
RIGHT_OF_UNKNOWN = ("unknown_effect", "not_repeatable")


@dataclass(frozen=True)
class SystemSpec:
    """One set; with the same spec the same bytes come out. `draw` makes other sets of the same seeds."""

    kind: str
    seed: int
    robot: str = "reacher"
    split: Split = "judged"
    draw: str = ""

    def generator(self) -> np.random.Generator:
        """Return the random generator of this set."""
        text = f"{self.kind} {self.seed} {self.robot} {self.split} {self.draw}"
        return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:16]))


@dataclass(frozen=True, eq=False)
class SystemSet:
    """The public part of a set (`csv`, and `study` with `model` as its MJCF), and the hidden one (`label`)."""

    csv: str
    study: str
    model: str
    label: dict[str, Any]
    clean: Outputs
    hidden: Outputs


def make_set(spec: SystemSpec, name: str = "hidden") -> SystemSet:
    """Draw the truth, scale it, measure it.

    Raises:
        FailedTruthError: the effect shows at none of the places that were tried.
    """
    rng, robot = spec.generator(), ROBOTS[spec.robot]
    truth = Truth(robot, protocol(robot, rng), int(rng.integers(2**31)))
    sizes, target = rng.uniform(*SIGMA_OF_RANGE, len(robot.columns)), float(rng.uniform(*SNR_RANGE))
    clean = truth.readings()
    sigma = noise_sizes(robot, clean, dict(zip(robot.columns, sizes.tolist(), strict=True)))
    hidden, found = None, Scaled(0.0, clean, 0.0)
    if spec.kind != CLEAN:
        hidden, found, target = _hide(spec, truth, clean, sigma, target, rng)
    measured = _with_noise(truth.runs, found.outputs, sigma, spec.split, rng)
    csv = to_csv(robot, truth.runs, measured)
    places = hidden.places if hidden else ()
    label = {
        **asdict(spec),
        "kind": _named(spec.kind, truth, places),
        "forms": [hidden.form.name] if hidden else [],
        "numbers": dict(hidden.numbers) if hidden else {},
        "places": list(places),
        "strength": found.strength,
        "snr_wanted": target if hidden else 0.0,
        "snr_reached": found.signal,
        "excited": True,
        "sigma": sigma,
        "engine": robot.integrator,
        "protocol": "driven",
        "unknown": spec.kind in UNKNOWN,
        "right": list(RIGHT_OF_UNKNOWN if spec.kind in UNKNOWN else ("missing_effect",)),
        "csv_sha256": hashlib.sha256(csv.encode()).hexdigest(),
    }
    if spec.kind == CLEAN:
        label["right"] = ["nothing_missing"]
    return SystemSet(csv, study(robot, name), mjcf(robot.name), label, clean, found.outputs)


def _named(kind: str, truth: Truth, places: tuple[str, ...]) -> str:
    """Return the kind, with its place where it is at one of several."""
    if kind not in KINDS or KINDS[kind].place in ("vector", "world") or len(places) != 1:
        return kind
    group = {"spring": "joint", "drive": "joint", "pulled": "tendon"}.get(
        KINDS[kind].place, KINDS[kind].place
    )
    return f"{kind}{AT}{places[0]}" if len(truth.names(group)) > 1 else kind


def _hide(
    spec: SystemSpec,
    truth: Truth,
    clean: Outputs,
    sigma: dict[str, float],
    target: float,
    rng: np.random.Generator,
) -> tuple[Hidden, Scaled, float]:
    """Draw form, numbers and place of the effect, until it shows; return it, and its target within reach there."""
    kind = EVERY[spec.kind]
    names, forms = truth.names(kind.place), kind.of(spec.split)
    form = forms[int(rng.integers(len(forms)))]
    numbers = {name: float(rng.uniform(*ends)) for name, ends in form.ranges.items()}
    sign = float(rng.choice((-1.0, 1.0))) if kind.signed else 1.0
    one_place, may_be_at_all = kind.place in ("vector", "world"), not kind.alone and truth.robot.alike
    at_all = one_place or (may_be_at_all and rng.uniform() < 0.5)
    order = [] if at_all else rng.permutation(len(names))[:TRIES].tolist()
    tried: list[tuple[str, ...]] = [(names[k],) for k in order]
    if one_place or may_be_at_all:  # also where it shows at no single place
        tried.append(tuple(names))
    for way, places in ((w, p) for w in dict.fromkeys((sign, abs(sign))) for p in tried):
        hidden = Hidden(spec.kind, form, places, numbers, way)
        largest = largest_at(truth, hidden)
        if largest <= 0.0:
            continue

        def at(strength: float, one: Truth = truth.with_hidden(hidden)) -> Scaled:
            read = one.readings(strength)
            return Scaled(strength, read, signal(clean, read, sigma))

        wanted = within_reach(target, _reach(at, largest))
        if wanted is None:
            continue
        found = scaled(at, largest, clean, wanted)
        if ENOUGH * wanted <= found.signal <= wanted / ENOUGH:
            return hidden, found, wanted
    where = ", ".join(" ".join(one) for one in tried)
    raise FailedTruthError(f"{spec.kind} does not show with a plausible strength at {where}")


def _reach(at: Callable[[float], Scaled], largest: float) -> float:
    """Return the signal at the largest plausible strength; infinite where the truth diverges there."""
    try:
        return at(largest).signal
    except FailedTruthError:
        return math.inf


def within_reach(target: float, reach: float) -> float | None:
    """Return the target, drawn from `SNR_RANGE`, as a draw from the part of the range within reach; None without."""
    low, high = SNR_RANGE
    if reach < low:
        return None
    return low + (target - low) * (min(high, reach) - low) / (high - low)


def largest_at(truth: Truth, hidden: Hidden) -> float:
    """Return the largest plausible strength at the effect's places; 0 where it would be too far from a body."""
    limit = PLAUSIBLE[hidden.kind]
    if not math.isfinite(limit.aside_m):
        return limit.largest
    model = truth.model()
    size_m = max(size_of_body_m(model, model.body(name).id) for name in hidden.places)
    if "away" not in hidden.numbers:  # the strength is the distance
        return min(limit.largest, limit.aside_m / size_m)
    way = np.linalg.norm([hidden.numbers[axis] for axis in "xyz"])
    return limit.largest if hidden.numbers["away"] * size_m * way <= limit.aside_m else 0.0


def scaled(at: Callable[[float], Scaled], largest: float, clean: Outputs, target: float) -> Scaled:
    """Return the truth with the target signal, or at the largest strength: by secants of the logarithms."""
    strength, slope, before, best = FIRST * largest, 1.0, None, Scaled(0.0, clean, 0.0)
    for _ in range(ROUNDS):
        try:
            now = at(strength)
        except FailedTruthError:
            largest = min(largest, 0.8 * strength)
            strength = 0.5 * (strength + (before or (0.0,))[0])
            continue
        best = min(best, now, key=lambda one: abs(math.log(max(one.signal, 1e-12) / target)))
        short = now.signal < target and strength >= largest
        if (
            abs(now.signal - target) <= TOLERANCE * target
            or short
            or (now.signal == 0.0 and strength >= largest)
        ):
            break
        reached = max(now.signal, 1e-3 * target)
        if before and before[0] != strength and before[1] != reached:
            slope = math.log(reached / before[1]) / math.log(strength / before[0])
        before = (strength, reached)
        factor = (target / reached) ** (1.0 / min(max(slope, 0.5), 3.0))
        strength = min(strength * min(max(factor, 0.1), 10.0), largest)
    return best


def noise_sizes(robot: Robot, clean: Outputs, shares: dict[str, float]) -> dict[str, float]:
    """Return σ of every output: a share of its range, for vectors of that of their largest component."""
    ranges = {name: float(np.ptp(np.concatenate([run[name] for run in clean]))) for name in robot.columns}
    sigma = {name: shares[name] * ranges[name] for name in robot.joints}
    for stem, (_, axes) in robot.sites.items():
        names = [f"{stem}_{c}_m" for c in axes]
        size = shares[names[0]] * max(ranges[name] for name in names)
        sigma |= dict.fromkeys(names, size)
    return sigma


def _with_noise(
    runs: tuple[Run, ...], outputs: Outputs, sigma: dict[str, float], split: Split, rng: np.random.Generator
) -> Outputs:
    return [
        {
            name: values + sigma[name] * draw_noise(SPECTRA[split], run.time_s, rng)
            for name, values in read.items()
        }
        for run, read in zip(runs, outputs, strict=True)
    ]


def to_csv(robot: Robot, runs: tuple[Run, ...], outputs: Outputs) -> str:
    """Return the recording: commanded and read values only."""
    lines = [",".join(["run", "time_s", *robot.inputs, *robot.columns])]
    for run, read in zip(runs, outputs, strict=True):
        columns = [*run.commands.T, *(read[name] for name in robot.columns)]
        for t, *row in zip(run.time_s, *columns, strict=True):
            lines.append(f"{run.name},{t:.3f}," + ",".join(f"{value:.7g}" for value in row))
    return "\n".join(lines) + "\n"


def study(robot: Robot, name: str) -> str:
    """Return the study of a model NAME.xml beside it."""
    inputs = "".join(f"\n    {column}: '{one[0]}'" for column, one in robot.inputs.items())
    outputs = "".join(f"\n    {column}: 'sensor:{sensor}'" for column, sensor in robot.columns.items())
    start = "settled"
    if robot.start and not robot.settle_s:
        start = "".join(f"\n    '{joint}': {position}" for joint, position in robot.start.items())
    return (
        f"name: {name}\nmodel:\n  kind: mjcf\n  file: {name}.xml\n  inputs:{inputs}\n  outputs:{outputs}\n"
        f"  initial: {start}\n"
    )
