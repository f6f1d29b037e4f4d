"""State of an experiment for a live view, read from its folder by any process during the experiment."""

from __future__ import annotations

from typing import Any

from pliant.formatting import output_unit
from pliant_bench.loop.folder import OWN_COLUMNS, ExperimentFolder, RoundFolder, read_columns, read_json

MOST_HYPOTHESES = 8


def live_state(folder: ExperimentFolder, run: int = 0, since: int = 0) -> dict[str, Any]:
    """Return what is being done, the samples that are new, and the verdicts so far.

    Args:
        folder: of the experiment.
        run: number of the run that the viewer shows already; its expected readings are not sent again.
        since: number of samples of this run that the viewer has.
    """
    rounds = folder.rounds()
    shown = rounds[-1] if rounds else None
    state: dict[str, Any] = {
        "status": read_json(folder.path / "status.json"),
        "stopping": folder.stop_file.exists(),
        "runs": [_summary(one) for one in rounds],
        "run": None,
    }
    if shown is not None:
        state["run"] = _run(shown, known=shown.number == run, since=since if shown.number == run else 0)
    return state


def press_stop(folder: ExperimentFolder) -> None:
    """Ask for a stop: the bench vents before its next sample."""
    folder.stop_file.write_text("stop\n", encoding="utf-8")


def _summary(folder: RoundFolder) -> dict[str, Any]:
    plan, recording = folder.read("plan") or {}, folder.read("recording") or {}
    verdict = folder.read("verdict")
    summary = {
        "number": folder.number,
        **{key: plan.get(key) for key in ("name", "why", "expected_nats")},
        **{key: recording.get(key, plan.get(key)) for key in ("words", "minutes")},
        "ending": recording.get("ending"),
        "reason": recording.get("reason"),
    }
    if verdict is not None:
        summary |= {
            "verdict": verdict["verdict"],
            "sentence": verdict["sentence"],
            "obtained_nats": verdict["obtained_nats"],
            "hypotheses": [
                {"kinds": one["kinds"], "probability": one["probability"]}
                for one in verdict["hypotheses"][:MOST_HYPOTHESES]
            ],
        }
    return summary


def _run(folder: RoundFolder, known: bool, since: int) -> dict[str, Any]:
    """Return the samples from `since` on and, unless they are known, the expected readings, in display units."""
    protocol = folder.read_protocol()
    samples = read_columns(folder.samples) if folder.samples.exists() else {}
    names = [name for name in samples if name not in OWN_COLUMNS]
    units = {name: output_unit(name) for name in (*names, *protocol.commands)}
    run: dict[str, Any] = {
        "number": folder.number,
        "duration_s": protocol.duration_s,
        "count": len(samples.get("index", ())),
        "time_s": samples["read_s"][since:] if samples else [],
        "late": samples["late"][since:] if samples else [],
        "series": {name: units[name].factor * samples[name][since:] for name in names},
        "axes": {name: {"label": unit.label, "unit": unit.symbol} for name, unit in units.items()},
        "inputs": list(protocol.commands),
    }
    if not known:
        expected = folder.read_expected()
        run["expected"] = {
            name: {
                "time_s": expected["time_s"],
                "mean": output_unit(name).factor * expected[name],
                "sd": output_unit(name).factor * expected[f"{name} sd"],
            }
            for name in expected
            if f"{name} sd" in expected
        }
    return run
