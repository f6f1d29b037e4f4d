"""A law in C, NumPy, torch, JAX and JSON has the law's values and slopes, inside the domain and far outside."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from tests.exporting.alone import run_alone
from tests.mechanics.test_several_actuations import several_law
from tests.slow import slow_among
from tests.surrogates.laws import STATED, WAVY, energy_law, network_law, split, with_a_box

from pliant.errors import UserError
from pliant.mechanics.rotations import exp_map, skew
from pliant.records.law import JointLaw, ScalarLaw
from pliant.testing.samples import sample_table, softening_law
from pliant_export.as_json import READER, as_json
from pliant_export.in_c import in_c
from pliant_export.in_python import in_python
from pliant_export.written_law import WrittenLaw, written
from pliant_plugins.surrogates.config import TableConfig
from pliant_plugins.surrogates.table.surrogate import TableSurrogate

TABLE = TableSurrogate(TableConfig()).fit(sample_table(softening_law(), noise_n_m=2e-5)).law
LAWS: dict[str, JointLaw] = {
    "polynomial": WAVY,
    "stated": STATED["stated"],
    "unbounded": STATED["unbounded"],
    "axes": with_a_box(),
    "table": TABLE,
    "energy": energy_law(3),
    "network": network_law(3),
}
OUTPUTS = ("tau", "dtau_dp", "dtau_du")
OF_RANGE = 1e-12
every_law = pytest.mark.parametrize("name", list(LAWS))
SEVERAL: dict[str, JointLaw] = {
    "several": several_law(2, ("y", "z")),
    "network of several": network_law(3, 4, m=2),
}
LAWS |= SEVERAL
of_several_too = pytest.mark.parametrize("name", list(LAWS))


def points(law: JointLaw, count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Return p (n,) and u (n, a), six in ten outside the domain in one way or another."""
    box = np.clip(np.vstack([law.domain.actuation, law.domain.deformation]), -1.0, 1.5e4)
    reach = np.ptp(box, axis=1) * np.random.default_rng(2).uniform(-0.4, 1.4, (count, len(box)))
    at = box[:, 0] + reach
    return split(law, at)


def expected(law: JointLaw) -> dict[str, np.ndarray]:
    p, u = points(law)
    effort = law.evaluate(p, u)
    return {name: getattr(effort, name).reshape(len(p), -1) for name in OUTPUTS}


def require_the_law(law: JointLaw, found: dict[str, np.ndarray], of_range: float = OF_RANGE) -> None:
    for name, ours in expected(law).items():
        theirs = np.asarray(found[name], float).reshape(ours.shape)
        assert np.abs(theirs - ours).max() <= of_range * np.ptp(ours), name


@of_several_too
def test_the_steps_are_the_law(name) -> None:
    law = LAWS[name]
    p, u = points(law)
    found = written(law, name).tape.run(*np.column_stack([p, u]).T)
    require_the_law(law, {k: np.stack(v, axis=-1) for k, v in found.items()})


@every_law
def test_numpy_alone(name, tmp_path) -> None:
    require_the_law(LAWS[name], module_values(LAWS[name], "numpy", tmp_path))


@pytest.mark.parametrize("name", slow_among(["polynomial", "table", "network"], "table", "network"))
def test_torch_alone_and_its_own_gradient(name, tmp_path) -> None:
    if importlib.util.find_spec("torch") is None:
        pytest.skip("torch is not installed: pip install 'pliant[torch]'")
    law = LAWS[name]
    found = module_values(law, "torch", tmp_path, TORCH)
    require_the_law(law, found)
    # Torch's own derivative is the slope that the function returns, summed over the axes of τ.
    ours = expected(law)["dtau_du"].reshape(len(found["gradient"]), *[len(law.axes)] * 2).sum(axis=1)
    np.testing.assert_allclose(found["gradient"], ours, atol=1e-9 * np.abs(ours).max())


@pytest.mark.parametrize("name", ["polynomial", "table", "network"])
def test_jax_alone(name, tmp_path) -> None:
    if importlib.util.find_spec("jax") is None:
        pytest.skip("jax is not installed: pip install jax")
    require_the_law(LAWS[name], module_values(LAWS[name], "jax", tmp_path, JAX))


