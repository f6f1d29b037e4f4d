"""The law of a network: derivatives, energy, symmetry, what it does outside its box, its compiled form."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain
from pliant_plugins.physics.compiled.laws import law_address
from pliant_plugins.surrogates.neural.law import NeuralLaw
from pliant_plugins.surrogates.neural.network import Network

PRESSURE_PA = 15e3
AXES = {1: ("y",), 2: ("y", "z"), 3: ("x", "y", "z")}


def network_law(k: int, units: int = 12, seed: int = 1) -> NeuralLaw:
    """A stable law of k axes: units of random directions beside a quadratic form that outweighs them."""
    random = np.random.default_rng(seed)
    weights = random.normal(size=(units, 1 + k)) * np.array([1 / 7500, *[2.0] * k])
    stiffness = 0.03 * np.eye(k) + 0.005
    factors = 0.01 / units * random.normal(size=units)
    network = Network(
        weights,
        random.uniform(-1, 1, units),
        factors,
        1e-4 * np.ones(k),
        1e-6 * np.arange(1, k + 1),
        stiffness,
    )
    domain = Domain(np.array([0.0, PRESSURE_PA]), np.tile([-0.2, 0.4], (k, 1)))
    return NeuralLaw(network, domain, AXES[k], "revolute" if k == 1 else "spherical")


def points(k: int, beyond: float, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Points in a box that is wider than the law's by a share `beyond`."""
    random = np.random.default_rng(6)
    p = PRESSURE_PA * random.uniform(-beyond, 1 + beyond, n)
    return p, random.uniform(-0.2 - 0.6 * beyond, 0.4 + 0.6 * beyond, (n, k))


