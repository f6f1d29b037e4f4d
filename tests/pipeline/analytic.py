"""Sampled modules whose potential is a sum of products of elementary functions, so that every derivative is exact."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import product

import numpy as np

from pliant.execution.progress import Silent
from pliant.interfaces.fem import FemConfig, ModuleSolver, StateNotConvergedError
from pliant.pipeline.sampling.plan import Sampling, sample
from pliant.pipeline.sampling.walk import Subproblem
from pliant.records.fem import FemState

Function = Callable[[float, int], float]  # of x and the order of the derivative


def power(n: int) -> Function:
    return lambda x, k: 0.0 if k > n else math.perm(n, k) * x ** (n - k)


def sine(a: float, phase: float = 0.0) -> Function:
    return lambda x, k: a**k * math.sin(a * x + phase + k * math.pi / 2)


def growth(a: float) -> Function:
    return lambda x, k: a**k * math.exp(a * x)


class Potential:
    """The potential Π(p, u) = Σ c Π_d f_d(x_d), x = (p, u_1 … u_k)."""

    def __init__(self, *terms: tuple[float, tuple[Function, ...]]) -> None:
        self.terms = terms

    def derivative(self, x: np.ndarray, orders: tuple[int, ...]) -> float:
        return sum(
            c * math.prod(f(v, k) for f, v, k in zip(functions, x, orders, strict=True))
            for c, functions in self.terms
        )

    def law(self, p: float, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return τ (k,), ∂τ/∂p (k,), ∂τ/∂u (k, k)."""
        x, k = np.concatenate([[p], u]), len(u)
        unit = np.eye(k + 1, dtype=int)
        tau = np.array([-self.derivative(x, tuple(unit[1 + i])) for i in range(k)])
        by_p = np.array([-self.derivative(x, tuple(unit[0] + unit[1 + i])) for i in range(k)])
        by_u = np.zeros((k, k))
        for i, j in product(range(k), repeat=2):
            by_u[i, j] = -self.derivative(x, tuple(unit[1 + i] + unit[1 + j]))
        return tau, by_p, by_u


class Analytic(ModuleSolver):
    """A solver of a potential that counts its states, and stops or refuses where the test requires it."""

    def __init__(
        self,
        potential: Potential,
        axes: tuple[str, ...] = ("y",),
        main: str = "y",
        refuse: Callable[[float, np.ndarray], bool] = lambda p, u: False,
        touches: Callable[[float, np.ndarray], bool] = lambda p, u: False,
        stop_after: int = 10**9,
    ) -> None:
        self.potential, self.axes, self.main = potential, axes, axes.index(main)
        self.refuse, self.touches, self.stop_after = refuse, touches, stop_after
        self.solved: list[tuple[float, ...]] = []
        self.refused: list[tuple[float, ...]] = []

    def rest(self) -> FemState:
        return self._state(0.0, np.zeros(len(self.axes)), ())

    def free(self, actuation: float, start: FemState) -> FemState:
        return self._solve(actuation, {}, start)

    def constrained(self, actuation, held, start) -> FemState:
        named = held if isinstance(held, Mapping) else {self.axes[self.main]: held}
        return self._solve(actuation, named, start)

    def deformed_nodes(self, state: FemState) -> np.ndarray:
        return np.zeros((1, 3))

    def _solve(self, p: float, held: Mapping[str, float], start: FemState) -> FemState:
        u = np.array(start.deformation, dtype=float)
        for axis, value in held.items():
            u[self.axes.index(axis)] = value
        free = [i for i, axis in enumerate(self.axes) if axis not in held]
        for _ in range(50):
            tau, _, K = self.potential.law(p, u)
            step = -np.linalg.solve(K[np.ix_(free, free)], tau[free]) if free else np.zeros(0)
            u[free] += np.clip(step, -0.3, 0.3)
            if np.all(np.abs(step) < 1e-14):
                break
        return self._state(p, u, tuple(held))

    def _state(self, p: float, u: np.ndarray, held: tuple[str, ...]) -> FemState:
        if len(self.solved) >= self.stop_after:
            raise KeyboardInterrupt
        if self.refuse(p, u):
            self.refused.append((p, *u))
            raise StateNotConvergedError("Newton stopped")
        self.solved.append((p, *u))
        tau, by_p, by_u = self.potential.law(p, u)
        return FemState(
            p,
            u.copy(),
            tau,
            by_p,
            by_u,
            energy_j=0.0,
            travel=0.0,
            axial_strain=0.0,
            branch="constrained" if held else "free",
            status="self_contact" if self.touches(p, u) else "ok",
            iterations=3,
            wall_s=0.5,
            main=self.main,
            held=held,
            solution=np.array([p, *u]),
        )


