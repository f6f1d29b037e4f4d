"""Scripted users of the evidence page on sets of the bed: are results those of `pliant improve`, with warnings?

    python -m benchmarks.page_users --cases 20
    python -m benchmarks.page_users --cases 3 --first 7   # these three again, with stored results of the others

Each drops a study and its recording, looks, diagnoses, ticks probable effects, fits, saves; then presses Improve; then
adds an effect that is absent from the truth. Sets are of the calibration split, with an effect hidden in each, on the
joint.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.output import make_parser, read, write
from tests.app.page_user import PageUser, opened

from pliant import api
from pliant_app.open_model import OpenModel
from pliant_app.page_state import Effects

KINDS = (
    "viscoelastic", "actuation_gain", "stiffness", "sensor_scale", "friction_hysteresis", "backlash", "dead_zone",
    "supply_lag", "sensor_bias", "permanent_set",
)  # fmt: skip
SNR = 2.5
CLOSE = 0.02


def specs(count: int, protocol: str, first: int = 0) -> list[SetSpec]:
    """Return sets of all kinds in turn, with other seeds in each round; `first` continues an earlier call."""
    return [
        SetSpec(KINDS[k % len(KINDS)], 500 + k, "functional", "joint", protocol, "calibration", SNR)
        for k in range(first, first + count)
    ]


def played(spec: SetSpec, folder: Path, store: Path) -> dict[str, Any]:
    """Play one user's session on one set."""
    made = make_set(spec)
    return {"hidden": spec.kind, **on_the_page(made.csv, made.study, made.label["kinds"], folder, store)}


def on_the_page(csv: str, study: str, hidden: list[str], folder: Path, store: Path) -> dict[str, Any]:
    """Run a user's session on a recording and a study, from an empty page."""
    dropped = [folder / "bench.csv", folder / "robot.yaml"]
    dropped[0].write_text(csv)
    dropped[1].write_text(study)
    with opened(folder / "session", store) as (page, _):
        return story(PageUser(page), dropped, hidden, store)


def story(user: PageUser, dropped: list[Path], hidden: list[str], store: Path) -> dict[str, Any]:
    """Drop, look, diagnose, tick, save; improve; add an effect that is not there."""
    shown_s = user.drop(dropped)
    said = user.look()
    ticked = user.improve_by_hand()
    own, mine = user.page.evaluate("view.model.cursor"), user.save()
    doubts = user.warnings()
    effects = {"mine": _effects(mine, store)}
    user.improve()
    effects["improve"] = tuple(user.page.evaluate("view.model.effects"))
    user.go_back(own)
    false = user.false_kind(hidden)
    warned = None
    if false:
        user.tick(false)
        user.fit()
        warned = [one for one in user.warnings() if false in one]
    files = Path(user.page.evaluate("view.folder")) / "files"
    model = OpenModel.open(files / dropped[1].name, [files / dropped[0].name], store)
    noise = model.noise(model.predicted(effects["improve"]))
    aside = {name: model.errors(model.predicted(one), noise).aside for name, one in effects.items()}
    plain = model.errors(model.predicted(model.own_effects), noise).aside
    return {
        "first_screen_s": round(shown_s, 2),
        "said": said,
        "ticked": ticked,
        "doubts_of_the_right_one": doubts,
        "aside": {"as_it_was": plain, **aside},
        "effects": {name: list(one) for name, one in effects.items()},
        "within_2_percent": bool(aside["mine"] <= (1.0 + CLOSE) * aside["improve"]),
        "false_add": false,
        "warned": warned,
    }


def _effects(study: Path, store: Path) -> Effects:
    return tuple(effect.canonical() for effect in api.open_study(study, store=store).study.effects)


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a summary over all users."""
    offered = [row for row in rows if row["false_add"]]
    return {
        "cases": len(rows),
        "within_2_percent_of_improve": sum(row["within_2_percent"] for row in rows),
        "false_adds": len(offered),
        "warned": sum(bool(row["warned"]) for row in offered),
        "right_ones_doubted": sum(bool(row["doubts_of_the_right_one"]) for row in rows if row["ticked"]),
        "first_screen_s": float(np.median([row["first_screen_s"] for row in rows])),
        "rows": rows,
    }


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--protocol", default="example")
    given = parser.parse_args()
    kept = {row["case"]: row for row in read("page_users").get("rows", [])}
    with tempfile.TemporaryDirectory() as text:
        for k, spec in enumerate(specs(given.cases, given.protocol, given.first), given.first):
            folder = Path(text) / f"user-{k}"
            folder.mkdir()
            kept[k] = {"case": k, **played(spec, folder, Path(text) / "store")}
            print(json.dumps(kept[k]), flush=True)
            write("page_users", summary([kept[case] for case in sorted(kept)]))


if __name__ == "__main__":
    main()
