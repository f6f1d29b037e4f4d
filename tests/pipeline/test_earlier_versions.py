"""Files of commit 13594f6 open today: its study, its store, its run folder; its FEM data are reused."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.command import called
from tests.slow import slow_among

from pliant import api
from pliant.pipeline import dataset
from pliant.store.store import ARRAYS, MANIFEST, _json_digest, digests, load_artifact

EARLIER = Path(__file__).resolve().parents[1] / "data" / "of_13594f6"
STUDIES = ("finger.yaml", "extended.yaml")


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a writable copy of the earlier folder; data adopted by one command are found by the next ones."""
    return Path(shutil.copytree(EARLIER, tmp_path_factory.mktemp("of") / "earlier"))


def _json(folder: Path, *arguments: str) -> dict:
    """Return the JSON of a command that succeeds."""
    target = folder / "answer.json"
    options = [] if arguments[0] == "report" else ["--store", str(folder / "store"), "--json", str(target)]
    called(*arguments, *options).done()
    return json.loads(target.read_text()) if options else {}


def _newest(folder: Path) -> dict:
    manifests = [json.loads(file.read_text()) for file in (folder / "store" / "fem").glob(f"*/{MANIFEST}")]
    return next(m for m in manifests if m["key"] != next((EARLIER / "store" / "fem").iterdir()).name)


@pytest.mark.slow
def test_fem_data_are_adopted_and_give_the_same_run(earlier: Path) -> None:
    before = json.loads((EARLIER / "run" / "run.json").read_text())["summary"]
    after = _json(earlier, "run", str(earlier / "finger.yaml"), "--out", str(earlier / "again"))
    assert _newest(earlier)["adopted"] == next((EARLIER / "store" / "fem").iterdir()).name
    np.testing.assert_allclose(
        after["simulate"]["markers_m"], before["simulate"]["markers_m"], rtol=0, atol=1e-12
    )


class SolvedAnewError(Exception):
    """Raised in place of a solution that would take minutes."""


@pytest.mark.slow
def test_data_that_today_s_code_does_not_give_are_solved_anew(tmp_path: Path, monkeypatch) -> None:
    earlier = Path(shutil.copytree(EARLIER, tmp_path / "earlier"))
    (folder,) = (earlier / "store" / "fem").iterdir()
    with np.load(folder / ARRAYS) as file:
        arrays = dict(file)
    value = json.loads((folder / "value.json").read_text())
    tau = value["fields"]["tau"]["__array__"]
    arrays[tau] = 1.001 * arrays[tau]
    np.savez_compressed(folder / ARRAYS, **arrays)
    manifest = json.loads((folder / MANIFEST).read_text()) | {"files": digests(folder)}
    manifest["digest"] = _json_digest({k: v for k, v in manifest.items() if k != "digest"})
    (folder / MANIFEST).write_text(json.dumps(manifest))
    assert load_artifact(folder).key == folder.name, "the changed artifact is sound in itself"

    def sample(*_: object) -> None:
        raise SolvedAnewError

    monkeypatch.setattr(dataset, "sample", sample)
    with pytest.raises(SolvedAnewError):
        _json(earlier, "fem", str(earlier / "finger.yaml"), "--out", str(earlier / "fem"))


@pytest.mark.slow
def test_the_run_folder_gives_its_report(earlier: Path) -> None:
    _json(earlier, "report", str(earlier / "run"))
    assert (earlier / "run" / "report.html").stat().st_size > 100_000


@pytest.mark.parametrize("study", slow_among(STUDIES, "finger.yaml"))
def test_studies_are_fitted_and_compared(earlier: Path, study: str) -> None:
    before = json.loads((EARLIER / "run" / "run.json").read_text())["summary"]
    opened = api.open_study(earlier / study, store=earlier / "store")
    (fitted,) = api.laws(opened)
    assert fitted.law.report is not None
    assert fitted.law.report.rmse == pytest.approx(before["fit"]["heldout"]["rmse"], rel=1e-9)
    assert api.compare(opened).outputs["angle_rad"].n == 12
