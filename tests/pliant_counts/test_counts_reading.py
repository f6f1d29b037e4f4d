"""Files of counts: accepted content, and refusals with their line."""

import pytest
from tests.pliant_counts.counts_study import HEADER, STUDY

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.measurements.reading import read_measurement
from pliant.registry.discovery import discover
from pliant_counts.reading import read_counts
from pliant_counts.recognition import holds_counts
from pliant_counts.task_keys import changed_task


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "study.yaml"
    path.write_text(STUDY)
    return load_study(path, discover())


@pytest.fixture
def read(tmp_path, study):
    def reading(text, notes=None):
        (tmp_path / "counts.csv").write_text(text)
        if notes is not None:
            (tmp_path / "counts.yaml").write_text(notes)
        return read_counts(tmp_path / "counts.csv", study.noisy_task(), study.measurements)

    return reading


def test_rows_in_one_condition_are_its_sets(read, study):
    found = read(HEADER + "a,egg,13,6,6,10\nb,cylinder,13,2,9,10\nc,egg,13,6,7,10\n")
    assert [c.words for c in found.conditions] == ["egg, 6 extra weights", "cylinder, 2 extra weights"]
    egg, cylinder = found.conditions
    assert (egg.successes, egg.trials, [s.name for s in egg.sets]) == (13, 20, ["a", "c"])
    assert [s.line for s in egg.sets] == [2, 4]
    task = changed_task(study.noisy_task(), cylinder.changes)
    assert (task.object.shape, task.pressure_pa, task.extra_weights) == ("cylinder", 13000.0, 2)
    assert task.noise.friction == 0.05  # the study's noise is kept
    assert found.trials == 30 and found.sha256


def test_a_german_counts_table(read, study):
    found = read("Messung;pressure [mbar];Versuche;Erfolge;Notiz\na;130,5;10;6;x\nb;130,5;10;7;y\n")
    (condition,) = found.conditions
    assert (condition.successes, condition.trials, condition.sets[1].name) == (13, 20, "b")
    task = changed_task(study.noisy_task(), condition.changes)
    assert task.pressure_pa == pytest.approx(13050.0)


def test_counts_and_readings_do_not_mix_whatever_they_are_called(read):
    with pytest.raises(UserError, match="two files"):
        read("successes,trials,Winkel [°]\n1,2,3\n")


def test_keys_may_be_dotted_and_in_other_units(read, study):
    found = read(
        "task.object.radius_mm,inclination_deg,friction,successes,trials\n15,28,0.7,1,2\n16,30,0.8,2,2\n"
    )
    task = changed_task(study.noisy_task(), found.conditions[0].changes)
    assert task.object.radius_m == pytest.approx(0.015)
    assert task.inclination_rad == pytest.approx(0.488692, rel=1e-5)
    assert task.friction == 0.7


def test_notes_say_what_a_column_sets(read, study):
    notes = """\
rename: {won: successes}
conditions:
  kg: task.extra_weights
  thing:
    key: task.object
    values: {tall: {shape: cylinder, height: 50 mm}, usual: cylinder}
"""
    found = read("thing,kg,won,trials\ntall,1,3,10\nusual,1,4,10\n", notes)
    tasks = [changed_task(study.noisy_task(), c.changes) for c in found.conditions]
    assert [t.object.height_m for t in tasks] == [0.05, None]
    assert [c.words for c in found.conditions] == ["tall", "usual"]


def test_other_columns_are_said_and_ignored(read):
    found = read("object,operator,successes,trials\negg,ann,3,10\negg,bob,4,10\n")
    assert len(found.conditions) == 1
    assert any("'operator'" in r and "repeats" in r for r in found.remarks)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("a,egg,13,2,11,10", "11 successes are more than 10 trials"),
        ("a,egg,13,2,-1,10", "successes is -1; a count is not negative"),
        ("a,egg,13,2,1,-10", "trials is -10"),
        ("a,egg,13,2,2.5,10", "successes is 2.5; a count is a whole number"),
        ("a,egg,13,2,0,0", "trials is 0"),
        ("a,egg,13,2,,10", "successes is blank"),
        ("a,egg,13,2,3,", "trials is blank"),
        ("a,egg,13,2,three,10", "'three' is not a number"),
        ("a,egg,13,2,inf,10", "infinite"),
        ("a,egg,,2,1,10", "pressure_kpa is blank"),
        ("a,eg,13,2,1,10", "did you mean 'egg'"),
        ("a,egg,13,many,1,10", "extra_weights"),
        ("a,egg,13,-2,1,10", "extra_weights"),
        ("a,egg,much,2,1,10", "pressure"),
        ("a,egg,13,2,1", "5 cells"),
    ],
)
def test_rows_that_cannot_be_are_listed_with_their_line(read, row, said):
    with pytest.raises(UserError) as caught:
        read(HEADER + "a,egg,13,2,9,10\n" + row + "\n")
    assert "line 3" in str(caught.value) and said in str(caught.value)
    assert "1 problem" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("object,successes\negg,3\n", "'trials' is not there"),
        ("object,trials\negg,3\n", "'successes' is not there"),
        ("object,trial,successes\negg,3,3\n", "did you mean 'trial'"),
        ("objekt,successes,trials\negg,3,4\n", "did you mean 'object'"),
        ("task.colour,successes,trials\nred,3,4\n", "'task.colour', which is no key of the study's task"),
        ("object.radios,successes,trials\n15,3,4\n", "did you mean 'object.radius'"),
        ("task.seed,successes,trials\n1,3,4\n", "no key of the study's task"),
        ("pressure_pa,pressure_kpa,successes,trials\n1,1,3,4\n", "both set task.pressure_pa"),
        ("object,angle_rad,successes,trials\negg,0.1,3,4\n", "put them into two files"),
        ("object,successes,trials\n", "a header and no rows"),
    ],
)
def test_files_that_say_too_little_or_too_much(read, text, said):
    with pytest.raises(UserError) as caught:
        read(text)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("notes", "said"),
    [
        ("conditions: {thing: task.objekt}", "did you mean 'task.object'"),
        ("conditions: {things: task.object}", "'conditions' has 'things', which is not a column"),
        ("conditions: {thing: {key: task.object, values: {egg: egg}}}", "gives no value"),
        ("conditions: {thing: {kye: task.object}}", "'kye'"),
    ],
)
def test_notes_that_name_what_is_not_there(read, notes, said):
    with pytest.raises(UserError) as caught:
        read("thing,successes,trials\ncube,3,4\n", notes)
    assert said in str(caught.value)


def test_a_counts_file_is_recognised_by_its_columns(tmp_path, study):
    path = tmp_path / "any.csv"
    task = study.noisy_task()
    for header, counted, of_a_chain in (
        ("object,successes,trials", True, True),
        ("pressure_pa,angle_rad", False, False),
        (
            "pressure_pa,angle_rad,successes,trials",
            True,
            False,
        ),  # refused for a grasp; for a chain these are readings
    ):
        path.write_text(header + "\n")
        assert holds_counts(path, task) is counted
        assert holds_counts(path, None) is of_a_chain


def test_verbs_that_need_readings_say_which_take_counts(tmp_path):
    (tmp_path / "counts.csv").write_text("pressure_pa,successes,trials\n15000,3,4\n")
    with pytest.raises(UserError, match="holds counts .* and no readings"):
        read_measurement(tmp_path / "counts.csv")
