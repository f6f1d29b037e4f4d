"""Exchange of a study with its artifacts: the same report, nothing solved, and nothing in an archive but data."""

import json
import re
import shutil
import zipfile
from pathlib import Path

import pytest
from tests.cli.conftest import pliant, workplace, write  # noqa: F401 - fixtures
from tests.command import called
from tests.plugins.test_own_file import EFFECT

from pliant.errors import UserError
from pliant.store import archive as module
from pliant.store.archive import import_archive
from pliant.store.inventory import damaged, entries, prune, to_prune
from pliant.store.store import ArtifactStore, Recipe

TABLE = Path(__file__).parents[2] / "examples/data/bellow_bending.csv"
STUDY = """\
pliant: 1
name: taken-along
surrogate: {kind: polynomial, data: tables/states.csv}
chain: {modules: 3, module_length: 11 mm, gravity: [0, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 10 kPa}
"""
DATES = re.compile(r"20\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\+00:00)?|\d+(\.\d+)? (s|ms|µs)\b")


def kept(root, studies=("a",), count=2):
    for study in studies:
        store = ArtifactStore(root, study)
        for k in range(count):
            store.make(Recipe("laws", {"k": k}, {}, "", {}), lambda parts, k=k: {"value": k})
    return entries(root)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Return a study that ran at home, and its archive."""
    place = tmp_path_factory.mktemp("ran")
    (place / "home/tables").mkdir(parents=True)
    shutil.copy(TABLE, place / "home/tables/states.csv")
    (place / "home/study.yaml").write_text(STUDY)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for call in ("run home/study.yaml --out home/run", "store --export home/study.yaml --out study.zip"):
            called(*call.split(), "--store", "home/store").done()
    return place


@pytest.fixture
def exported(ran, workplace):  # noqa: F811
    """Return a copy of both, in the working folder."""
    shutil.copytree(ran, workplace, dirs_exist_ok=True)
    return Path("study.zip")


def test_a_report_comes_back_elsewhere_and_nothing_is_solved(exported, pliant):  # noqa: F811
    Path("home").rename("gone")
    call = pliant("store", "--import", exported, "--out", "away", "--store", "other").done()
    assert "new in other" in call.out
    before = {(e.stage, e.key): e.created for e in entries(Path("other"))}
    pliant("run", "away/study.yaml", "--out", "run", "--store", "other", "--json", "run.json").done()
    after = {(e.stage, e.key): e.created for e in entries(Path("other"))}
    assert {key: date for key, date in after.items() if key[0] != "report"} == before and before
    pages = [DATES.sub("…", Path(place, "report.html").read_text()) for place in ("gone/run", "run")]
    assert pages[0] == pages[1] and len(pages[0]) > 10_000
    pictures = [
        {p.name: p.read_bytes() for p in Path(place, "pictures").glob("*")} for place in ("gone/run", "run")
    ]
    assert pictures[0] == pictures[1] and pictures[0]
    pliant("store", "--import", exported, "--out", "away", "--store", "other").refused(
        "away is there already"
    )


def test_the_store_says_what_belongs_to_which_study(exported, pliant):  # noqa: F811
    call = pliant("store", "--store", "home/store", "--json", "store.json").done()
    data = json.loads(Path("store.json").read_text())
    assert "taken-along" in call.out and {"fit", "simulate"} <= {one["stage"] for one in data["stages"]}
    assert all(one["studies"] == ["taken-along"] and one["wall_s"] >= 0 for one in data["artifacts"])
    assert sum(one["size_bytes"] for one in data["artifacts"]) == data["size_bytes"]
    Path("other.yaml").write_text(STUDY.replace("taken-along", "unknown").replace("tables/", "home/tables/"))
    pliant("store", "--export", "other.yaml", "--store", "home/store").refused(
        "no results of study 'unknown'"
    )
    pliant("store", "--verify", "--older", 3).refused("give one of")


def test_verify_finds_a_changed_byte_and_pruning_takes_the_oldest(tmp_path, workplace, pliant):  # noqa: F811
    first, second = kept(tmp_path / "s", ("a", "b"))
    assert first.studies == second.studies == ("a", "b")
    pliant("store", "--verify", "--store", tmp_path / "s").done()
    value = second.folder / "value.json"
    value.write_bytes(value.read_bytes().replace(b"1", b"2"))
    assert [(entry, "checksum" in cause) for entry, cause in damaged([first, second])] == [(second, True)]
    assert second.key in pliant("store", "--verify", "--store", tmp_path / "s").done(3).out
    assert to_prune([first, second], older_s=1e6) == []
    assert to_prune([first, second], most_bytes=first.size_bytes + second.size_bytes) == []
    gone = to_prune([first, second], most_bytes=second.size_bytes)
    assert len(gone) == 1 and prune(gone) == gone and len(entries(tmp_path / "s")) == 1
    call = pliant("store", "--older", 0, "--store", tmp_path / "s").done()
    assert "1 artifact taken away" in call.out and entries(tmp_path / "s") == []
    assert not list((tmp_path / "s").rglob("*.json"))


def test_what_is_being_made_is_not_pruned(tmp_path):
    (entry,) = kept(tmp_path, count=1)
    with module_lock(entry):
        assert prune([entry]) == []
    assert prune([entry]) == [entry]


def module_lock(entry):
    from filelock import FileLock

    return FileLock(entry.folder.with_name(f"{entry.key}.lock"))


def changed(source, target, change):
    """Return a copy of an archive with the pairs that `change(name, content)` returns for its files."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            for other, content in change(name, old.read(name)):
                new.writestr(other, content)
    return target


