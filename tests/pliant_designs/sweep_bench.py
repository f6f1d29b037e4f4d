"""Sweeps of springs, for tests: a study to write, a log of solved states to read."""

from collections import Counter
from pathlib import Path

import numpy as np

from pliant import api

PLUGIN = Path(__file__).parent / "springs_plugin.py"
STUDY = f"""\
pliant: 1
name: springs
plugins: ['{PLUGIN}']
family: {{kind: springs, radius: 5 mm, length: 9 mm}}
material: {{kind: neo_hookean, shear_modulus: 240 kPa}}
fem: {{kind: springs_fem, pressure_max: 15 kPa, sampling: grid, pressures: 2, angles: 3, check_states: 1}}
"""


def study(folder, sweep, more=""):
    """Return the path of a study with this sweep."""
    path = folder / "springs.yaml"
    path.write_text(f"{STUDY}sweep: {sweep}\n{more}")
    return path


def opened(folder, sweep, *overrides, store="store", **others):
    """Return the study, opened with a store in the folder."""
    return api.open_study(study(folder, sweep), overrides, store=folder / store, **others)


def table(run):
    """Return every number of every design, for comparison bit by bit."""
    return {
        o.design.number: np.concatenate(
            [
                getattr(o.data(), name).ravel()
                for name in ("actuation", "deformation", "tau", "dtau_du", "energy_j")
            ]
        )
        for o in run.done()
    }


def same(one, other):
    """Return whether two sweeps have the same data, bit for bit."""
    return one.keys() == other.keys() and all(np.array_equal(one[n], other[n]) for n in one)


def statuses(run):
    """Return the statuses of the outcomes by design number."""
    return [outcome.status for outcome in run.outcomes]


def solved(log):
    """Count the finished solutions of each state."""
    lines = Path(log).read_text().splitlines() if Path(log).exists() else []
    words = [line.split(maxsplit=2) for line in lines]
    return Counter(state for what, _, state in words if what == "end")


def solved_again(log):
    """Return the states that were solved more than once: each interrupted worker may repeat its unwritten one."""
    counts = solved(log)
    assert set(counts.values()) <= {1, 2}
    return [state for state, n in counts.items() if n > 1]


def pids(log):
    """Return the ids of the processes that solved."""
    return {line.split()[1] for line in Path(log).read_text().splitlines()}
