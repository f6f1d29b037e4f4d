"""Histories: inputs of a run over time, and the motion of a chain under them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.rollout import Inputs

REFERENCE_TEMPERATURE_C = 22.0
PRESSURE = re.compile(r"pressure(_\d+)?_pa")
# Columns of a measurement file for the components of `tip_force_n` and `base_angles_rad`.
FORCES = ("tip_force_x_n", "tip_force_y_n", "tip_force_z_n")
BASE = ("base_roll_rad", "base_pitch_rad", "base_yaw_rad")


@dataclass(frozen=True)
class LetGo:
    """Start of a free swing.

    Attributes:
        until_s: the chain is held up to this time; None: only at the first sample.
        bend_rad: sum of the joints' main coordinates while it is held; None: the first reading.
    """

    until_s: float | None = None
    bend_rad: float | None = None


@dataclass(frozen=True, eq=False)
class History:
    """The inputs of one run, sampled at t instants.

    Between samples the inputs are linear. A run starts at rest: healing memory has healed, and the chain has moved
    slowly from its straight shape to the first sample. Permanent memory (`LawTerm.keeps`) continues from the earlier
    runs of the same specimen.

    Attributes:
        run: the run's name.
        specimen: the tested body; runs of one specimen are consecutive in the given order.
        time_s: (t,) increasing; None if every sample is a separate state, reached slowly.
        actuation: (t,) for each input of the chain, Pa, N or m.
        tip_force_n: (t, 3) dead force at the tip, world frame.
        moment_n_m: (t,) end moment that opposes the actuation.
        temperature_c: (t,); `REFERENCE_TEMPERATURE_C` if it was not measured.
        base_angles_rad: (t, 3) about world x, y, z in that order, after the chain's base pose.
        payload_kg: (t,) mass at the tip, instead of the chain's own; None: the chain's.
        valve_open: (t,) 1 while the chambers are connected to their supply, 0 while they are closed off and the
            commanded pressure does not reach them; None if they are always connected. A value applies to the
            step that leads to its sample.
        let_go: the run starts at rest under a holding end moment, which is then removed: a free swing.
        lead: number of initial samples that were prepended to the recorded ones; they have no readings.
    """

    run: str
    specimen: str
    time_s: Array | None
    actuation: Mapping[str, Array]
    tip_force_n: Array
    moment_n_m: Array
    temperature_c: Array
    base_angles_rad: Array
    payload_kg: Array | None = None
    valve_open: Array | None = None
    lead: int = 0
    let_go: LetGo | None = None

    def __len__(self) -> int:
        return len(self.moment_n_m)

    def with_(self, **changes: object) -> History:
        """Return a copy with some fields replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def with_actuation(self, **changes: Array) -> History:
        """Return a copy with some actuations replaced, by name."""
        return replace(self, actuation={**self.actuation, **changes})

    def refined(self, parts: int) -> History:
        """Return the same linear inputs with `parts` samples per step; without a clock, the history itself."""
        if self.time_s is None or parts == 1:
            return self
        samples = np.arange(len(self))
        places = np.linspace(0, len(self) - 1, parts * (len(self) - 1) + 1)

        def between(values: Array) -> Array:
            """Return Interpolate (t, …) to (t', …)."""
            columns = values.reshape(len(self), -1).T
            rows = np.stack([np.interp(places, samples, column) for column in columns], axis=1)
            return np.asarray(rows.reshape(len(places), *values.shape[1:]))

        return replace(
            self,
            time_s=between(self.time_s),
            actuation={name: between(values) for name, values in self.actuation.items()},
            tip_force_n=between(self.tip_force_n),
            moment_n_m=between(self.moment_n_m),
            temperature_c=between(self.temperature_c),
            base_angles_rad=between(self.base_angles_rad),
            payload_kg=None if self.payload_kg is None else between(self.payload_kg),
            # these values of a sample apply to the step that leads to it
            valve_open=None
            if self.valve_open is None
            else self.valve_open[np.ceil(places - 1e-9).astype(int)],
        )

    def at_samples(self, places: NDArray[np.intp]) -> History:
        """Return the history at some of its samples, with ascending indices (k,)."""

        def some(values: Array | None) -> Array | None:
            return None if values is None else values[places]

        return replace(
            self,
            time_s=some(self.time_s),
            actuation={name: values[places] for name, values in self.actuation.items()},
            tip_force_n=self.tip_force_n[places],
            moment_n_m=self.moment_n_m[places],
            temperature_c=self.temperature_c[places],
            base_angles_rad=self.base_angles_rad[places],
            payload_kg=some(self.payload_kg),
            valve_open=some(self.valve_open),
        )

    def signals(self) -> dict[str, Array]:
        """Return (t,) each input, load and condition of the run, by the name of its column in a measurement file."""
        optional = {"payload_kg": self.payload_kg, "valve_open": self.valve_open}
        return {
            **self.actuation,
            "moment_n_m": self.moment_n_m,
            **dict(zip(FORCES, self.tip_force_n.T, strict=True)),
            **{name: values for name, values in optional.items() if values is not None},
            "temperature_c": self.temperature_c,
            **dict(zip(BASE, self.base_angles_rad.T, strict=True)),
        }

    def at(self, index: int) -> Inputs:
        """Return the inputs of one sample."""
        return Inputs(
            {name: float(values[index]) for name, values in self.actuation.items()},
            np.array(self.tip_force_n[index], float),
            float(self.moment_n_m[index]),
        )

    @staticmethod
    def from_arrays(
        actuation: Mapping[str, Any],
        time_s: Array | None = None,
        *,
        run: str = "run",
        specimen: str = "",
        tip_force_n: Any = 0.0,
        moment_n_m: Any = 0.0,
        temperature_c: Any = REFERENCE_TEMPERATURE_C,
        base_angles_rad: Any = 0.0,
        payload_kg: Any = None,
        valve_open: Any = None,
    ) -> History:
        """Return a history from arrays or constants, all extended to the length of the longest array."""
        columns = (*actuation.values(), moment_n_m, temperature_c, payload_kg, valve_open, time_s)
        given = [np.asarray(v, float) for v in columns if v is not None]
        tables = [np.asarray(v, float) for v in (tip_force_n, base_angles_rad)]
        n = max([*(len(v) for v in given if v.ndim), *(len(v) for v in tables if v.ndim == 2), 1])

        def row(value: Any) -> Array:
            return np.broadcast_to(np.asarray(value, float), (n,)).copy()

        def rows(value: Any) -> Array:
            return np.broadcast_to(np.asarray(value, float), (n, 3)).copy()

        return History(
            run=run,
            specimen=specimen,
            time_s=None if time_s is None else np.asarray(time_s, float),
            actuation={name: row(value) for name, value in actuation.items()},
            tip_force_n=rows(tip_force_n),
            moment_n_m=row(moment_n_m),
            temperature_c=row(temperature_c),
            base_angles_rad=rows(base_angles_rad),
            payload_kg=None if payload_kg is None else row(payload_kg),
            valve_open=None if valve_open is None else row(valve_open),
        )


def held(history: History) -> History:
    """Return the history of the chamber pressures: closed chambers keep the pressure at which the valve closed.

    That is the commanded pressure of the last sample with an open valve, or the first one of a run that starts closed.
    Tendons have no valve.
    """
    if history.valve_open is None or bool(np.all(history.valve_open != 0.0)):
        return history
    last_open = np.maximum.accumulate(np.where(history.valve_open != 0.0, np.arange(len(history)), 0))
    kept = {n: values[last_open] for n, values in history.actuation.items() if PRESSURE.fullmatch(n)}
    return history.with_actuation(**kept)


def run_by_run(values: NDArray[Any], histories: Sequence[History]) -> list[NDArray[Any]]:
    """Split concatenated rows (N, …) of all histories into views of each one's (t, …)."""
    ends = np.cumsum([len(history) for history in histories]).tolist()
    return [values[start:end] for start, end in zip([0, *ends], ends, strict=False)]


@dataclass(frozen=True, eq=False)
class Followed:
    """Motion of a chain under one history.

    Attributes:
        joint_angles: (t, n, a) joint coordinates.
        converged: (t,) whether an equilibrium was reached at that sample.
    """

    joint_angles: Array
    converged: NDArray[np.bool_]
