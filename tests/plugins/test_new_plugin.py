"""`pliant new-plugin`: its files, and refused names; skeletons are installed in `test_contrib.py`."""

from __future__ import annotations

from pathlib import Path

import pytest

from pliant.cli.plugins import create_package
from pliant.errors import UserError


def test_gives_the_files_that_it_wrote(tmp_path: Path) -> None:
    files = create_package("pliant-lossy_Supply", tmp_path / "new", "effect")
    root = tmp_path / "new" / "pliant-lossy_Supply"
    assert sorted(files) == sorted(path for path in root.rglob("*") if path.is_file())
    manifest = (root / "src" / "pliant_lossy_supply" / "manifest.py").read_text()
    assert 'kind="lossy_supply"' in manifest
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["pliant-lossy_Supply"]


@pytest.mark.parametrize(
    ("name", "interface", "says"),
    [
        *((name, "effect", "no name for a package") for name in ("my finger", "-finger", "../up")),
        *((name, "effect", "would hide") for name in ("json", "pliant")),
        ("effect", "effect", "cannot be a kind"),
        ("my-finger", "familly", "is no interface; did you mean 'family'"),
        ("my-finger", "viewer", "has no skeleton yet"),
        ("full", "effect", "not empty"),
    ],
)
def test_what_cannot_be_made_is_refused_and_nothing_is_written(
    tmp_path: Path, name: str, interface: str, says: str
) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").write_text("mine")
    with pytest.raises(UserError, match=says):
        create_package(name, tmp_path, interface)
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["full", "notes.txt"]


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        create_package("my-finger", tmp_path / "file")


def test_an_interruption_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Path, text: str, encoding: str | None = None) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", fail)
    with pytest.raises(UserError, match="No space left"):
        create_package("my-finger", tmp_path)
    assert not list(tmp_path.iterdir())
