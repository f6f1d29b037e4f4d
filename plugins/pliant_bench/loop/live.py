"""State of an experiment for a live view, read from its folder by any process during the experiment."""

from __future__ import annotations

from typing import Any

from pliant.formatting import output_unit
from pliant_bench.loop.compared import FILE, ModelBand, read_bands
from pliant_bench.loop.folder import OWN_COLUMNS, ExperimentFolder, RoundFolder, read_columns, read_json

MOST_HYPOTHESES = 8


def live_state(folder: ExperimentFolder, run: int = 0, since: int = 0, models: int = -1) -> dict[str, Any]:
    """Return what is being done, the samples that are new, and the verdicts so far.

    Args:
        folder: of the experiment.
        run: number of the run that the viewer shows already.
        since: number of samples of this run that the viewer has.
        models: number of the diagnosis whose models of this run the viewer has; 0 for those that were expected.
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
        is_known = shown.number == run
        state["run"] = _run(shown, since if is_known else 0, models if is_known else -1)
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


def _run(folder: RoundFolder, since: int, models: int) -> dict[str, Any]:
    """Return the samples from `since` on and, unless the viewer has them, what the models read, in display units."""
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
    number = (folder.read(FILE) or {}).get("after_run", 0)
    if number != models and (number or folder.read("expected") is not None):
        run["models"] = {
            "number": number,
            "outputs": {
                output: [_model(one, output_unit(output).factor) for one in bands]
                for output, bands in read_bands(folder).items()
            },
        }
    return run


def _model(band: ModelBand, factor: float) -> dict[str, Any]:
    return {"name": band.name, "time_s": band.time_s, "mean": factor * band.mean, "sd": factor * band.sd}
