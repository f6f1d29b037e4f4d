"""The artifact store: content-addressed, atomic, shared by processes, no pickle, corruption detected."""

import json
import multiprocessing
import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.records.design import Design
from pliant.store.codec import decode, encode
from pliant.store.store import (
    ArtifactStore,
    CorruptedError,
    Recipe,
    digests,
    load_artifact,
    read_checked,
    write_atomically,
)


def recipe(**changes):
    values = {"stage": "fem", "config": {"a": 1}, "inputs": {}, "code": "c", "libraries": {}, **changes}
    return Recipe(**values)


def value():
    return {
        "design": Design("bellow", {"wall_m": 0.1}),
        "x": np.arange(6.0).reshape(2, 3),
        "t": (1, "two", None),
    }


def test_a_second_make_computes_nothing_and_reads_the_same_bits(tmp_path):
    store, calls = ArtifactStore(tmp_path), []

    def compute(partial):
        calls.append(1)
        return value()

    first = store.make(recipe(), compute)
    second = store.make(recipe(), compute)
    assert (len(calls), first.cached, second.cached) == (1, False, True)
    assert second.value["design"] == first.value["design"]
    assert second.value["x"].tobytes() == first.value["x"].tobytes()
    assert second.value["t"] == (1, "two", None)
    assert not second.value["x"].flags.writeable


@pytest.mark.parametrize(
    "change",
    [
        {"stage": "fit"},
        {"config": {"a": 2}},
        {"inputs": {"d": "1"}},
        {"code": "d"},
        {"libraries": {"numpy": "9"}},
    ],
)
def test_every_ingredient_changes_the_key(change):
    assert recipe(**change).key != recipe().key
    assert recipe(config={"a": 1, "b": 2}).key == recipe(config={"b": 2, "a": 1}).key


