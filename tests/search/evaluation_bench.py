"""Studies whose searches take milliseconds, for tests of the evaluator and of scenarios."""

import numpy as np
from tests.pliant_designs import meta_bench

from pliant import api
from pliant_search.problem.search_problem import SearchProblem

# One hinge without weight: it turns by k_n p / b_e, 0.05 rad per kPa.
GAIN, STIFFNESS = 2e-6, 0.04
HINGE = """\
pliant: 1
name: hinge
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 2e-6, m_a: 0, b_a: 0, m_e: 0, b_e: 0.04}}
chain: {modules: 1, module_length: 10 mm, module_mass: 1 g, gravity: [0, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 10 kPa, steps: 1}
"""
BENDING = meta_bench.UNSEEN.replace("task: {kind: free_bending, pressure: 10 kPa}", "TASK")
SPATIAL = """\
pliant: 1
name: spatial
surrogate:
  kind: polynomial
  axes:
    y: {form: study, coefficients: {k_n: 2.4e-7, m_a: -8.9e-8, b_a: 0, m_e: 8.2e-3, b_e: 6.6e-3}}
    x: {form: study, odd: true, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: 0.03}}
    z: {form: study, odd: true, coefficients: {k_n: 0, m_a: 0, m_e: 0.01, b_e: 0.015}}
chain:
  base: {direction: [0.88, 0, -0.47]}
  module_offset: 3 mm
  module_radius: 10 mm
  segments:
    - {modules: 3, rotation: 0, module_length: 4.7 mm, module_mass: 0.87 g}
    - {modules: 3, rotation: 0.85, module_length: 4.8 mm, module_mass: 0.89 g}
    - {rigid: {length: 6 mm, radius: 4 mm, mass: 0.3 g}}
physics: quasistatic
task: {kind: follow_shape, pressure: 12 kPa, steps: 3, target: {radius: 18 mm, height: 60 mm}, alignment: roll}
"""


def opened(folder, study, search):
    """Return a study with a `search` block, its store in the folder, and its problem."""
    path = folder / "study.yaml"
    path.write_text(f"{study}search:\n{_indented(search)}")
    one = api.open_study(path, store=folder / "store")
    return one, SearchProblem.from_study(one.study, one.context.registry)


def hinge(folder, search, change=("", "")):
    """Return the hinge with a `search` block."""
    return opened(folder, HINGE.replace(*change), search)


def springs(folder, search, task="{kind: free_bending, pressure: 10 kPa}", change=("", "")):
    """Return two springs whose law is the stand-in meta-model's; its table is written once."""
    if not (folder / "fem.csv").exists():
        meta_bench.table(folder)
    text = BENDING.replace("TABLE", str(folder / "fem.csv")).replace("TASK", f"task: {task}").replace(*change)
    return opened(folder, text, search)


def drawn(problem, seed):
    """Return random values of all variables."""
    random = np.random.default_rng(seed)
    found = {}
    for one in problem.variables:
        axis = one.variable
        if axis.type == "categorical":
            found[one.name] = axis.choices[random.integers(len(axis.choices))]
        elif axis.type == "integer":
            found[one.name] = int(random.integers(int(axis.low), int(axis.high) + 1))
        else:
            found[one.name] = float(random.uniform(axis.low, axis.high))
    return found


def _indented(text):
    return "".join(f"  {line}\n" for line in text.strip().splitlines())
