"""Named rubbers and Shore hardness: constants, laws, spread, errors, and the nearest rubber to a calibration."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).parents[1] / "pliant_calibrate"))
from calibration_tables import REGISTRY, BarBench, config, study, write

from pliant.cli.verbs import app
from pliant.mechanics.homogeneous import incompressible_stress, stability_remarks
from pliant_calibrate.calibration import calibrate
from pliant_calibrate.reading import read_bench_data
from pliant_plugins.materials.hardness import SCATTER, hardness_to_shear_modulus
from pliant_plugins.materials.named import Named

PRESETS = {one.name: one for one in Named.presets()}


def built(**keys: Any) -> Any:
    return REGISTRY.build("material", config("named", **keys))


def test_there_are_enough_and_each_says_where_it_is_from() -> None:
    assert len(PRESETS) >= 15
    for one in PRESETS.values():
        assert one.source
        assert 900 < one.config.density_kg_m3 < 1300
        assert one.stretch[0] == 1 < one.stretch[1]
        if one.range_pa:
            assert one.range_pa[0] <= 1.01 * one.shear_modulus_pa <= 1.03 * one.range_pa[1]


# Engineering stress in kPa at strains of 0.5, 1 and 2: Marechal et al. (2021), Tensile-Tests-Data.
PULLED = {
    "Ecoflex 00-10": (7.91, 14.79, 31.12),
    "Ecoflex 00-30": (16.89, 29.72, 52.39),
    "Ecoflex 00-50": (22.78, 40.95, 79.01),
    "Dragon Skin 10": (53.0, 112.96, 272.79),
    "Dragon Skin 20": (151.07, 318.36, 722.26),
    "Dragon Skin 30": (213.92, 437.12, 959.47),
}


@pytest.mark.parametrize("name", PULLED)
def test_pull_tests_are_followed(name: str) -> None:
    stress = incompressible_stress(built(name=name), np.array([1.5, 2.0, 3.0])) / 1e3
    np.testing.assert_allclose(stress, PULLED[name], rtol=0.06)


def test_constants_that_papers_and_makers_state() -> None:
    """The moduli have closed forms: E/3, σ₁₀₀/(2 − 2⁻²), 2 (C10 + C01), Σ μ'α/2 of Ogden's own convention."""
    known = {
        "Smooth-Sil 950": 1875e3 / 1.75,
        "Ecoflex 00-20": 55e3 / 1.75,
        "Sylgard 184": 2.05e6 / 3,
        "latex": 2 * (118.4e3 + 105.7e3),
        "Elastosil M4601": 2 * 110e3,
        "natural rubber": 98066.5 * (6.3 * 1.3 + 0.012 * 5 + 0.1 * 2) / 2,
    }
    for name, modulus in known.items():
        assert PRESETS[name].shear_modulus_pa == pytest.approx(modulus, rel=2e-3), name
        assert built(name=name).shear_modulus_pa == PRESETS[name].shear_modulus_pa


def test_treloars_tension_is_near_ogdens_constants() -> None:
    """Simple tension at stretches of 1.39, 3.02 and 6.15: 3.23, 8.8 and 27.4 kgf/cm²."""
    stress = incompressible_stress(built(name="natural rubber"), np.array([1.39, 3.02, 6.15])) / 98066.5
    np.testing.assert_allclose(stress, (3.23, 8.8, 27.4), rtol=0.1)


@pytest.mark.parametrize("name", PRESETS)
def test_no_named_rubber_is_unstable_between_half_and_twice_its_length(name: str) -> None:
    """The check covers tension, compression, equibiaxial and planar tests."""
    assert stability_remarks(built(name=name)) == ()


def test_a_named_block_is_the_law_that_it_stands_for() -> None:
    named = built(name="Dragon Skin 10", scale=1.2)
    law = named.resolved
    assert law.config.kind == "ogden"
    assert law.config.mu_pa == pytest.approx((1.2 * 42.5e3,))
    assert (named.density_kg_m3, law.density_kg_m3) == (1070, 1070)
    assert built(name="Dragon Skin 10", density="1200 kg/m^3").density_kg_m3 == 1200
    assert named.config.poisson_ratio == 0.4995  # published constants are incompressible
    assert built(name="Dragon Skin 10", poisson_ratio=0.48).bulk_modulus_pa == pytest.approx(
        2 * 42.5e3 * 1.48 / (3 * 0.04)
    )
    F = np.diag([1.3, 0.9, 0.9])
    np.testing.assert_array_equal(named.evaluate(F).tangent, law.evaluate(F).tangent)


def test_gent_and_hertz() -> None:
    """Gent's table: 50 Shore A is an E of 2.46 MPa; Hertz by hand for 00-30: d = 1.75 mm, F = 0.4754 N."""
    assert 3 * hardness_to_shear_modulus("50A") == pytest.approx(2.456e6, rel=1e-3)
    d, R, F = 1.75e-3, 1.19e-3, 0.4754
    hertz = F / (16 / 9 * math.sqrt(R) * d**1.5)  # F = 4/3 E/(1 − ν²) √R d^1.5 with ν = ½
    assert 3 * hardness_to_shear_modulus("00-30") == pytest.approx(hertz, rel=1e-6)
    assert hardness_to_shear_modulus("OO 30") == hardness_to_shear_modulus("00-30")
    assert built(shore="30a").shear_modulus_pa == hardness_to_shear_modulus("30A")