def change_part(part, change):
    """Change the files whose names contain this part."""
    return lambda name, data: change(name, data) if part in name else [(name, data)]


INDEX = "archive.json"
HARMFUL = {
    "a path out": change_part(INDEX, lambda name, data: [(name, data), ("../../harm", b"x")]),
    "an absolute path": change_part(INDEX, lambda name, data: [(name, data), ("/tmp/pliant-harm", b"x")]),
    "a path out of the study": change_part("study/study", lambda name, data: [("study/../study.yaml", data)]),
    "a hidden file": change_part("states.csv", lambda name, data: [("study/files1/.bashrc", data)]),
    "a file beside an artifact": change_part(
        "value.json", lambda name, data: [(name.replace("json", "pkl"), data)]
    ),
    "another value": change_part("value.json", lambda name, data: [(name, data.replace(b"0", b"1"))]),
    "another study": change_part(
        INDEX, lambda name, data: [(name, data.replace(b"taken-along", b"../../etc"))]
    ),
    "another file": change_part(
        INDEX, lambda name, data: [(name, data.replace(b"study.yaml", b"../x.yaml"))]
    ),
    "another format": change_part(
        INDEX, lambda name, data: [(name, data.replace(b'format": 1', b'format": 7'))]
    ),
    "no index": change_part(INDEX, lambda name, data: []),
    "a list as index": change_part(INDEX, lambda name, data: [(name, b"[1]")]),
}


def test_an_archive_is_data_and_no_path_leaves_its_folder(exported, tmp_path):
    inside = tmp_path / "inside"
    for name, change in HARMFUL.items():
        wrong = changed(exported, tmp_path / "wrong.zip", change)
        with pytest.raises(UserError, match="archive|format|damaged|holds"):
            import_archive(wrong, inside / "store", inside / "out")
        left = [p for p in inside.rglob("*") if p.is_file()]
        assert left == [], name
    assert not Path("/tmp/pliant-harm").exists() and not (tmp_path / "harm").exists()


def test_the_unpacked_archive_size_is_bounded(exported, tmp_path, monkeypatch):
    bomb = changed(exported, tmp_path / "bomb.zip", lambda name, data: [(name, data + b" " * 10_000_000)])
    assert bomb.stat().st_size < 2_000_000
    monkeypatch.setattr(module, "UNPACKED", 5_000_000)
    with pytest.raises(UserError, match="unpacks to more than"):
        import_archive(bomb, tmp_path / "store", tmp_path / "out")
    monkeypatch.setattr(module, "UNPACKED", 1000)
    with pytest.raises(UserError, match="unpack"):
        import_archive(exported, tmp_path / "store", tmp_path / "out")
    assert [p for p in (tmp_path / "store").rglob("*") if p.is_file()] == []


def test_code_in_an_archive_is_named_and_does_not_run(workplace, pliant):  # noqa: F811
    Path("tables").mkdir()
    shutil.copy(TABLE, "tables/states.csv")
    Path("mine.py").write_text(f"{EFFECT}\nopen('ran', 'w').close()\n")
    Path("study.yaml").write_text(STUDY + "plugins: [mine.py]\n")
    pliant("run", "study.yaml").done()
    pliant("store", "--export", "study.yaml", "--out", "s.zip").done()
    Path("ran").unlink()
    call = pliant("store", "--import", "s.zip", "--out", "away", "--store", "other").done()
    assert "mine.py" in call.out and "read it first" in call.out and not Path("ran").exists()