def bellow(seed: int = 0) -> Potential:
    """Return a bellow-like law of one axis, p up to 1: a stiffening spring, a gain that falls with u, a ripple."""
    random = np.random.default_rng(seed)
    gain, softening, stiff, rate, wave = random.uniform([0.8, 0.3, 0.5, -1.0, 1.0], [1.2, 0.9, 2.0, 1.0, 4.0])
    return Potential(
        (1.0, (power(0), power(2))),
        (stiff / 4, (power(0), power(4))),
        (-gain, (power(1), power(1))),
        (gain * softening / 2, (power(1), power(2))),
        (0.15, (growth(rate), sine(0.7, 0.3))),
        (-0.15, (power(0), sine(0.7, 0.3))),
        (0.02, (power(1), sine(wave, seed))),
    )


def helix(coupled: float = 0.4, one_sided: float = 0.0) -> Potential:
    """Return axes x, y, z with y actuated; lateral stiffness grows with u_y and p; `one_sided` breaks the symmetry."""
    one, p = power(0), power(1)
    return Potential(
        (0.5, (one, one, power(2), one)),
        (0.1, (one, one, power(4), one)),
        (-0.6, (p, one, sine(0.9), one)),
        (0.35, (one, power(2), one, one)),
        (0.6, (one, one, one, power(2))),
        (0.2, (one, one, one, power(4))),
        (coupled / 2, (one, one, power(1), power(2))),
        (0.1, (p, power(2), one, one)),
        (0.15, (one, power(1), power(1), power(1))),
        (one_sided, (p, one, one, power(3))),
    )


def line(stiffness: float, gain: float = 1.0) -> Potential:
    """Return τ = gain · p − stiffness · u."""
    return Potential((stiffness / 2, (power(0), power(2))), (-gain, (power(1), power(1))))


class Counting(Silent):
    """A progress bar whose total is never below its count, with its notes."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def begin(self, title, total, done=0):
        self.total, self.count = total, done
        return self

    def advance(self, steps=1):
        self.count += steps

    def expect(self, total):
        self.total = total
        assert total >= self.count

    def note(self, text):
        self.notes.append(text)


def config(**changes: object) -> FemConfig:
    settings = {"kind": "any", "pressure_max_pa": 1.0, "error": 1e-3, "check_states": 4, **changes}
    return FemConfig.model_validate(settings)


def sampled(solver, folder, progress=None, loads=None, limits=(-math.inf, math.inf), **changes) -> Sampling:
    """Return the sampling of one axis by this solver."""
    folder.mkdir(exist_ok=True)
    settings = config(**changes)
    piece = Subproblem("main", solver, ("y",), "y", limits)
    return sample([piece], settings, settings.pressure_max_pa, folder, progress or Silent(), loads)


def full_and_main(potential: Potential, folder, stop_after=10**9, loads=None, **changes):
    """Return the sampling of `helix`-like modules of three axes, and the solvers of the main and the full piece."""
    folder.mkdir(exist_ok=True)
    # The main axis alone, the others at zero.
    alone = ((c * f[1](0.0, 0) * f[3](0.0, 0), (f[0], f[2])) for c, f in potential.terms)
    main, full = Analytic(Potential(*alone)), Analytic(potential, ("x", "y", "z"), stop_after=stop_after)
    pieces = [Subproblem("main", main, ("y",), "y"), Subproblem("full", full, ("x", "y", "z"), "y")]
    settings = {"kind": "any", "pressure_max_pa": 1.0, "error": 2e-3, **changes}
    done = sample(pieces, FemConfig.model_validate(settings), 1.0, folder, Silent(), loads)
    return done, main, full
