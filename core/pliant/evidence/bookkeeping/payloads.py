"""Payloads with wrong labels: one mass for each run, estimated by the model at equilibrium.

Other possible errors of the physics are fitted at the same time: a tilt of the base, the scale of the drive, the
weight of everything (in statics a stiffness is equivalent to both), and the zero of every output. A label is reported
only if free masses explain clearly more than all of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pliant.evidence.bookkeeping.mistake import Correction, Mistake, ReadingsByName
from pliant.evidence.bookkeeping.static_model import NUMBERED, WITHOUT, StaticModel
from pliant.formatting import display_unit, listed, number, plural, with_sd
from pliant.interfaces.effect import Model
from pliant.mechanics.rotations import exp_map
from pliant.records.design import Array
from pliant.records.history import History

# Up to this number each run has a free mass; with more, runs with the same label share one.
MOST_GROUPS = 8
# Free masses must leave at most this share of the error that remains after the rest of the fit.
LOWER = 0.55
# A mass differs from its label by at least this number of standard errors, this share of it, and this mass.
SIGNIFICANT, SHARE, LEAST_KG = 3.0, 0.08, 3e-4
# Neighbouring readings share their error: standard errors that assume independence are too small by this factor.
INFLATION = 2.0
ITERATIONS = 5
SHARES = (1.0, 0.3, 0.1)  # of a step that are tried
PULL = 0.01  # of a parameter toward the record, per its usual size, in spreads
USUAL_KG = 5e-3
TILT_RAD, RELATIVE, STEP_KG = 1e-3, 1e-3, 2e-4  # steps of differences
MOST_NAMED = 4


@dataclass(frozen=True)
class Hung:
    """Runs that share a payload: their names, the stated mass and the mass by the model, kg."""

    runs: tuple[str, ...]
    stated_kg: float
    mass_kg: float
    sd_kg: float

    @property
    def differs(self) -> bool:
        """Return whether the mass differs from the stated one significantly and by a relevant amount."""
        off = abs(self.mass_kg - self.stated_kg)
        return off > max(SIGNIFICANT * self.sd_kg, SHARE * self.stated_kg, LEAST_KG)

    @property
    def impossible(self) -> bool:
        """Return whether the mass is negative beyond chance: the free masses then compensate for something else."""
        return self.mass_kg < -max(SIGNIFICANT * self.sd_kg, LEAST_KG)


def payload_mistakes(model: StaticModel) -> list[Mistake]:
    """Return the payloads that disagree with their labels as one mistake; empty where no run states a payload."""
    groups = _groups(model.histories)
    chain = model.predictor.chain
    if not any(stated > 0.0 for _, stated in groups) or not np.any(chain.gravity_m_s2):
        return []
    fit = _Fit(model, groups)
    plain = fit.solve(np.zeros(0))
    masses = fit.solve(np.array([stated for _, stated in groups]), plain[0])
    before, after = plain[1], masses[1]
    if not after <= LOWER * before:
        return []
    n, sds = len(groups), masses[2]
    hung = [
        Hung(runs, stated, float(mass), float(sd))
        for (runs, stated), mass, sd in zip(groups, masses[0][-n:], sds[-n:], strict=True)
    ]
    wrong = [one for one in hung if one.differs]
    if not wrong or any(one.impossible for one in hung):
        return []
    words = _words(_merged(wrong, hung))
    remedy = (
        "Weigh what hung there, with its hook and cable, and correct 'payload_kg' in the recording, in the names of "
        "its files or in the study; the effect 'payload_error' fits it."
    )
    return [Mistake("payload", ("payload_kg",), words, remedy, before, after)]


class _Fit:
    """Least squares of the readings by tilt, drive, weight, zeros and, if given, masses."""

    def __init__(self, model: StaticModel, groups: Sequence[tuple[tuple[str, ...], float]]) -> None:
        self.model, self.groups = model, groups
        self.of_run = {run: k for k, (runs, _) in enumerate(groups) for run in runs}
        self.scale = _scales(model.readings)
        self.base = np.array([0.0, 0.0, 1.0, 1.0])  # pitch, roll, drive, weight
        self.sizes = np.array([0.1, 0.1, 0.2, 0.3])
        self.steps = np.array([TILT_RAD, TILT_RAD, RELATIVE, RELATIVE])

    def solve(self, masses: Array, start: Array | None = None) -> tuple[Array, float, Array]:
        """Return parameters, root mean square error and standard errors, by Gauss–Newton steps."""
        middle = np.concatenate([self.base, masses])
        x = np.concatenate([self.base if start is None else start[:4], masses])
        sizes = np.concatenate([self.sizes, np.maximum(masses, USUAL_KG)])
        pull = np.diag(PULL / sizes)  # parameters to which the readings are insensitive stay at their start

        def cost(r: Array, at: Array) -> float:
            return float(r @ r + np.sum((pull @ (at - middle)) ** 2))

        best, slopes = self._residual(x), np.zeros((0, len(x)))
        for _ in range(ITERATIONS):
            slopes = self._slopes(x, best)
            table, wanted = np.vstack([slopes, pull]), np.concatenate([best, pull @ (x - middle)])
            step = -sizes * np.linalg.lstsq(table * sizes, wanted, rcond=None)[0]
            for share in SHARES:
                trial = x + share * step
                residual = self._residual(trial)
                if cost(residual, trial) < cost(best, x):
                    best, x = residual, trial
                    break
            else:
                break
        freedom = max(len(best) - len(x) - len(self.scale), 1)
        variance = INFLATION**2 * float(best @ best) / freedom
        covariance = variance * np.linalg.inv(slopes.T @ slopes + pull.T @ pull)
        return x, float(np.sqrt(np.mean(best**2))), np.sqrt(np.diag(covariance))

    def _residual(self, x: Array) -> Array:
        """Return (N,) read − predicted in spreads, minus the mean of each output.

        Samples without equilibrium count as `WITHOUT`.
        """
        pitch, roll, drive, weight = x[:4]
        masses = x[4:] if len(x) > 4 else None
        inputs = partial(_hung, drive, weight, self.of_run, masses)
        tilt = exp_map(np.array([roll, pitch, 0.0]))
        one = Correction("payload", (), "", "", inputs=inputs, model=partial(_tilted, tilt, weight))
        predicted = self.model.predict([one])
        return np.concatenate([self._output_error(name, predicted[name]) for name in self.model.readings])

    def _output_error(self, name: str, predicted: Array) -> Array:
        read = self.model.readings[name]
        there = np.isfinite(read)
        error = (read - predicted)[there] / self.scale[name]
        lost = ~np.isfinite(error)
        mean = float(np.mean(error[~lost])) if not lost.all() else 0.0
        return np.where(lost, WITHOUT, error - mean)

    def _slopes(self, x: Array, here: Array) -> Array:
        steps = np.concatenate([self.steps, np.full(len(x) - 4, STEP_KG)])
        columns = []
        for k, step in enumerate(steps):
            moved = x.copy()
            moved[k] += step
            columns.append((self._residual(moved) - here) / step)
        return np.column_stack(columns)


def _tilted(tilt: Array, weight: float, model: Model) -> Model:
    chain = model.chain
    gravity = weight * np.asarray(chain.gravity_m_s2)
    return model.with_(chain=chain.with_(base_rotation=tilt @ chain.base_rotation, gravity_m_s2=gravity))


def _hung(
    drive: float, weight: float, of_run: Mapping[str, int], masses: Array | None, history: History
) -> History:
    """Return the history with scaled drive and loads; both factors together are equivalent to a stiffness."""
    history = history.with_(
        actuation={name: drive * values for name, values in history.actuation.items()},
        moment_n_m=weight * history.moment_n_m,
        tip_force_n=weight * history.tip_force_n,
    )
    if masses is None or history.run not in of_run:
        return history
    return history.with_(payload_kg=np.full(len(history), masses[of_run[history.run]]))


def _groups(histories: Sequence[History]) -> list[tuple[tuple[str, ...], float]]:
    """Return runs with one constant payload each, (names, kg): one run per group if they are few, else by label."""
    stated = {
        history.run: float(history.payload_kg[0])
        for history in histories
        if history.payload_kg is not None and np.ptp(history.payload_kg) == 0.0
    }
    if len(stated) <= MOST_GROUPS:
        return [((run,), mass) for run, mass in stated.items()]
    labels: dict[float, list[str]] = {}
    for run, mass in stated.items():
        labels.setdefault(mass, []).append(run)
    return [(tuple(runs), mass) for mass, runs in labels.items()] if len(labels) <= MOST_GROUPS else []


def _merged(wrong: Sequence[Hung], hung: Sequence[Hung]) -> list[Hung]:
    """Return the runs of one label merged if all of them are off by the same mass."""
    found: list[Hung] = []
    for stated in dict.fromkeys(one.stated_kg for one in wrong):
        mine = [one for one in wrong if one.stated_kg == stated]
        every = [one for one in hung if one.stated_kg == stated]
        masses = np.array([one.mass_kg for one in mine])
        sd = float(np.sqrt(np.mean([one.sd_kg**2 for one in mine])))
        if len(mine) == len(every) and np.ptp(masses) <= max(
            SIGNIFICANT * sd, SHARE * float(masses.max()), LEAST_KG
        ):
            runs = tuple(run for one in mine for run in one.runs)
            found.append(Hung(runs, stated, float(masses.mean()), sd / np.sqrt(len(mine))))
        else:
            found += mine
    return found


def _words(wrong: Sequence[Hung]) -> str:
    unit = display_unit("kg")
    texts = [
        f"{_which(one)} {'behaves' if len(one.runs) == 1 else 'behave'} as if {with_sd(one.mass_kg, one.sd_kg, unit)} "
        "hung there"
        for one in wrong[:MOST_NAMED]
    ]
    more = f", and {plural(len(wrong) - MOST_NAMED, 'more')} likewise" if len(wrong) > MOST_NAMED else ""
    return f"Payloads disagree with their labels: {listed(texts)}{more}{_common(wrong)}."


def _which(one: Hung) -> str:
    label = display_unit("kg").text(one.stated_kg, 4)
    return (
        f"run '{one.runs[0]}' (labelled {label})"
        if len(one.runs) == 1
        else f"the {len(one.runs)} runs labelled {label}"
    )


def _common(wrong: Sequence[Hung]) -> str:
    """Return the clause that one factor, or one added mass, explains all of them; empty if none does."""
    labels = {one.stated_kg for one in wrong}
    loaded = [one for one in wrong if one.stated_kg > 0.0]
    if len(labels) < 2 or len(loaded) != len(wrong):
        return ""
    factors = np.array([one.mass_kg / one.stated_kg for one in loaded])
    added = np.array([one.mass_kg - one.stated_kg for one in loaded])
    if np.ptp(factors) < SHARE * factors.mean():
        return f"; all of them by a factor of {number(float(factors.mean()), 3)}"
    if np.ptp(added) < SHARE * abs(added.mean()) + LEAST_KG:
        return f"; all of them by {display_unit('kg').text(float(added.mean()), 3)}: a hook or a holder"
    return ""


def _scales(readings: ReadingsByName) -> dict[str, float]:
    """Return the spread of each kind of output, shared by its components."""
    squares: dict[str, float] = {}
    for name, values in readings.items():
        kind = NUMBERED.sub("", name)
        squares[kind] = squares.get(kind, 0.0) + float(np.nanvar(values))
    return {name: float(np.sqrt(squares[NUMBERED.sub("", name)])) or 1.0 for name in readings}
