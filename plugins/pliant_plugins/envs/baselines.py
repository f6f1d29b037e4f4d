"""Baseline controllers without learning for `pliant/Reach-v0` and `pliant/Track-v0`.

All know the nominal model's equilibria and what a bench measures, never the episode's own robot. Several may share one
`model`, which remembers the places that were aimed at.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from pliant.inverse.statics import InverseStatics
from pliant.inverse.target import Target
from pliant.records.design import Array
from pliant.records.rollout import Inputs, Response
from pliant_plugins.envs.control import MeasuredEnv

POINTS = 65  # of what reaches the chain, over the range of an input
DAMPING = 1e-3  # of the pseudo-inverse, in shares of the chain's length


class Controller(Protocol):
    """A controller for `score`."""

    def begin(self, info: Mapping[str, Any]) -> None:
        """Start an episode, of which `info` is that of `reset`."""

    def act(self, info: Mapping[str, Any]) -> Array:
        """Return the (k,) next action, from the `info` of the last step."""


class Aim(NamedTuple):
    """The inverse statics of a place of the tip: shares (k,), and how shares follow the tip there, (k, 3) per m."""

    shares: Array
    per_m: Array


class Nominal:
    """The nominal model's equilibria as functions of the shares of the actuation, and the inverse from a position of
    the tip.

    Lags and memory are not included. Monotone maps of single inputs are.
    """

    def __init__(self, env: MeasuredEnv) -> None:
        self.inputs = env.inputs
        shares = np.linspace(0.0, 1.0, POINTS)
        acting = [env.reaching(name, shares * top) for name, top in zip(env.inputs, env.highest, strict=True)]
        self._shares, self._acting = shares, np.maximum.accumulate(np.array(acting), axis=1)
        bounds = {
            name: (float(row[0]), float(row[-1])) for name, row in zip(env.inputs, self._acting, strict=True)
        }
        self._inverse = InverseStatics(env.equilibria(), bounds)
        self._order = [self._inverse.inputs.index(name) for name in env.inputs]
        self._damping, self._aims = (DAMPING * env.chain.length_m) ** 2, dict[bytes, Aim]()

    @cached_property
    def _tips(self) -> Array:
        """(POINTS, 3) of one input: places of the tip at even shares."""
        return np.array([self._response(np.array([share])).markers_m[-1] for share in self._shares])

    def shares(self, tip_m: Array) -> Array:
        """Return (k,) shares of the actuation for a tip position, or the closest; of one input by interpolation."""
        if len(self.inputs) == 1:
            begins, spans = self._tips[:-1], np.diff(self._tips, axis=0)
            square = np.maximum(np.sum(spans**2, axis=1), 1e-30)
            along = np.clip(np.sum((tip_m - begins) * spans, axis=1) / square, 0.0, 1.0)
            k = int(np.argmin(np.linalg.norm(begins + along[:, None] * spans - tip_m, axis=1)))
            return np.array([(k + along[k]) / (POINTS - 1)])
        found = self._inverse.solve(Target(tip_m=tip_m)).actuation
        pairs = zip(self.inputs, self._acting, strict=True)
        return np.array([np.interp(found[name], row, self._shares) for name, row in pairs])

    def aim(self, tip_m: Array) -> Aim:
        """Return the shares for a position and their slopes by damped least squares; positions are cached."""
        key = np.asarray(tip_m, float).tobytes()
        if key not in self._aims:
            shares = self.shares(np.asarray(tip_m, float))
            slopes = self.tip_slopes(shares)
            square = slopes.T @ slopes + self._damping * np.eye(len(shares))
            self._aims[key] = Aim(shares, np.asarray(np.linalg.solve(square, slopes.T), float))
        return self._aims[key]

    def tip_m(self, shares: Array) -> Array:
        """Return the (3,) settled position of the tip."""
        if len(self.inputs) == 1:
            return np.array([np.interp(shares[0], self._shares, column) for column in self._tips.T])
        return np.asarray(self._response(shares).markers_m[-1])

    def tip_slopes(self, shares: Array) -> Array:
        """Return (3, k) derivatives of the tip by the shares, by mean slopes of the input maps."""
        if len(self.inputs) == 1:
            slopes = np.gradient(self._tips, self._shares, axis=0)
            return np.array([[np.interp(shares[0], self._shares, column)] for column in slopes.T])
        slopes = np.asarray(self._response(shares).by_input)[self._order, -1]
        return (slopes * np.ptp(self._acting, axis=1)[:, None]).T

    def _response(self, shares: Array) -> Response:
        pairs = zip(self.inputs, shares.tolist(), self._acting, strict=True)
        values = {name: float(np.interp(share, self._shares, row)) for name, share, row in pairs}
        return self._inverse.simulation.respond(Inputs(values))


def _aim(info: Mapping[str, Any]) -> Array:
    """Return (3,) the target of the tip at the end of the next step."""
    return np.asarray(info["ahead_m"][0] if "ahead_m" in info else info["target_m"])


class OpenLoop:
    """Inverse statics of the nominal model, without feedback."""

    def __init__(self, env: MeasuredEnv, model: Nominal | None = None) -> None:
        self._model = model or Nominal(env)

    def begin(self, info: Mapping[str, Any]) -> None:
        """Do nothing: this baseline has no state."""

    def act(self, info: Mapping[str, Any]) -> Array:
        return 2.0 * self._model.aim(_aim(info)).shares - 1.0


class ProportionalIntegral:
    """PI control of the measured tip: the error is mapped to the inputs by the nominal slopes, damped least squares.

    Gains are per control step: `proportional`, `integral`. The integral stops where an input is at its limit.
    """

    def __init__(
        self,
        env: MeasuredEnv,
        proportional: float = 0.5,
        integral: float = 0.3,
        model: Nominal | None = None,
    ) -> None:
        self._model, self._gains = model or Nominal(env), (proportional, integral)
        self._damping = (DAMPING * env.chain.length_m) ** 2
        self._sum = np.zeros(len(env.inputs))

    def begin(self, info: Mapping[str, Any]) -> None:
        self._sum = np.zeros_like(self._sum)

    def act(self, info: Mapping[str, Any]) -> Array:
        at = np.clip(self._sum, 0.0, 1.0)
        slopes = self._model.tip_slopes(at)
        error = np.asarray(info["target_m"]) - info["measured_tip_m"]
        square = slopes.T @ slopes + self._damping * np.eye(len(at))
        move = np.linalg.solve(square, slopes.T @ error)
        proportional, integral = self._gains
        self._sum = np.clip(self._sum + integral * move, 0.0, 1.0)
        return 2.0 * np.clip(self._sum + proportional * move, 0.0, 1.0) - 1.0


class Predictive:
    """Model predictive control with the quasi-static model, free of offset.

    The nominal equilibria have no memory, so that the best inputs of a horizon are those of each of its steps, and only
    the first is needed: the inverse statics of the next target less what the model misses by. That is estimated as
    measured tip − model's tip at the command `lag` steps before what is seen, smoothed by `trust` per step (Pannocchia
    & Rawlings, AIChE J. 49, 2003).
    """

    def __init__(
        self, env: MeasuredEnv, trust: float = 0.1, lag: int = 1, model: Nominal | None = None
    ) -> None:
        self._model, self._trust = model or Nominal(env), trust
        self._none = np.zeros(len(env.inputs))
        self._missed, self._past = np.zeros(3), deque[Array](maxlen=1 + lag + env.late)

    def begin(self, info: Mapping[str, Any]) -> None:
        self._missed = np.zeros(3)
        self._past.clear()
        self._past.append(self._none)

    def act(self, info: Mapping[str, Any]) -> Array:
        expected = self._model.tip_m(self._past[0])
        self._missed += self._trust * (info["measured_tip_m"] - expected - self._missed)
        if len(self._none) == 1:
            wanted = self._model.shares(_aim(info) - self._missed)
        else:  # to first order: a place off those that can be reached takes every start of the inverse statics
            aim = self._model.aim(_aim(info))
            wanted = aim.shares - aim.per_m @ self._missed
        shares = np.clip(wanted, 0.0, 1.0)
        self._past.append(shares)
        return 2.0 * shares - 1.0


BASELINES = {"open loop": OpenLoop, "PI": ProportionalIntegral, "MPC": Predictive}


def score(env: Any, controller: Controller, seeds: range, *, skip: int = 0, **options: Any) -> Array:
    """Return (len(seeds),) RMS distances of tip and target in each episode, m, after `skip` steps."""
    errors = []
    for seed in seeds:
        _, info = env.reset(seed=seed, options=options)
        controller.begin(info)
        squares, over = [], False
        while not over:
            _, _, ended, truncated, info = env.step(controller.act(info).astype(np.float32))
            over = ended or truncated
            squares.append(info["error_m"] ** 2 if "error_m" in info else np.inf)
        errors.append(float(np.sqrt(np.mean(squares[skip:] or squares))))
    return np.array(errors)
