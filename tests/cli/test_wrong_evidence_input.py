"""Wrong input of the evidence verbs: chains, opposed chambers, several files, contradictory repeats, protocols."""

from __future__ import annotations

import numpy as np
import pytest
from tests.cli.joint_study import JOINT
from tests.diagnosis.quick import effect, joint, measured, ramp
from tests.slow import slow_among

from pliant.measurements.writing import write_measurement

TASK = "task: {kind: free_bending, pressure: 15 kPa}\n"
CHAIN = JOINT.replace("modules: 1", "modules: 4").replace("30 g", "5 g")
BOTH = "payload: 30 g, actuators: [{input: pressure_1_pa, sign: 1}, {input: pressure_2_pa, sign: -1}]"
OPPOSED = JOINT.replace("payload: 30 g", BOTH)
NO_LAW = JOINT[: JOINT.index("surrogate")] + JOINT[JOINT.index("chain") :]
FEW = ("--effect", "stiffness", "--effect", "sensor_bias")
COUNTS = "pressure_pa,successes,trials\n10000,3,10\n"
N = 40


def table(
    columns: str = "angle_rad",
    names: str = "AB",
    drive: str = "pressure_pa",
    n: int = N,
    top: float = 1e4,
    read=None,
) -> str:
    """Return a table of ramps of the drive to `top`; `read(k, run)` gives the values of the columns, in order."""
    read = read or (lambda k, run: [0.5 * k / n] * len(columns.split(",")))
    rows = [[run, k, top * k / n, *read(k, run)] for run in names for k in range(n)]
    lines = (",".join(str(cell) for cell in row) for row in rows)
    return f"run,time_s,{drive},{columns}\n" + "\n".join(lines) + "\n"


@pytest.fixture
def call(pliant, write):
    def caller(verb, study, *files, notes="", few=True, options=()):
        path = write(study)
        for number, text in enumerate(files):
            (path.parent / f"{'ab'[number]}.csv").write_text(text)
        if notes:
            (path.parent / "a.yaml").write_text(notes)
        given = [word for number in range(len(files)) for word in ("--data", f"{'ab'[number]}.csv")]
        asked = FEW if few and verb != "compare" else ()
        return pliant(verb, path, *given, *asked, *options)

    return caller


REST = "{run: custom, name: rest, words: rest, times: [0 s, 10 s], inputs: {pressure_pa: [0, 0]}}"


def linear(top: float):
    """Return the `read` function of a sensor that follows the drive to `top`."""
    return lambda k, run: [top * k / N]


def pitched(pitch):
    return table("angle_rad,base_pitch_rad", read=lambda k, run: [0.5 * k / N, pitch(k)])


WAVES = table(
    read=lambda k, run: [0.3 * np.sin(0.9 * k) + 0.01 * np.random.default_rng(7 * k + ord(run)).normal()]
)
TWO = ("--effect", "stiffness", "--effect", "actuation_gain")
# Verb, study, files, options, expected message.
SAID = [
    *(
        (verb, CHAIN, [table(f"angle_rad,{column}")], (), says.format(column))
        for verb, says in (
            ("compare", "Not compared, because the model or the file has no values of it: {}."),
            ("diagnose", "The model has no {}: left out."),
        )
        for column in ("joint_9_angle_rad", "marker_9_x_m")
    ),
    # In millimetres without a unit; in `diagnose` no effect can explain such readings.
    *(
        (verb, CHAIN, [table("tip_x_m", read=linear(15))], (), "Unit to check: tip_x_m")
        for verb in ("compare", "diagnose")
    ),
    ("diagnose", CHAIN, [pitched(lambda k: "" if k > 20 else 0.1)], (), "base_pitch_rad is blank in 38 rows"),
    ("diagnose", CHAIN, [pitched(lambda k: 90)], (), "Unit to check: base_pitch_rad"),
    ("diagnose", CHAIN, [table(), table("tip_x_m", "CD", read=linear(0.01))], (), ""),
    ("compare", JOINT, [table(), table(names="C", top=10.0)], (), (
        "b.csv: Unit to check: pressure_pa reaches only 9.75 Pa"
    )),
    ("plan", JOINT, [WAVES], TWO, "No listed effect explains the error"),
    ("plan", JOINT + TASK + f"protocols: [{REST}]\n", [], ("--effect", "thermal_softening"), (
        "No run of the menu shows any of these effects"
    )),
]  # fmt: skip


# One case represents the same cause under two verbs, or in two columns.
COSTLY = ("marker_9", "left out", "b.csv", "tip_x_m", "No listed effect", "check: base_pitch")
SLOW = [case for case in SAID if not case[-1] or any(word in case[-1] for word in COSTLY)]


@pytest.mark.parametrize("case", slow_among(SAID, *SLOW), ids=[f"{case[0]}, {case[-1]}" for case in SAID])
def test_what_is_doubtful_is_said(call, case) -> None:
    verb, study, files, options, says = case
    made = call(verb, study, *files, few=not options, options=options).done()
    assert says in " ".join(made.out.split()) and "Warning" not in made.err


@pytest.mark.parametrize("verb", ["compare", "diagnose", "plan", "improve"])
@pytest.mark.parametrize("column", ["joint_9_angle_rad", "marker_9_x_m", "elongation_strain"])
def test_an_output_that_the_chain_does_not_have(call, verb, column) -> None:
    call(verb, CHAIN, table(column)).refused(
        "a.csv: the model has none of the measured outputs", column, "4 revolute joints"
    )


