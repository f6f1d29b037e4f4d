"""Compiled recurrences over the samples of a run: the state after a step depends on that after the last one.

Import it where it is called: numba takes half a second to import.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Below this share of the law's largest pressure a power law is smooth.
SMALL_SHARE = 1e-3


@njit(cache=True, error_model="numpy")
def lagging(change, steps, flows, rising_s, falling_s):  # type: ignore[no-untyped-def]
    """Return d (t,) of one stage from 0, given each step's (t − 1,) change of input and whether anything flows."""
    found = np.zeros(len(change) + 1)
    for k in range(len(change)):
        d = found[k]
        found[k + 1] = _stage(d, change[k], steps[k], rising_s, falling_s)[0] if flows[k] else d - change[k]
    return found


@njit(cache=True, error_model="numpy")
def lagging_twice(change, steps, flows, rising_s, falling_s, second_s):  # type: ignore[no-untyped-def]
    """Return w (t,) after two stages from 0; steps in which the first one's time changes are two pieces."""
    found = np.zeros(len(change) + 1)
    d = w = 0.0
    for k in range(len(change)):
        moved, step = change[k], steps[k]
        if not flows[k]:
            d, w = d - moved, w - moved
        else:
            after, met = _stage(d, moved, step, rising_s, falling_s)
            if met < step:
                before = moved * met / step
                w = _second_stage(w, d, before, met, rising_s, falling_s, second_s)
                w = _second_stage(w, 0.0, moved - before, step - met, rising_s, falling_s, second_s)
            else:
                w = _second_stage(w, d, moved, step, rising_s, falling_s, second_s)
            d = after
        found[k + 1] = w
    return found


@njit(cache=True, error_model="numpy")
def _stage(d, moved, step, rising_s, falling_s):  # type: ignore[no-untyped-def]
    """Return d after one step and the time at which y met u and the time constant changed, else `step`."""
    above = d > 0.0 or (d == 0.0 and moved < 0.0)
    now_s, then_s = (falling_s, rising_s) if above else (rising_s, falling_s)
    kept = math.exp(-step / now_s)
    after = kept * d - _mean(step / now_s) * moved
    if (d < 0.0 < after or after < 0.0 < d) and kept < 1.0 and now_s != then_s:
        met = min(now_s * math.log1p(d * step / (now_s * moved)), step)
        return moved * (then_s / step) * math.expm1(-(step - met) / then_s), met
    return after, step


@njit(cache=True, error_model="numpy")
def _second_stage(w, d, moved, step, rising_s, falling_s, second_s):  # type: ignore[no-untyped-def]
    """Return w after a piece in which the first stage, d away at its start, has one time constant."""
    above = d > 0.0 or (d == 0.0 and moved < 0.0)
    ratio = (falling_s if above else rising_s) / second_s
    two = step / second_s
    one = two / ratio
    mixed = math.exp(-min(one, two)) * _mean(abs(two - one))
    return math.exp(-two) * w + two * mixed * d + moved * (ratio * mixed - (1.0 + ratio) * _mean(two))


@njit(cache=True, error_model="numpy")
def _mean(x):  # type: ignore[no-untyped-def]
    """Return (1 − e^(−x)) / x, the mean of e^(−t) over [0, x]."""
    return -math.expm1(-x) / x if x > 0.0 else 1.0


@njit(cache=True, error_model="numpy")
def through_orifice(middle, steps, running, rising_s, falling_s, power, first):  # type: ignore[no-untyped-def]
    """Return y (t,) from `first` through an orifice, with inputs (t − 1,) constant at their mean over each step."""
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
    """Return d (t,) of a leak; `full` is the pressure of the stated rate, infinite for a power of 1."""
    found = np.empty(len(pressure))
    rate = rate_1_s
    found[0] = rate * filling_s / (1.0 + rate * filling_s) * pressure[0]
    for k in range(1, len(pressure)):
        start, end, step = pressure[k - 1], pressure[k], steps[k - 1]
        slope = (end - start) / step
        if power != 1.0 and math.isfinite(full):  # the rate at the pressure at the start of the step
            there = max(abs(start - found[k - 1]) / full, SMALL_SHARE)
            rate = rate_1_s * there ** (power - 1.0)
        total = rate + (1.0 / filling_s if valve[k] != 0.0 else 0.0)
        share = rate / total
        settling = found[k - 1] - share * (start - slope / total)
        found[k] = share * (end - slope / total) + settling * math.exp(-total * step)
    return found


@njit(cache=True, error_model="numpy")
def behind_play(angle, half):  # type: ignore[no-untyped-def]
    """Apply the play operator to angles (t,): the output is constant while the angle is within `half` the clearance."""
    found = np.empty(len(angle))
    held = angle[0] if len(angle) else 0.0
    for k in range(len(angle)):
        if held < angle[k] - half:
            held = angle[k] - half
        elif held > angle[k] + half:
            held = angle[k] + half
        found[k] = held
    return found
