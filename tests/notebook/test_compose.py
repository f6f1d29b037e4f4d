"""Studies composed in Python: the numbers of the file with the same keys, and files that stand alone."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest

import pliant
from pliant.config.study import study_model
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant_plugins import configs
from pliant_plugins.configs import BellowBendingConfig, NeoHookeanConfig, PolynomialConfig, SkfemConfig
from pliant_plugins.families.reference import FINGER
from pliant_plugins.manifest import STUDY_LAW, pliant_components

EXAMPLES = Path(__file__).parents[2] / "examples"
LAW = PolynomialConfig(form="study", odd=True, coefficients=STUDY_LAW)


@pytest.fixture
def chain(tmp_path: Path) -> pliant.Chain:
    return pliant.Chain.from_modules(
        LAW, 8, module_length="11 mm", gravity=(0, 0, 0), store=tmp_path / "store"
    )


def test_the_worked_number_in_the_conventions_is_reproduced(chain: pliant.Chain) -> None:
    tip = chain.settle(pressure="15 kPa").tip
    np.testing.assert_allclose(tip, [0.059451, 0.0, -0.007889], atol=1e-6)
    np.testing.assert_allclose(
        chain.settle(inputs={"pressure_pa": 15e3}, engine="mujoco").tip, tip, atol=1e-5
    )


def test_a_composed_study_is_the_file_with_the_same_keys(tmp_path: Path) -> None:
    """Typed blocks, plain ones and the file give one config."""
    text = (
        "name: robot\nchain: {modules: 3, module_length: 11 mm}\neffects: [{kind: stiffness, factor: 0.9}]\n"
    )
    law = ", ".join(f"{key}: {value}" for key, value in STUDY_LAW.items())
    text += f"surrogate: {{kind: polynomial, form: study, odd: true, coefficients: {{{law}}}}}\n"
    (tmp_path / "robot.yaml").write_text(text)
    read = pliant.open(tmp_path / "robot.yaml", store=tmp_path / "store")
    blocks = {
        "chain": {"modules": 3, "module_length": "11 mm"},
        "effects": [{"kind": "stiffness", "factor": 0.9}],
    }
    composed = pliant.Study("robot", surrogate=LAW, **blocks, store=tmp_path / "store")
    assert composed.config.canonical() == read.config.canonical()


def test_it_is_written_as_a_file_that_stands_alone(chain: pliant.Chain, tmp_path: Path) -> None:
    heavier = chain.with_(payload="13 g")
    again = pliant.open(heavier.to_yaml(tmp_path / "heavier.yaml"), store=tmp_path / "other")
    assert again.config.canonical() == heavier.config.canonical()
    assert isinstance(heavier, pliant.Chain) and heavier.config.chain.payload_kg == pytest.approx(0.013)


def test_a_law_from_a_table_by_a_relative_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)
    law = pliant.fit("data/bellow_bending.csv", store=tmp_path / "store")
    chain = pliant.Chain.from_modules(
        law, 4, module_length="12 mm", gravity=(0, 0, 0), store=tmp_path / "store"
    )
    settled = chain.settle(pressure="10 kPa")
    moment = law.law.evaluate(np.full(4, 10e3), settled.joint_angles).tau
    np.testing.assert_allclose(moment, 0.0, atol=1e-7)


@pytest.mark.slow
def test_a_module_is_solved_fitted_and_chained_without_a_file(tmp_path: Path) -> None:
    """FEM, law and chain are those of the study with the same blocks."""
    finger, rubber = BellowBendingConfig(**FINGER), NeoHookeanConfig(shear_modulus="240 kPa")
    fem = SkfemConfig(pressures=3, angles=3, check_states=2)
    store = tmp_path / "store"
    data = pliant.solve(finger, rubber, fem, pressure_max="15 kPa", store=store)
    tip = (
        pliant.Chain.from_modules(pliant.fit(data), 8, payload="13 g", store=store)
        .settle(pressure="15 kPa")
        .tip
    )
    whole = pliant.Study(
        family=finger,
        material=rubber,
        fem={"kind": "skfem", "pressures": 3, "angles": 3, "check_states": 2, "pressure_max": "15 kPa"},
        surrogate="polynomial",
        chain={"modules": 8, "payload": "13 g"},
        task={"kind": "free_bending", "pressure": "15 kPa"},
        store=store,
    )
    np.testing.assert_allclose(tip, whole.simulate().tip, atol=1e-12)


def test_it_has_an_argument_for_every_study_key() -> None:
    arguments = set(inspect.signature(pliant.Study).parameters) - {"store"}
    assert arguments == set(study_model({}, discover()).model_fields) - {"pliant"}


def test_every_config_that_ships_has_its_name() -> None:
    """The list for type checkers is that of the manifest."""
    nodes = ast.walk(ast.parse(Path(configs.__file__).read_text()))
    imports = {alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names}
    listed = {name for name in imports if name.endswith("Config")}
    assert (
        listed
        == {component.config.partition(":")[2] for component in pliant_components()}
        == set(dir(configs))
    )
    for component in pliant_components():
        assert getattr(configs, component.config.partition(":")[2]) is component.config_model()


@pytest.mark.parametrize(
    ("blocks", "says"),
    [
        ({"surrogate": {"kind": "polynomal"}}, "did you mean 'polynomial'"),
        ({"surrogate": LAW, "chain": {"modules": 0}}, "chain.modules"),
        ({"surrogate": LAW, "effects": ["stifness"]}, "did you mean 'stiffness'"),
    ],
)
def test_a_wrong_block_is_one_sentence(blocks: dict[str, object], says: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=says):
        pliant.Study(**blocks, store=tmp_path)


def test_an_equilibrium_needs_one_drive(chain: pliant.Chain) -> None:
    with pytest.raises(UserError, match="one of 'pressure', 'tendon_force' and 'inputs'"):
        chain.settle()
    with pytest.raises(UserError, match="it needs a pressure"):
        chain.settle(pressure="15 mm")
