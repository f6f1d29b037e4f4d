"""Designs for a meta-model: from a sweep or its table, and refused combinations."""

from dataclasses import replace

import numpy as np
import pytest
from tests.pliant_designs import meta_bench as bench

from pliant import api
from pliant.errors import UserError
from pliant_designs.samples import solved_designs as samples
from pliant_designs.samples import solved_spherical_designs
from pliant_designs.solved_designs import assembled, from_sweep, from_table, solved_designs
from pliant_designs.sweep_table import write_sweep_table


def parts(designs):
    """Return the arguments of `assembled` for solved samples."""
    constants = [dict(one.design.parameters) for one in designs.data]
    return constants, list(designs.data), [f"design {n}" for n in range(len(designs))]


def test_a_sweep_and_its_table_hold_the_same_designs(tmp_path):
    run = bench.solved(tmp_path)
    found = from_sweep(run).designs
    assert found.names == ("radius_m", "length_m")
    assert np.allclose(1e3 * found.values, [[4, 8], [4, 9], [5, 8], [5, 9]], rtol=1e-12)
    assert found.fixed["folds"] == 1
    assert found.fixed["material.shear_modulus_pa"] == 240e3
    assert "material.density_kg_m3" not in found.fixed
    write_sweep_table(run, tmp_path / "fem.csv")
    other = from_table(tmp_path / "fem.csv", "springs").designs
    assert other.names == found.names
    assert np.array_equal(other.values, found.values)
    assert all(np.array_equal(a.tau, b.tau) for a, b in zip(found.data, other.data, strict=True))


def test_doubles_that_agree_count_once_and_doubles_that_contradict_are_refused():
    constants, data, labels = parts(samples((2, 2)))
    constants, labels = [*constants, constants[1]], [*labels, "design 4"]
    found, doubles = assembled("sample", constants, [*data, data[1]], labels, "here")
    assert (len(found), doubles) == (4, 1)
    other = replace(data[1], tau=1.1 * data[1].tau)
    with pytest.raises(UserError, match="here: design 4 has the parameters of design 1 and other data"):
        assembled("sample", constants, [*data, other], labels, "here")


def test_a_kind_with_one_actuation_refuses_several_before_a_state_is_solved(tmp_path):
    text = (
        f"pliant: 1\nname: two\nplugins: ['{bench.META_PLUGIN}']\n"
        "material: {kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3}\n"
        "family: {kind: two_chamber, height: 12 mm, width: 12 mm, wall: 1.5 mm, web: 2 mm, module_length: 10 mm}\n"
        "fem: {kind: skfem, pressure_max: 15 kPa}\nmeta_model: {kind: stand_in}\n"
        "sweep: {family.wall: [1.2 mm, 1.4 mm, 1.6 mm, 1.8 mm, 2 mm, 2.2 mm]}\n"
    )
    (tmp_path / "study.yaml").write_text(text)
    opened = api.open_study(tmp_path / "study.yaml", store=tmp_path / "store")
    with pytest.raises(
        UserError, match="'stand_in' makes laws of one actuation, .* by pressure_1_pa, pressure_2_pa: use"
    ):
        solved_designs(opened.context, opened.study)


def test_a_table_for_another_family_is_recognised_by_its_columns(tmp_path):
    path = bench.table(tmp_path)
    path.write_text(path.read_text().replace("radius_m", "bore_m"))
    opened = bench.opened(tmp_path, data=path)
    with pytest.raises(UserError, match="'bore_m' varies between its designs, and it is not a parameter"):
        solved_designs(opened.context, opened.study)


def test_designs_have_the_table_numbers_and_a_missing_parameter_is_considered(tmp_path):
    head, *rows = (line.split(",") for line in bench.table(tmp_path).read_text().splitlines())
    kept = [head[:6] + head[7:], *([*row[:6], str(10 + 3 * int(row[7]))] for row in rows)]  # without length_m
    path = tmp_path / "less.csv"
    path.write_text("\n".join(map(",".join, kept)))
    with pytest.raises(
        UserError, match="design 13 has the parameters of design 10 .* add the parameter in which"
    ):
        from_table(path, "springs")


def test_a_refused_design_is_counted_and_a_material_constant_may_vary(tmp_path):
    sweep = "{radius: [4 mm, 9 mm], length: [8 mm, 9.5 mm], material.shear_modulus: [200 kPa, 300 kPa]}"
    found = from_sweep(bench.solved(tmp_path, sweep))
    assert (len(found.designs), found.left_out) == (6, 2)
    assert found.designs.names == ("radius_m", "length_m", "material.shear_modulus_pa")


@pytest.mark.parametrize(
    ("sweep", "sentence"),
    [
        ("{radius: [4 mm, 5 mm], defect: [none, some_states]}", "'defect' is 'none', but it varies"),
        ("{radius: [4 mm]}", "the designs do not differ.*radius_m has one value"),
    ],
)
def test_sweeps_that_teach_nothing(tmp_path, sweep, sentence):
    with pytest.raises(UserError, match=sentence):
        from_sweep(bench.solved(tmp_path, sweep))


def test_designs_that_do_not_belong_together():
    constants, data, labels = parts(samples((2, 2)))
    near = [constants[0], {**constants[1], "module_length_m": constants[1]["module_length_m"] * (1 + 1e-9)}]
    _, doubles = assembled("sample", [*near, *constants[2:]], data, labels, "here")
    assert doubles == 0, "rounding of a table is no difference"
    spherical = [*data[:2], solved_spherical_designs((2, 2)).data[2], data[3]]
    with pytest.raises(UserError, match="joint of design 2 is spherical, of design 0 revolute"):
        assembled("sample", constants, spherical, labels, "here")
    touching = [*data[:3], replace(data[3], status=np.full(len(data[3]), "self_contact"))]
    with pytest.raises(UserError, match="design 3 has no trusted state"):
        assembled("sample", constants, touching, labels, "here")


def test_tables_and_studies_without_designs(tmp_path):
    path = bench.table(tmp_path)
    rows = [line.split(",") for line in path.read_text().splitlines()]
    bare = tmp_path / "bare.csv"
    for text, sentence in (
        ("", "is empty"),
        ("\n".join(",".join(r[:5] + r[7:]) for r in rows), "columns of param"),
    ):
        bare.write_text(text)
        with pytest.raises(UserError, match=sentence):
            from_table(bare, "springs")
    with pytest.raises(UserError, match="needs solved designs: give the study a 'sweep' block"):
        api.meta_model(bench.opened(tmp_path, (f", data: {path}", "")))
    study = bench.unseen(tmp_path)
    lines = [line for line in study.read_text().splitlines() if not line.startswith("family")]
    study.write_text("\n".join(lines))
    with pytest.raises(UserError, match="no 'family' block; a meta-model needs one"):
        api.simulate(api.open_study(study, store=tmp_path / "store"))
