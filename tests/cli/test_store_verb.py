"""`pliant store` counts finished artifacts and not those being written."""

import json

from pliant.report.store import store_document
from pliant.store.store import ArtifactStore, Recipe


def test_finished_artifacts_are_counted(tmp_path, capsys):
    kept = ArtifactStore(tmp_path / "store")
    for k in range(3):
        kept.make(Recipe("laws", {"k": k}, {}, {}, ""), lambda parts, k=k: {"value": k})
    (tmp_path / "store" / "states" / "abc.partial").mkdir(parents=True)
    data = json.loads(json.dumps(store_document(tmp_path / "store").data))
    (stage,) = data["stages"]
    assert (stage["stage"], stage["artifacts"]) == ("laws", 3)
    files = [
        file
        for file in (tmp_path / "store" / "laws").rglob("*")
        if file.is_file() and ".lock" not in file.name
    ]
    assert stage["size_bytes"] == data["size_bytes"] == sum(file.stat().st_size for file in files) > 0
