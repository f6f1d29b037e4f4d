"""The artifact store: content-addressed, atomic, shared by processes, no pickle, corruption found."""

import json
import multiprocessing
import time
from pathlib import Path

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.records.design import Design
from pliant.store.codec import decode, encode
from pliant.store.store import ArtifactStore, CorruptedError, Recipe, load_artifact, write_atomically


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


def test_the_order_of_keys_does_not_matter():
    assert recipe(config={"a": 1, "b": 2}).key == recipe(config={"b": 2, "a": 1}).key


def test_the_manifest_tells_where_it_came_from(tmp_path):
    manifest = ArtifactStore(tmp_path).make(recipe(), lambda partial: 1).manifest
    for key in ("pliant", "config", "inputs", "code", "wall_s", "created", "python", "platform", "files"):
        assert key in manifest


@pytest.mark.parametrize("file", ["value.json", "arrays.npz", "manifest.json"])
@pytest.mark.parametrize("damage", ["truncate", "flip", "delete"])
def test_a_corrupted_artifact_is_noticed_told_and_computed_anew(tmp_path, file, damage):
    store, notes = ArtifactStore(tmp_path), []
    made = store.make(recipe(), lambda partial: value())
    path = made.folder / file
    data = path.read_bytes()
    if damage == "delete":
        path.unlink()
    else:
        path.write_bytes(data[: len(data) // 2] if damage == "truncate" else b"#" + data[1:])
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


@pytest.mark.parametrize("thing", [object(), lambda: 0, np.array([object()]), {1, 2}])
def test_only_plain_records_are_stored(thing):
    with pytest.raises(TypeError):
        encode(thing, {})


def test_a_file_cannot_name_other_classes():
    with pytest.raises(ValueError, match="unknown record"):
        decode({"__record__": "Popen", "fields": {"args": "true"}}, {})


def test_pickled_arrays_are_refused(tmp_path):
    made = ArtifactStore(tmp_path).make(recipe(), lambda partial: value())
    with (made.folder / "arrays.npz").open("wb") as file:
        np.savez(file, a0000=np.array([Design("x", {})], dtype=object))
    manifest = json.loads((made.folder / "manifest.json").read_text())
    import hashlib

    digest = hashlib.sha256((made.folder / "arrays.npz").read_bytes()).hexdigest()
    manifest["files"]["arrays.npz"] = digest
    (made.folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(CorruptedError, match="allow_pickle"):
        load_artifact(made.folder)


def test_writing_a_file_is_all_or_nothing(tmp_path):
    path = tmp_path / "out.json"
    write_atomically(path, "old")
    with pytest.raises(TypeError):
        write_atomically(path, None)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["out.json"]
