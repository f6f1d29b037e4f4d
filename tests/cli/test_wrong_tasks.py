"""Wrong tasks, chains and engines give one sentence with the key and the allowed values; results carry their notes."""

import pytest

pytest.importorskip("mujoco")

HANG = "task={kind: helical_hang, pressure: 15 kPa, loads: [%s]}"
FOLLOW = "task={kind: follow_shape, pressure: 15 kPa, target: %s}"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("task.kind=free_bendin", "did you mean 'free_bending'?"),
        ("task.presure=3 kPa", "'presure' is not a key of task; did you mean 'pressure'?"),
        ("chain.modules=-3", "'chain.modules' is -3; it should be greater than or equal to 1"),
        ("chain.segments=[{rigid: {length: 6 mm}}]", "give either 'modules' or 'segments'"),
        ("task={kind: tip_load, pressure: 15 kPa, payload: -3 g}", "greater than or equal to 0"),
        ("task={kind: tendon_finger, tendon_force: 3 N}", "gives 'tendon_force', but the laws"),
        (HANG % "0 g, -10 g", "'task.loads.1' is '-10 g'; it should be greater than or equal to 0"),
        (HANG % "", "'task.loads' is []; it should have at least 1 item."),
        (
            FOLLOW % "{radius: 18 mm, turns: 2}",
            "give 'radius' and 'height' of a helix, or 'points: curve.csv'.",
        ),
        (FOLLOW % "{radius: 1 mm, height: 1 mm, points: c.csv}", "or 'points: curve.csv', and not both."),
        (FOLLOW % "{points: curve.csv}", "curve.csv: the table cannot be read (no such file)"),
        (
            "task={kind: grasp, object: egg, pressure: 1 kPa, inclination: 100 deg}",
            "'task.inclination' is 1.74533; it should be less than 1.5",
        ),
        ("task={kind: grasp, object: egg, pressure: 15 kPa}", "physics 'quasistatic' has no contacts"),
    ],
)
def test_a_wrong_task(pliant, write, workplace, stated, change, says):
    pliant("simulate", write(stated), change).refused(says)
    assert sorted(p.name for p in workplace.iterdir() if p.name != ".pliant") == ["study.yaml"]


@pytest.mark.parametrize(
    ("joint", "z", "says"),
    [
        ("joint: prismatic", "", "'joint' is given together with 'axes': a joint with axes is spherical"),
        ("", "actuation_name: tendon_force_n", "surrogate.axes: one joint has one actuation"),
    ],
)
def test_axes_that_make_no_joint(pliant, write, joint, z, says):
    axis = "{form: study, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: 0.03}, %s}"
    axes = ", ".join(f"{name}: {axis % (z if name == 'z' else '')}" for name in "xyz")
    study = write(
        f"pliant: 1\nname: axes\nsurrogate: {{kind: polynomial, axes: {{{axes}}}, {joint}}}\n"
        "chain: {modules: 2, module_length: 11 mm}\ntask: {kind: free_bending, pressure: 1 kPa}\n"
    )
    pliant("simulate", study).refused(says)


def test_curves_and_tables_are_not_printed(pliant, write, read, stated):
    call = pliant("simulate", write(stated), HANG % "0 g, 5 g", "--json", "r.json").done()
    assert "loads                    0 g, 5 g" in call.out
    assert "converged                yes, yes" in call.out
    assert "[[" not in call.out
    assert len(read("r.json")["metrics"]["rings_m"]) == 2


def test_a_grasp_says_where_it_left_the_law_s_data(pliant, write, stated):
    study = write(stated)
    small = [
        "chain.modules=2",
        "chain.module_radius=5 mm",
        "task={kind: grasp, object: egg, pressure: 15 kPa, hold_time: 0 s}",
        *(f"task.{name}_time=0.2 s" for name in ("lower", "ramp", "lift", "final")),
    ]
    domain = "surrogate.domain={actuation: [0 kPa, 10 kPa], deformation: [-1, 1]}"
    call = pliant("simulate", study, "physics=mujoco", domain, *small).done()
    assert "used the law outside its domain at" in call.out
    assert "pressure_pa by 5 kPa" in call.out
    assert "compiling" not in call.err