@pytest.mark.parametrize("file", ["value.json", "arrays.npz", "manifest.json"])
@pytest.mark.parametrize("damage", ["truncate", "flip", "delete", "empty"])
def test_a_corrupted_artifact_is_noticed_told_and_computed_anew(tmp_path, file, damage):
    store, notes = ArtifactStore(tmp_path), []
    made = store.make(recipe(), lambda partial: value())
    path = made.folder / file
    data = path.read_bytes()
    if damage == "delete":
        path.unlink()
    else:
        damaged = {"truncate": data[: len(data) // 2], "flip": b"#" + data[1:], "empty": b""}
        path.write_bytes(damaged[damage])
    again = store.make(recipe(), lambda partial: value(), notes.append)
    assert not again.cached
    assert "corrupted" in notes[0]
    assert "computing it anew" in notes[0]
    assert store.make(recipe(), lambda partial: value()).cached


def test_what_an_interrupted_computation_left_is_given_back(tmp_path):
    store = ArtifactStore(tmp_path)

    def interrupted(partial):
        (partial / "half").write_text("done")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.make(recipe(), interrupted)
    resumed = store.make(recipe(), lambda partial: (partial / "half").read_text())
    assert resumed.value == "done"
    assert not list(tmp_path.glob("*/*.partial"))


def test_a_failed_computation_leaves_no_artifact(tmp_path):
    store = ArtifactStore(tmp_path)
    with pytest.raises(ZeroDivisionError):
        store.make(recipe(), lambda partial: 1 / 0)
    assert not (tmp_path / "fem" / recipe().key).exists()
    assert not list(tmp_path.rglob(".writing-*"))


def _make_slowly(root, log):
    def compute(partial):
        with Path(log).open("a") as file:
            file.write("x")
        time.sleep(0.5)
        return 7

    assert ArtifactStore(Path(root)).make(recipe(), compute).value == 7


def test_an_artifact_appears_by_a_rename_whole_or_not_at_all(tmp_path, monkeypatch):
    complete = []

    def remembered(folder):
        complete.append(folder.stat().st_ino)
        return digests(folder)

    monkeypatch.setattr("pliant.store.store.digests", remembered)
    made = ArtifactStore(tmp_path).make(recipe(), lambda partial: value())
    (manifest,) = tmp_path.rglob("manifest.json")
    assert manifest.parent.stat().st_ino == complete[0]
    assert made.value["t"] == (1, "two", None)


def test_two_processes_on_one_store_compute_once(tmp_path):
    context = multiprocessing.get_context("spawn")
    log = tmp_path / "log"
    workers = [context.Process(target=_make_slowly, args=(str(tmp_path / "s"), str(log))) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
    assert [worker.exitcode for worker in workers] == [0, 0, 0]
    assert log.read_text() == "x"


def test_a_store_that_cannot_be_written_says_so(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        ArtifactStore(tmp_path / "file").make(recipe(), lambda partial: 1)


def test_a_file_cannot_name_other_classes():
    with pytest.raises(ValueError, match="unknown record"):
        decode({"__record__": "Popen", "fields": {"args": "true"}}, {})


def test_pickled_arrays_are_refused(tmp_path):
    made = ArtifactStore(tmp_path).make(recipe(), lambda partial: value())
    with (made.folder / "arrays.npz").open("wb") as file:
        np.savez(file, a0000=np.array([Design("x", {})], dtype=object))
    with pytest.raises(CorruptedError, match="allow_pickle"):
        read_checked(made.folder, digests(made.folder))


def test_writing_a_file_is_all_or_nothing(tmp_path):
    path = tmp_path / "out.json"
    write_atomically(path, "old")
    with pytest.raises(TypeError):
        write_atomically(path, None)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["out.json"]


def test_every_manifest_entry_is_covered_by_its_digest(tmp_path):
    made = ArtifactStore(tmp_path).make(recipe(), lambda partial: value())
    path = made.folder / "manifest.json"
    sound = json.loads(path.read_text())
    for name in sound:
        path.write_text(json.dumps({**sound, name: "other"}))
        with pytest.raises(CorruptedError):
            load_artifact(made.folder)
        path.write_text(json.dumps({k: v for k, v in sound.items() if k != name}))
        with pytest.raises(CorruptedError):
            load_artifact(made.folder)
    path.write_text(json.dumps(sound))
    assert load_artifact(made.folder).cached


@pytest.fixture
def permissions(tmp_path):
    """Skip where permissions have no effect, as for root."""
    probe = tmp_path / "probe"
    probe.touch(0o000)
    if os.access(probe, os.R_OK):
        pytest.skip("this user reads and writes everything")
    probe.unlink()


@pytest.mark.usefixtures("permissions")
def test_a_store_without_write_permission_serves_what_it_holds(tmp_path):
    store = ArtifactStore(tmp_path)
    made = store.make(recipe(), lambda partial: value())
    made.folder.parent.chmod(0o555)
    try:
        assert store.make(recipe(), lambda partial: 1 / 0).cached
        with pytest.raises(UserError, match="cannot be written"):
            store.make(recipe(code="new"), lambda partial: 1)
        made.folder.chmod(0o755)
        (made.folder / "value.json").write_text("{")
        with pytest.raises(UserError, match="cannot be written"):
            store.make(recipe(), lambda partial: 1)
    finally:
        made.folder.parent.chmod(0o755)


@pytest.mark.usefixtures("permissions")
def test_a_missing_permission_is_no_corruption(tmp_path):
    store = ArtifactStore(tmp_path)
    made = store.make(recipe(), lambda partial: value())
    (made.folder / "value.json").chmod(0)
    with pytest.raises(UserError, match="cannot be read"):
        store.make(recipe(), lambda partial: 1)
    (made.folder / "value.json").chmod(0o644)
    assert store.make(recipe(), lambda partial: 1).cached


def test_what_killed_processes_left_is_cleared(tmp_path):
    store, key = ArtifactStore(tmp_path), recipe().key
    (tmp_path / "fem" / f".writing-{key}-1").mkdir(parents=True)
    store.make(recipe(), lambda partial: 1)
    (tmp_path / "fem" / f"{key}.partial").mkdir()
    assert store.make(recipe(), lambda partial: 1).cached
    assert {p.name.replace(key, "KEY") for p in (tmp_path / "fem").iterdir()} <= {"KEY", "KEY.lock"}


def test_a_full_disk_is_one_sentence(tmp_path, monkeypatch):
    def full(file, **arrays):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(UserError, match="cannot be written .No space left on device."):
        ArtifactStore(tmp_path).make(recipe(), lambda partial: value())
    assert not list(tmp_path.rglob(".writing-*"))


def test_the_first_run_goes_on_with_what_later_runs_read(tmp_path):
    store = ArtifactStore(tmp_path)
    odd = {
        "numpy": np.float64(0.1),
        "single": np.float32(0.1),
        "flag": np.bool_(True),
        1: "a key that is no text",
        "nan": float("nan"),
        "infinite": [-np.inf, -0.0, 5e-324, 2**80, 1e308],
        "empty": np.zeros((0, 3)),
        "scalar": np.array(2.5),
        "words": np.array(["a", "bcd"]),
        "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    }
    first = store.make(recipe(), lambda partial: odd)
    second = store.make(recipe(), lambda partial: odd)
    assert repr(first.value) == repr(second.value)
    assert not first.value["empty"].flags.writeable
    assert not first.cached


@pytest.mark.parametrize("name", ["__record__", "__array__", "__tuple__", "__items__"])
def test_a_mapping_may_use_the_codec_words(name):
    thing = {"outer": {name: (1, {name: "Design"})}, name: 2}
    assert decode(json.loads(json.dumps(encode(thing, {}))), {}) == thing


THINGS = [
    object(),
    lambda: 0,
    np.array([object()]),
    {1, 2},
    1j,
    np.complex128(1j),
    np.longdouble(1),
    Path("x"),
]


@pytest.mark.parametrize("thing", [*THINGS, np.datetime64("2020-01-01")])
def test_only_plain_records_and_numbers_that_json_has_are_stored(thing):
    with pytest.raises(TypeError):
        encode(thing, {})


def test_what_lies_in_an_artifact_place_is_not_taken_for_it(tmp_path):
    store, notes = ArtifactStore(tmp_path), []
    other = store.make(recipe(code="other"), lambda partial: 1)
    assert (
        other.folder.stat().st_mode == other.folder.parent.stat().st_mode
    )  # others may read as the umask allows
    shutil.copytree(other.folder, other.folder.with_name(recipe().key))
    assert store.make(recipe(), lambda partial: 2, notes.append).value == 2
    assert "corrupted" in notes[0]
    (tmp_path / "fem" / recipe(code="file").key).write_text("junk")
    assert store.make(recipe(code="file"), lambda partial: 3).value == 3