@pytest.mark.parametrize("k", AXES)
@pytest.mark.parametrize("beyond", [0.0, 1.0])
def test_slopes_are_those_of_the_effort_and_effort_is_that_of_the_energy(k: int, beyond: float) -> None:
    law, (p, u) = network_law(k), points(k, beyond)
    effort = law.evaluate(p, u)
    in_p = (law.evaluate(p + 1, u).tau - law.evaluate(p - 1, u).tau) / 2
    np.testing.assert_allclose(effort.dtau_dp, in_p, rtol=1e-5, atol=1e-11)
    step = 1e-5
    for j in range(k):
        h = step * np.eye(k)[j]
        in_u = (law.evaluate(p, u + h).tau - law.evaluate(p, u - h).tau) / (2 * step)
        np.testing.assert_allclose(effort.dtau_du[:, :, j], in_u, rtol=1e-5, atol=1e-7)
        fall = -(law.potential(p, u + h) - law.potential(p, u - h)) / (2 * step)
        np.testing.assert_allclose(effort.tau[:, j], fall, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(effort.dtau_du, np.swapaxes(effort.dtau_du, 1, 2), atol=1e-14)


@pytest.mark.parametrize("k", AXES)
def test_no_work_over_a_closed_loop_that_leaves_the_box(k: int) -> None:
    law = network_law(k)
    turn = np.linspace(0, 2 * np.pi, 4001)[:-1]
    path = 0.1 + 0.7 * np.stack([np.cos(turn + 0.7 * i) * np.sin((i + 1) * turn) for i in range(k)], axis=1)
    velocity = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    tau = law.evaluate(np.full(len(turn), 9e3), path).tau
    work = np.sum(tau * velocity) / 2
    assert abs(work) < 1e-6 * np.sum(np.abs(tau * velocity))


@pytest.mark.parametrize("k", AXES)
def test_a_stable_law_is_stable_however_far_outside(k: int) -> None:
    law = network_law(k)
    assert law.outside.largest_slope < 0
    for beyond in (0.05, 0.2, 1.0, 20.0):
        p, u = points(k, beyond, 400)
        assert np.linalg.eigvalsh(law.evaluate(p, u).dtau_du).max() < 0


def test_a_law_that_softens_with_pressure_keeps_its_stiffness() -> None:
    """A unit that grows soft with p: the bare network would turn unstable outside the box."""
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


def test_far_away_is_finite() -> None:
    law = network_law(3)
    p, u = np.array([1e9, -1e9]), np.array([[1e4, -1e4, 0.0], [-50.0, 1e3, 1e4]])
    effort = law.evaluate(p, u)
    assert all(
        np.isfinite(v).all() for v in (effort.tau, effort.dtau_dp, effort.dtau_du, law.potential(p, u))
    )
    assert np.all(np.any(law.domain.excess(p, u) != 0, axis=1))


@pytest.mark.parametrize("k", AXES)
def test_the_compiled_form_is_the_law(k: int) -> None:
    law = network_law(k)
    scalar = law.scalar()
    assert law_address(scalar.function)  # numba refuses what an engine could not compile
    for beyond in (0.0, 1.0):
        p, u = points(k, beyond, 25)
        effort = law.evaluate(p, u)
        for row in range(len(p)):
            tau, gain, slope = np.full(k, np.nan), np.full(k, np.nan), np.full((k, k), np.nan)
            scalar.function(float(p[row]), u[row], scalar.parameters, tau, gain, slope)
            np.testing.assert_allclose(tau, effort.tau[row], rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(gain, effort.dtau_dp[row], rtol=1e-9, atol=1e-15)
            np.testing.assert_allclose(slope, effort.dtau_du[row], rtol=1e-9, atol=1e-12)


def test_record_keeps_bits_and_error_bar() -> None:
    plain = network_law(2)
    box = np.array([[0.0, PRESSURE_PA], [-0.2, 0.4], [-0.2, 0.4]])
    p, u = points(2, 0.0, 12)
    error = ErrorBar.of(box, p, u, np.random.default_rng(0).normal(size=(12, 2)))
    law = NeuralLaw(plain.network, plain.domain, plain.axes, plain.joint, error=error)
    again = NeuralLaw.of_record(law.record())
    assert (again.axes, again.joint, again.actuation_name) == (law.axes, law.joint, law.actuation_name)
    for beyond in (0.0, 1.0):
        p, u = points(2, beyond)
        np.testing.assert_array_equal(again.evaluate(p, u).tau, law.evaluate(p, u).tau)
        np.testing.assert_array_equal(again.band(p, u), law.band(p, u))


def test_without_torch_laws_are_loaded_and_a_fit_names_the_install_command() -> None:
    code = (
        "import sys\n"
        "class WithoutTorch:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.partition('.')[0] == 'torch':\n"
        "            raise ModuleNotFoundError(name)\n"
        "sys.meta_path.insert(0, WithoutTorch())\n"
        "import numpy as np\n"
        "from pliant_plugins.surrogates.neural.config import NeuralConfig\n"
        "from pliant_plugins.manifest import pliant_components\n"
        "from pliant_plugins.surrogates.neural.network import Network\n"
        "from pliant_plugins.surrogates.neural.law import NeuralLaw\n"
        "from pliant.records.law import Domain\n"
        "from pliant.errors import MissingDependencyError\n"
        "from pliant.testing.samples import softening_law, table_of\n"
        "net = Network(np.ones((3, 2)), np.ones(3), 1e-3 * np.ones(3), np.ones(1), np.ones(1), np.eye(1))\n"
        "law = NeuralLaw(net, Domain(np.array([0.0, 1.0]), np.array([[-1.0, 1.0]])))\n"
        "pick = [c for c in pliant_components() if (c.interface, c.kind) == ('surrogate', 'neural')]\n"
        "neural = pick[0].build(NeuralConfig())\n"
        "again = neural.load(law.record())\n"
        "assert again.evaluate(np.zeros(1), np.zeros((1, 1))).tau[0, 0] < 1\n"
        "assert again.scalar() is not None\n"
        "assert pick[0].missing() is None and pick[0].missing(lazy=True) == 'torch'\n"
        "try:\n"
        "    neural.fit(table_of(softening_law()))\n"
        "except MissingDependencyError as error:\n"
        "    assert \"pip install 'pliant[neural]'\" in str(error), error\n"
        "else:\n"
        "    raise SystemExit('it was fitted without torch')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
