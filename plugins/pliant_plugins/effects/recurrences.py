"""Recurrences over the samples of a run, compiled: what a step leaves depends on what the last one left.

Import it where it is called: numba takes half a second to import.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Below this share of the law's largest pressure a power law is smooth.
SMALL_SHARE = 1e-3


@njit(cache=True, error_model="numpy")
def accumulated(kept, added):  # type: ignore[no-untyped-def]
    """d (t,) at every sample, from 0: each step keeps a share of it (t − 1,) and adds to it (t − 1,)."""
    distances = np.zeros(len(kept) + 1)
    for k in range(len(kept)):
        distances[k + 1] = kept[k] * distances[k] + added[k]
    return distances


@njit(cache=True, error_model="numpy")
def distances_of_two(change, steps, kept, added, kept_above, added_above, rising_s, falling_s):  # type: ignore[no-untyped-def]
    """d (t,) with one time below the values and another above them; where they met: steps (m,), times since (m,), s."""
    n = len(change)
    distances, met, since = np.zeros(n + 1), np.zeros(n, np.int64), np.zeros(n)
    count, d = 0, 0.0
    for k in range(n):
        moved, step = change[k], steps[k]
        above = d > 0.0 or (d == 0.0 and moved < 0.0)
        after = kept_above[k] * d + added_above[k] if above else kept[k] * d + added[k]
        if d * after < 0.0 and kept[k] < 1.0:
            before_s, after_s = (falling_s, rising_s) if above else (rising_s, falling_s)
            reached = min(before_s * math.log1p(d * step / (before_s * moved)), step)
            met[count], since[count] = k, reached
            count += 1
            after = moved * (after_s / step) * math.expm1(-(step - reached) / after_s)
        d = after
        distances[k + 1] = d
    return distances, met[:count], since[:count]


@njit(cache=True, error_model="numpy")
def through_orifice(middle, steps, running, rising_s, falling_s, power, first):  # type: ignore[no-untyped-def]
    """y (t,) from `first` through an orifice, with inputs (t − 1,) that stand at their middle over each step."""
    found, rest = np.empty(len(middle) + 1), 1.0 - power
    found[0] = y = first
    for k in range(len(middle)):
        gap = y - middle[k]
        if running[k] and gap != 0.0:
            left = abs(gap) ** rest - rest * steps[k] / (falling_s if gap > 0.0 else rising_s)
            y = middle[k] + math.copysign(left ** (1.0 / rest) if left > 0.0 else 0.0, gap)
        found[k + 1] = y
    return found


@njit(cache=True, error_model="numpy")
def lacking(pressure, valve, steps, rate_1_s, filling_s, power, full):  # type: ignore[no-untyped-def]
    """d (t,) of a leak at the samples; `full`: the pressure of the stated rate, infinite where the power is 1."""
    found = np.empty(len(pressure))
    rate = rate_1_s
    found[0] = rate * filling_s / (1.0 + rate * filling_s) * pressure[0]
    for k in range(1, len(pressure)):
        start, end, step = pressure[k - 1], pressure[k], steps[k - 1]
        slope = (end - start) / step
        if power != 1.0 and math.isfinite(
            full
        ):  # the rate at the pressure that is there when the step begins
            there = max(abs(start - found[k - 1]) / full, SMALL_SHARE)
            rate = rate_1_s * there ** (power - 1.0)
        total = rate + (1.0 / filling_s if valve[k] != 0.0 else 0.0)
        share = rate / total
        settling = found[k - 1] - share * (start - slope / total)
        found[k] = share * (end - slope / total) + settling * math.exp(-total * step)
    return found