@every_law
def test_the_text_for_jax_with_numpy_in_its_place(name, tmp_path) -> None:
    """This tests the text, not JAX itself, where JAX is not installed."""
    (tmp_path / "jax").mkdir()
    (tmp_path / "jax" / "__init__.py").write_text("")
    (tmp_path / "jax" / "numpy.py").write_text("from numpy import *\nfrom numpy import abs, max, min\n")
    require_the_law(LAWS[name], module_values(LAWS[name], "jax", tmp_path))


@every_law
def test_json_with_its_reader_alone(name, tmp_path) -> None:
    law = LAWS[name]
    save(law, tmp_path)
    (tmp_path / "law.json").write_text(as_json(written(law, "law")))
    (tmp_path / "read_law.py").write_text(READER)
    assert len(READER.splitlines()) <= 12
    said = run_alone(
        "import json, read_law\nat = json.load(open('points.json'))\nlaw = read_law.read('law.json')\n"
        "each = [read_law.outputs(law, p, *u) for p, u in zip(at['p'], at['u'])]\n"
        "said = {name: [one[name] for one in each] for name in each[0]}",
        tmp_path,
    )
    require_the_law(law, said)


@of_several_too
def test_c_alone_one_by_one_and_many_at_once(name, tmp_path) -> None:
    law = LAWS[name]
    text = in_c(written(law, "the law"))
    found = c_values(text, law, tmp_path)
    require_the_law(law, {k: found[f"one_{k}"] for k in OUTPUTS})
    require_the_law(law, {k: found[f"many_{k}"] for k in OUTPUTS})


def test_the_usual_way_says_where_it_is_not_the_law() -> None:
    p, u = points(WAVY)
    usual = written(WAVY, "law").tape.usual(7e3, 0.1)
    found, effort = usual.run(p, *u.T), WAVY.evaluate(p, u)
    another = np.asarray(found["unusual"][0], bool)
    outside = (p < 0.0) | (p > 15e3)
    np.testing.assert_array_equal(another, outside)
    np.testing.assert_allclose(found["tau"][0][~another], effort.tau[~another, 0], rtol=1e-12)
    assert np.abs(found["tau"][0] - effort.tau[:, 0])[another].max() > 1e-3


def test_domain_and_error_are_in_every_form() -> None:
    law = written(TABLE, "law")
    assert law.band is not None and law.band.shape == (1,) and law.band[0] > 0.0
    half = f"{law.band[0]:.3g}"
    for text in (in_c(law), in_python(law, "numpy"), in_python(law, "torch"), in_python(law, "jax")):
        assert half in text and "pressure_pa is 0 to" in text
    read = json.loads(as_json(law))
    assert read["band"]["half_width"] == law.band.tolist()
    np.testing.assert_array_equal(read["domain"], law.domain)


def strange(actuation, deformation, parameters, tau, dtau_dp, dtau_du) -> None:
    tau[0] = np.linalg.norm(deformation) * actuation


def test_a_function_that_cannot_be_followed_is_refused() -> None:
    class Strange(type(WAVY)):  # type: ignore[misc]
        def scalar(self):
            return ScalarLaw(strange, np.zeros(1))

    law = Strange(WAVY.coefficients, WAVY.actuation_map, WAVY.deformation_map, WAVY.domain)
    with pytest.raises(UserError, match="cannot be written in other languages"):
        written(law, "law")


def save(law: JointLaw, folder: Path) -> None:
    p, u = points(law)
    (folder / "points.json").write_text(json.dumps({"p": p.tolist(), "u": u.tolist()}))


PLAIN = (
    "p, u = np.array(at['p']), np.array(at['u'])\n"
    "said = {{k: np.asarray(v).tolist() for k, v in zip({names}, law.law(p, u))}}\n"
)
TORCH = (
    "import torch\ntorch.set_default_dtype(torch.float64)\n"
    "p, u = torch.tensor(at['p']), torch.tensor(at['u'], requires_grad=True)\n"
    "out = law.law(p, u)\nout[0].sum().backward()\n"
    "said = {{k: v.tolist() for k, v in zip({names}, out)}}\nsaid['gradient'] = u.grad.tolist()\n"
)
JAX = "import jax\njax.config.update('jax_enable_x64', True)\n" + PLAIN