def test_the_stated_hardness_scatter_equals_the_table() -> None:
    ratios = []
    for one in PRESETS.values():
        if one.hardness:
            moduli = one.range_pa or (one.shear_modulus_pa,)
            ratios += [modulus / hardness_to_shear_modulus(one.hardness) for modulus in moduli]
    assert SCATTER[0] <= min(ratios) < 1.1 * SCATTER[0]
    assert 0.95 * SCATTER[1] < max(ratios) <= SCATTER[1]
    assert "only roughly" in built(shore="30A").remarks()[0]
    assert (
        "Sources of Ecoflex 00-30 differ: a shear modulus of 15 kPa to 39 kPa"
        in built(name="Ecoflex 00-30").remarks()[0]
    )


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"name": "Ecoflex 0030"}, "did you mean 'Ecoflex 00-30'"),
        ({"name": "dragon skin 30"}, "did you mean 'Dragon Skin 30'"),
        ({"name": "brick"}, "Known: Ecoflex 00-10"),
        ({}, "give either a name"),
        ({"name": "latex", "shore": "30A"}, "give either a name"),
        ({"shore": "30"}, "'30' is no Shore hardness; write 30A or 00-30"),
        ({"shore": "99A"}, "outside 10 to 90"),
    ],
)
def test_wrong_names_and_hardnesses(keys: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        config("named", **keys)


def test_a_study_with_an_unknown_name_ends_with_2(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("pliant: 1\nname: s\nmaterial: {kind: named, name: Ecoflex 30}\n")
    write(tmp_path / "t.csv", "stretch,nominal_stress_pa", [1.1, 1.2, 1.3, 1.4], [1e4, 2e4, 3e4, 4e4])
    done = CliRunner().invoke(app, ["calibrate", str(path), "--data", str(tmp_path / "t.csv")])
    assert done.exit_code == 2
    assert "did you mean 'Ecoflex 00-30'" in " ".join(done.output.split())


def test_a_calibration_names_its_nearest(tmp_path: Path) -> None:
    """The rubber is 1.1 times as stiff as Dragon Skin 20, which is then 1/1.1 as stiff; its factor by `--fit scale`."""
    x = np.linspace(1.1, 2.5, 20)
    path = write(
        tmp_path / "t.csv",
        "stretch,nominal_stress_pa",
        x,
        1.1 * incompressible_stress(built(name="Dragon Skin 20"), x),
    )
    found = calibrate(BarBench(), study("yeoh", c10=1e5), read_bench_data(path))  # type: ignore[arg-type]
    assert found.nearest[0].preset.name == "Dragon Skin 20"
    assert found.nearest[0].stiffness == pytest.approx(1 / 1.1, rel=0.02)
    own = study("named", name="Dragon Skin 20")
    scaled = calibrate(BarBench(), own, read_bench_data(path))  # type: ignore[arg-type]
    assert [(c.name, round(c.value, 6)) for c in scaled.constants] == [("scale", 1.1)]
