"""The law of a network: derivatives, energy, symmetry, its continuation outside its box, its compiled form."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from tests.surrogates.laws import PRESSURE_PA

from pliant.records.law import Domain
from pliant_plugins.surrogates.neural.law import NeuralLaw
from pliant_plugins.surrogates.neural.network import Network


def test_a_law_that_softens_with_pressure_keeps_its_stiffness() -> None:
    """A unit softens with p: the bare network would become unstable outside the box."""
    network = Network(
        np.array([[1 / 1.5e4, 4.0], [1 / 1.5e4, -4.0]]), np.array([-2.0, -2.0]), np.array([-1.3e-3, -1.3e-3]),
        np.zeros(1), np.array([1e-6]), np.array([[0.04]]),
    )  # fmt: skip
    law = NeuralLaw(network, Domain(np.array([0.0, PRESSURE_PA]), np.array([[-0.2, 0.4]])))
    bare = network.efforts(np.array([[2 * PRESSURE_PA, 0.0]]))[2]
    assert law.outside.largest_slope < 0 < bare[0, 0, 0]
    p = np.linspace(-5 * PRESSURE_PA, 6 * PRESSURE_PA, 50)
    for angle in np.linspace(-2, 2, 9):
        assert law.evaluate(p, np.full((50, 1), angle)).dtau_du.max() < 0


def test_without_torch_laws_are_loaded_and_a_fit_names_the_install_command() -> None:
    code = (
        "import sys\n"
        "class WithoutTorch:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.partition('.')[0] == 'torch':\n"
        "            raise ModuleNotFoundError(name)\n"
        "sys.meta_path.insert(0, WithoutTorch())\n"
        "import numpy as np\n"
        "from pliant_plugins.surrogates.config import NeuralConfig\n"
        "from pliant_plugins.manifest import pliant_components\n"
        "from pliant_plugins.surrogates.neural.network import Network\n"
        "from pliant_plugins.surrogates.neural.law import NeuralLaw\n"
        "from pliant.records.law import Domain\n"
        "from pliant.errors import MissingDependencyError\n"
        "from pliant.testing.samples import softening_law, sample_table\n"
        "net = Network(np.ones((3, 2)), np.ones(3), 1e-3 * np.ones(3), np.ones(1), np.ones(1), np.eye(1))\n"
        "law = NeuralLaw(net, Domain(np.array([0.0, 1.0]), np.array([[-1.0, 1.0]])))\n"
        "pick = [c for c in pliant_components() if (c.interface, c.kind) == ('surrogate', 'neural')]\n"
        "neural = pick[0].build(NeuralConfig())\n"
        "again = neural.load(law.record())\n"
        "assert again.evaluate(np.zeros(1), np.zeros((1, 1))).tau[0, 0] < 1\n"
        "assert again.scalar() is not None\n"
        "assert pick[0].missing() is None and pick[0].missing(lazy=True) == 'torch'\n"
        "try:\n"
        "    neural.fit(sample_table(softening_law()))\n"
        "except MissingDependencyError as error:\n"
        "    assert \"pip install 'pliant[neural]'\" in str(error), error\n"
        "else:\n"
        "    raise SystemExit('it was fitted without torch')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