def module_values(law: JointLaw, dialect: str, folder: Path, script: str = PLAIN) -> dict[str, np.ndarray]:
    """Return the values of the written module at the points."""
    save(law, folder)
    (folder / "law.py").write_text(in_python(written(law, "law"), dialect))
    script = script.replace("{names}", repr(OUTPUTS)).replace("{{", "{").replace("}}", "}")
    head = "import json\nimport numpy as np\nimport law\nat = json.load(open('points.json'))\n"
    return {k: np.array(v) for k, v in run_alone(head + script, folder).items()}


MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include "law.h"
enum {{ n = {n}, m = {m}, a = {a} }};
static double p[n * m], u[n * a], tau[n * a], dp[n * a * m], du[n * a * a];
int main(void) {{
    for (int i = 0; i < n; ++i) {{
        for (int k = 0; k < m; ++k) if (scanf("%lf", &p[k * n + i]) != 1) return 1;
        for (int k = 0; k < a; ++k) if (scanf("%lf", &u[k * n + i]) != 1) return 1;
    }}
    the_law_many(n, p, u, tau, dp, du);
    for (int i = 0; i < n; ++i) {{
        double one_p[m], one_u[a], t[a], g[a * m], s[a * a];
        for (int k = 0; k < m; ++k) one_p[k] = p[k * n + i];
        for (int k = 0; k < a; ++k) one_u[k] = u[k * n + i];
        the_law(one_p, one_u, t, g, s);
        for (int k = 0; k < a; ++k) printf("%.17g ", t[k]);
        for (int k = 0; k < a * m; ++k) printf("%.17g ", g[k]);
        for (int k = 0; k < a * a; ++k) printf("%.17g ", s[k]);
        for (int k = 0; k < a; ++k) printf("%.17g ", tau[k * n + i]);
        for (int k = 0; k < a * m; ++k) printf("%.17g ", dp[k * n + i]);
        for (int k = 0; k < a * a; ++k) printf("%.17g ", du[k * n + i]);
        printf("%d\\n", the_law_inside(one_p, one_u));
    }}
    return 0;
}}
"""


def c_values(text: str, law: JointLaw, folder: Path) -> dict[str, np.ndarray]:
    """Return the values of the compiled header at the points, one by one and many at once."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler 'cc' on this machine")
    p, u = points(law)
    n, a = u.shape
    (folder / "law.h").write_text(text)
    (folder / "main.c").write_text(MAIN.format(n=n, m=len(law.actuations), a=a))
    strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([compiler, *strict, "main.c", "-o", "main", "-lm"], cwd=folder, check=True)
    rows = "\n".join(" ".join(repr(float(x)) for x in row) for row in np.column_stack([p, u]))
    done = subprocess.run([folder / "main"], input=rows, capture_output=True, text=True, check=True)
    table = np.array([line.split() for line in done.stdout.splitlines()], float)
    inside = np.all(law.domain.excess(p, u) == 0.0, axis=1)
    np.testing.assert_array_equal(table[:, -1], inside)
    widths = [a, a * len(law.actuations), a * a] * 2
    names = [f"{way}_{name}" for way in ("one", "many") for name in OUTPUTS]
    return dict(zip(names, np.split(table[:, :-1], np.cumsum(widths)[:-1], axis=1), strict=True))


def test_names_are_identifiers() -> None:
    law: WrittenLaw = written(WAVY, "8 modules, 2nd try")
    assert law.name == "law_8_modules_2nd_try" and law.name.isidentifier()


def test_the_frame_for_a_ball_joint_effort_is_reported():
    """J of the text is the rate of f per angular velocity in the child's frame, so that tau · df is T · w dt."""
    (said,) = [line for line in written(LAWS["axes"], "ball").about if "rotation vector" in line]
    assert "J = 1 - (1 - cos t)/t^2 K + (t - sin t)/t^3 K K" in said
    f, w, step = np.array([0.3, -0.5, 0.8]), np.array([0.2, 0.7, -0.4]), 1e-6
    t, k = np.linalg.norm(f), skew(f)
    j = np.eye(3) - (1 - np.cos(t)) / t**2 * k + (t - np.sin(t)) / t**3 * k @ k
    df = np.linalg.solve(j, w) * step  # w = J df/dt, in the child's frame
    assert np.allclose(exp_map(f + df), exp_map(f) @ exp_map(w * step), atol=1e-11)
