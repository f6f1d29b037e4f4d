"""Solve the data sets of this folder again: python examples/data/make.py [FAMILY ...] [--store DIR]

Each family has a study fem/<family>.yaml. Its states are written as <family>.csv, and what made them as
<family>.json: commit, study, versions, states, elements, wall time. States that are in the store are not solved again.
"""

from __future__ import annotations

import argparse
import datetime
import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

import pliant
from pliant import api
from pliant.config.design_parameters import material_parameters
from pliant.fem_tables.writing import write_table
from pliant.pipeline.study import solve_study_fem
from pliant.records.fem import ModuleData
from pliant.store.store import Artifact

HERE = Path(__file__).parent
FAMILIES = ("bellow_bending", "bellow_translational", "tendon_joint", "bellow_helical")


def make(family: str, store: Path) -> None:
    """Solve one family's study and write its two files."""
    opened = api.open_study(HERE / "fem" / f"{family}.yaml", store=store)
    (artifact,) = solve_study_fem(opened.context, opened.study)
    write_table(artifact.value, HERE / f"{family}.csv", material_parameters(opened.study.material))
    text = json.dumps(provenance(opened, artifact), indent=2, default=str)
    (HERE / f"{family}.json").write_text(text + "\n", encoding="utf-8")
    print(f"{family}: {len(artifact.value)} states", flush=True)


def provenance(opened: api.OpenStudy, artifact: Artifact) -> dict[str, Any]:
    """What made a data set."""
    study, data = opened.study, artifact.value
    assert isinstance(data, ModuleData)
    blocks = {name: getattr(study, name).canonical() for name in ("family", "material", "fem")}
    branches = {str(name): int(np.sum(data.branch == name)) for name in np.unique(data.branch)}
    return {
        "pliant": pliant.__version__,
        "commit": commit(),
        "made": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d"),
        **blocks,
        "versions": {**artifact.manifest["libraries"], **artifact.manifest["versions"]},
        "states": {"solved": len(data), **branches, "failed": len(data.failed)},
        "axes": list(data.axes),
        "sampling": data.sampling,
        "solver_wall_s": round(float(np.sum(data.wall_s)), 1),
    }


def commit() -> str:
    """The commit of the code, with "+" where files that are tracked have changed since."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=HERE, capture_output=True, text=True, check=True).stdout

    changed = "+" if git("status", "--porcelain", "--untracked-files=no", "core", "plugins").strip() else ""
    return git("rev-parse", "--short=12", "HEAD").strip() + changed


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("families", nargs="*", metavar="FAMILY", help="all by default")
    parser.add_argument("--store", type=Path, default=Path(".pliant/store"))
    options = parser.parse_args()
    unknown = set(options.families) - set(FAMILIES)
    if unknown:
        parser.error(f"no data set '{sorted(unknown)[0]}'; there are {', '.join(FAMILIES)}")
    for family in options.families or FAMILIES:
        make(family, options.store)


if __name__ == "__main__":
    main()
