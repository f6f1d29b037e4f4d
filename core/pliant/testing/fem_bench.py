"""The solver under test: a backend with the sample solid or, where it has no such law, a neo-Hookean one."""

from __future__ import annotations

from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.fem import FEMBackend, ModuleSolver
from pliant.interfaces.material import Material
from pliant.records.fem import ModuleProblem
from pliant.registry.discovery import discover
from pliant.testing.stand_ins import sample_material
from pliant.testing.suite import Subject


def sample_solver(subject: Subject, problem: ModuleProblem) -> ModuleSolver:
    """A new solver of this problem.

    A backend that hands the law to another program by its name may refuse the sample solid, whose name nobody
    knows; it is then given `neo_hookean` with the same moduli at small strain.
    """
    backend: FEMBackend = subject.build()
    try:
        return backend.solver(problem, sample_material())
    except MissingDependencyError:
        raise
    except UserError:
        return backend.solver(problem, _named_material())


def _named_material() -> Material:
    sample = sample_material()
    registry = discover()
    moduli = {"shear_modulus_pa": sample.shear_modulus_pa, "poisson_ratio": sample.poisson}
    model = registry.get("material", "neo_hookean").config_model()
    named: Material = registry.build("material", model.model_validate({"kind": "neo_hookean", **moduli}))
    return named
