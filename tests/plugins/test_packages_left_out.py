"""Each feature package can be absent: the other commands work, and its own verb is unknown in one sentence."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.cli.conftest import STATED
from tests.cli.search_study import STUDY
from tests.pliant_counts import counts_study

VERB_OF = {
    "app": "app",
    "bench": "experiment",
    "calibrate": "calibrate",
    "export": "export",
    "search": "optimize",
    "view": "render",
}


def without(entry: str, folder: Path) -> dict[str, str]:
    """Return an environment whose `pliant` distribution lacks one entry point of the group `pliant`."""
    files = importlib.metadata.distribution("pliant").files or []
    info = next(Path(str(file.locate())).parent for file in files if file.name == "entry_points.txt")
    shutil.copytree(info, folder / info.name)
    table = folder / info.name / "entry_points.txt"
    lines = table.read_text().splitlines()
    kept = [line for line in lines if not line.startswith(f"{entry} = pliant_")]
    assert len(kept) == len(lines) - 1
    table.write_text("\n".join(kept) + "\n")
    search = [str(folder), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    path = os.pathsep.join(str(Path(one).resolve()) for one in search if one)
    return {**os.environ, "PYTHONPATH": path}


def called(environment: dict[str, str], folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `pliant` with these arguments."""
    command = [sys.executable, "-m", "pliant", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("entry", VERB_OF)
def test_the_rest_works_without_a_package(entry: str, tmp_path: Path) -> None:
    environment = without(entry, tmp_path / "site")
    (tmp_path / "study.yaml").write_text(STATED)
    listed = called(environment, tmp_path, "--help")
    names = {
        line.split()[1]
        for line in listed.stdout.splitlines()
        if line.startswith("│ ") and line[2:3].islower()
    }
    assert listed.returncode == 0 and {"run", "compare", "diagnose"} <= names
    assert VERB_OF[entry] not in names and set(VERB_OF.values()) - {VERB_OF[entry]} <= names
    done = called(environment, tmp_path, "run", "study.yaml")
    assert done.returncode == 0, done.stderr
    missing = called(environment, tmp_path, VERB_OF[entry], "study.yaml")
    assert missing.returncode == 2 and f"No such command '{VERB_OF[entry]}'" in missing.stderr
    assert "Traceback" not in missing.stderr


def test_a_study_with_blocks_from_an_absent_package_names_the_package(tmp_path: Path) -> None:
    environment = without("search", tmp_path / "site")
    (tmp_path / "study.yaml").write_text(STUDY)
    done = called(environment, tmp_path, "run", "study.yaml")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    (sentence,) = done.stderr.splitlines()
    assert (
        "'search' and 'optimizer' belong to the package pliant_search" in sentence and "line 12" in sentence
    )
    script = "import pliant; pliant.open('stated.yaml').optimize()"
    (tmp_path / "stated.yaml").write_text(STATED)
    command = [sys.executable, "-c", script]
    python = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (
        "MissingDependencyError: 'optimize' belongs to the package pliant_search"
        in python.stderr.splitlines()[-1]
    )


def test_the_search_works_without_ppo_whose_kind_names_its_package(tmp_path: Path) -> None:
    environment = without("ppo", tmp_path / "site")
    listed = called(environment, tmp_path, "plugins")
    assert "cmaes" in listed.stdout and " ppo " not in listed.stdout
    (tmp_path / "study.yaml").write_text(STUDY)
    done = called(environment, tmp_path, "optimize", "study.yaml", "optimizer.kind=ppo")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "optimizer 'ppo' belongs to the package pliant_ppo, which is missing" in " ".join(
        done.stderr.split()
    )


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_counts_without_their_package_name_it(verb: str, tmp_path: Path) -> None:
    environment = without("counts", tmp_path / "site")
    (tmp_path / "study.yaml").write_text(counts_study.STUDY)
    (tmp_path / "counts.csv").write_text(f"{counts_study.HEADER}a,egg,15,2,10,10\n")
    done = called(environment, tmp_path, verb, "study.yaml")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "counts belong to the package pliant_counts" in " ".join(done.stderr.split())


def test_the_rest_works_without_sweeps_and_meta_models(tmp_path: Path) -> None:
    environment = without("designs", tmp_path / "site")
    (tmp_path / "study.yaml").write_text(STATED)
    assert called(environment, tmp_path, "run", "study.yaml").returncode == 0
    listed = called(environment, tmp_path, "plugins")
    assert "polynomial" in listed.stdout and "meta_model" not in listed.stdout
    (tmp_path / "study.yaml").write_text(f"{STATED}\nsweep: {{radius: [5 mm]}}\nmeta_model: regression\n")
    for verb in ("fem", "fit"):
        done = called(environment, tmp_path, verb, "study.yaml")
        assert done.returncode == 2 and "Traceback" not in done.stderr
        sentence = " ".join(done.stderr.split())
        assert "'sweep' and 'meta_model' belong to the package pliant_designs" in sentence


def test_a_diagnosis_works_without_learned_terms_and_improve_names_their_package(tmp_path: Path) -> None:
    environment = without("learned", tmp_path / "site")
    example = called(environment, tmp_path, "example", "hidden-effect")
    assert example.returncode == 0, example.stderr
    folder = next(path.parent for path in tmp_path.glob("*/finger.yaml"))
    options = ("--effect", "stiffness", "--effect", "sensor_bias")
    done = called(environment, folder, "diagnose", "finger.yaml", "--no-page", *options)
    assert done.returncode == 0 and "A learned term would" not in done.stdout, done.stderr
    done = called(environment, folder, "improve", "finger.yaml", "--learned", *options)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "a learned term belongs to the package pliant_learned" in " ".join(done.stderr.split())