@pytest.mark.parametrize(
    ("study", "text", "notes", "words"),
    [
        (CHAIN, table("tip_x"), "", ["nothing is measured", "Columns that are not known: tip_x"]),
        (
            CHAIN,
            table("marker_1_x_m"),
            "markers: [300 mm]\n",
            ["marker 1 is said to sit 0.3 m", "0.044 m long"],
        ),
        (CHAIN, table("marker_1_x_m"), "markers: {1: 3 mm}\n", ["'markers' is {1: 3 mm}; it needs a list"]),
        (OPPOSED, table(), "", ["is driven by 'pressure_1_pa'", "it has pressure_pa", "rename"]),
        (OPPOSED, table(drive="pressure_1_pa"), "", ["is driven by 'pressure_2_pa'", "it has pressure_1_pa"]),
        (JOINT, table(drive="pressure_1_pa"), "", ["is driven by 'pressure_pa'", "it has pressure_1_pa"]),
        (JOINT, COUNTS, "", ["a.csv is a file of counts", "it has no 'task'"]),
    ],
)
@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_a_file_that_does_not_fit_the_chain(call, verb, study, text, notes, words) -> None:
    call(verb, study, text, notes=notes).refused(*words)


@pytest.mark.parametrize("verb", ["compare", "diagnose", "plan"])
def test_the_same_file_twice_is_no_repeat(call, verb) -> None:
    call(verb, JOINT, table(), table()).refused("b.csv holds the same as a.csv", "give it once")


def test_files_driven_by_different_inputs(call) -> None:
    call("diagnose", JOINT, table(), table(drive="tendon_force_n", names="C")).refused(
        "b.csv: the chain is driven by 'pressure_pa'", "it has tendon_force_n"
    )


@pytest.mark.slow
def test_the_same_run_in_two_files_gets_a_separate_name(call, read) -> None:
    again = table(read=lambda k, run: [0.5 * k / N + 0.002 * np.sin(9 * k)])
    call("compare", JOINT, table(), again, options=("--json", "out.json")).done()
    assert read("out.json")["data"] == "a.csv + b.csv"


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_counts_come_in_one_file(call, verb) -> None:
    call(verb, JOINT + TASK, COUNTS, table()).refused("a.csv is a file of counts", "b.csv would not be read")
    call(verb, JOINT + TASK, table(), COUNTS).refused("b.csv: the file holds counts")


def test_repeats_that_contradict_one_another_are_not_repeatable(call, read) -> None:
    def moved(k, run):
        noise = 0.002 * np.random.default_rng(7 * k + ord(run)).normal()
        return [0.5 * k / 240 + (0.05 if run in "BD" else 0.0) + noise]

    made = call(
        "diagnose", JOINT, table(names="ABCD", n=240, read=moved), options=("--json", "out.json")
    ).done()
    found = read("out.json")
    assert (found["verdict"], found["selected"]) == ("not_repeatable", [])
    assert "times as much as readings within a run" in " ".join(made.out.split())
    assert "three times" in found["next_experiment"]["run"]


def test_a_menu_without_a_run_that_could_decide_says_so(call, workplace) -> None:
    histories = [ramp(f"slow{k}", 500.0, 1.0, (6e3, 0.0)) for k in range(2)]
    write_measurement(measured(joint(), histories, effect("stiffness"), seed=4), workplace / "bench.csv")
    made = call(
        "plan",
        JOINT + f"protocols: [{REST}]\n",
        few=False,
        options=("--data", "bench.csv", "--effect", "stiffness", "--effect", "actuation_gain"),
    ).done()
    assert "No run of the menu would decide between the explanations that are left" in " ".join(
        made.out.split()
    )


@pytest.mark.parametrize(
    ("run", "words"),
    [
        ("{run: slow_cycle}", ["line 11", "did you mean 'slow_cycles'?"]),
        ("{run: holds, period: 3 s}", ["line 11", "run 'holds' takes no 'period'; it takes levels, hold"]),
        ("{run: holds, levels: [5 N]}", ["'5 N' is a force; it needs a pressure", "driven by pressure_pa"]),
        ("{run: slow_cycles, amplitudes: [5 kg]}", ["'5 kg' is a mass"]),
        ("{run: holds, levels: [5000]}", ["5000 would be a share of the largest drive; write a unit"]),
        ("{run: holds, levels: [.nan]}", ["finite number"]),
        ("{run: holds, minutes: -1}", ["'protocols.0.minutes' is -1; it should be greater than 0"]),
        ("{run: holds}, {run: holds}", ["run 'holds' twice; give one of them another 'name'"]),
        ("{run: custom, times: [0 s, 1 s], inputs: {pressure_pa: [0, 1 kPa]}}", ["needs a 'name'"]),
        (
            "{run: custom, name: x, times: [0 s, 0 s], inputs: {pressure_pa: [0, 1 kPa]}}",
            ["'times' must increase"],
        ),
        ("{run: custom, name: x, times: [0 s, 1 s], inputs: {pressure_pa: [0]}}", ["1 value for 2 times"]),
        (
            "{run: custom, name: x, times: [0 s, 1 s], inputs: {pressur_pa: [0, 1]}}",
            ["did you mean 'pressure_pa'?"],
        ),
    ],
)
def test_protocols_that_cannot_be(call, run, words) -> None:
    call("plan", JOINT + TASK + f"protocols: [{run}]\n").refused(*words)


@pytest.mark.parametrize(
    ("study", "words"),
    [(NO_LAW, "surrogate 'polynomial' needs data"), (JOINT[: JOINT.index("chain")], "has no 'chain' block")],
)
def test_a_plan_needs_a_law_and_a_chain(call, study, words) -> None:
    call("plan", study).refused(words)


def test_loads_under_which_nothing_stands(call) -> None:
    made = call("diagnose", CHAIN, table("angle_rad,moment_n_m", read=lambda k, run: [0.5 * k / N, 50]))
    assert made.code == 3
    assert "no equilibrium in any of the measured states" in made.err
