"""Finite-element solvers of a module of neo-Hookean rubber."""

from pliant.records.fem import ModuleProblem
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig


def rubber(mu: float, **more: float) -> NeoHookean:
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=mu, **more))


def make_solver(problem: ModuleProblem, material: NeoHookean) -> SkfemSolver:
    limits = {"pressure_max_pa": 15e3} if problem.actuation == "pressure_pa" else {"tendon_force_max_n": 8.0}
    return Skfem(SkfemConfig.model_validate(limits)).solver(problem, material)
