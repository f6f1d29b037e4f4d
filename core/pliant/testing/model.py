"""Checks of a `SystemModel`: channels, runs that repeat and do not affect each other, places, derivatives."""

from __future__ import annotations

import json
import pickle
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.effect import AT, Place
from pliant.interfaces.model import Channel, Drive, SystemModel, SystemParts, SystemReadings
from pliant.records.design import Array
from pliant.records.history import History
from pliant.registry.discovery import Registry, discover
from pliant.testing import CheckSkipped, Subject, agree, declared, require
from pliant.units import UnitError, parse_quantity, split_unit

SAMPLES, SECONDS = 61, 1.5
STEP = 1e-4  # of a parameter's plausible range
SLOPE_TOLERANCE = 1e-2  # of the largest slope: differences of a simulation are coarse
SIGNALS = ("input", "output")


def sample_drives(model: SystemModel) -> tuple[Drive, ...]:
    """Return three short runs within the ranges of the inputs: two motions and one at rest."""
    clock = np.linspace(0.0, SECONDS, SAMPLES)
    drives = []
    for run, size in enumerate((0.3, -0.2, 0.0)):
        inputs = {channel.name: _wave(channel, clock, size, k + 1) for k, channel in enumerate(model.inputs)}
        drives.append(Drive(History.from_arrays(inputs, clock, run=f"r{run}")))
    return tuple(drives)


def sample_parts(model: SystemModel) -> SystemParts:
    """Return the parts of a model without effects."""
    names = tuple(tuple(channel.name for channel in some) for some in (model.inputs, model.outputs))
    return SystemParts(names=(names[0], names[1]))


def sample_registry(subject: Subject, model: SystemModel) -> Registry:
    """Return the registry with the effects of this kind of model."""
    return discover().for_model(subject.component.kind, model.adapted, model.words)


def _wave(channel: Channel, clock: Array, size: float, cycles: int) -> Array:
    low = channel.low if channel.low is not None else min(-1.0, (channel.high or 0.0) - 2.0)
    high = channel.high if channel.high is not None else max(1.0, low + 2.0)
    rest = min(max(0.0, low), high)
    middle = rest if low < rest < high else (low + high) / 2
    wave = np.sin(2.0 * np.pi * cycles * clock / SECONDS)
    return np.asarray(middle + size * min(high - middle, middle - low) * wave, float)


def _readings(model: SystemModel) -> tuple[SystemReadings, ...]:
    return model.simulate(sample_parts(model), sample_drives(model))


def _require_same(got: Sequence[SystemReadings], wanted: Sequence[SystemReadings], finding: str) -> None:
    for one, other in zip(got, wanted, strict=True):
        same = set(one) == set(other) and all(
            np.array_equal(one[name], other[name], equal_nan=True) for name in other
        )
        require(same, finding)


@declared
def declares_its_channels(subject: Subject) -> None:
    """a model has inputs and outputs with unique names; a name that ends with a unit has this unit, and a range is
    ordered."""
    model: SystemModel = subject.build()
    for what, channels in (("inputs", model.inputs), ("outputs", model.outputs)):
        require(channels, f"it has no {what}: nothing could be compared")
    names = [channel.name for channel in (*model.inputs, *model.outputs)]
    require(all(names), "a channel has an empty name")
    twice = next((name for name in names if names.count(name) > 1), "")
    require(not twice, f"two channels have the name '{twice}'")
    for channel in (*model.inputs, *model.outputs):
        stated, named = channel.unit, split_unit(channel.name)[1]
        require(not named or stated == named, f"channel '{channel.name}' has the unit '{stated}'")
        try:
            parse_quantity(f"1 {stated}" if stated else "1", stated or "dimensionless")
        except UnitError as error:
            require(False, f"the unit '{stated}' of channel '{channel.name}' is not known ({error})")
        low, high = channel.low, channel.high
        require(low is None or high is None or low < high, f"'{channel.name}' has the range {low} to {high}")


@declared
def declares_its_places(subject: Subject) -> None:
    """`attachments` gives unique names by a kind of place that effects may have; inputs and outputs are left out."""
    for place, names in subject.build().attachments.items():
        known = [one for one in get_args(Place) if one not in SIGNALS]
        require(place in known, f"'{place}' is no kind of place; write one of {', '.join(known)}")
        require(isinstance(names, tuple), f"the places '{place}' are {names!r}, no tuple of names")
        require(len(set(names)) == len(names), f"two places '{place}' have one name: {', '.join(names)}")
        at = next((name for name in names if AT in name), "")
        require(not at, f"the place '{at}' has an '{AT}', which separates an effect from its place")


def gives_every_output_at_every_sample(subject: Subject) -> None:
    """`simulate` gives every output of every run as (t,) floats; from the sample at which a run diverges on they are
    NaN, and only then."""
    model: SystemModel = subject.build()
    drives = sample_drives(model)
    found = model.simulate(sample_parts(model), drives)
    require(len(found) == len(drives), f"{len(drives)} runs gave {len(found)} results")
    for readings in found:
        for channel in model.outputs:
            require(channel.name in readings, f"a run has no '{channel.name}'")
            values = np.asarray(readings[channel.name])
            require(
                values.shape == (SAMPLES,),
                f"'{channel.name}' of {SAMPLES} samples is of shape {values.shape}",
            )
            require(values.dtype == float, f"'{channel.name}' is an array of {values.dtype}, not of floats")
            lost = ~np.isfinite(values)
            require(not np.isinf(values).any(), f"'{channel.name}' is infinite; write NaN from there on")
            require(
                np.array_equal(lost, np.maximum.accumulate(lost)),
                f"'{channel.name}' is finite again after NaN",
            )
            require(not lost.all(), f"'{channel.name}' of a short run near rest has no finite value")


def inputs_drive_it(subject: Subject) -> None:
    """readings depend on the inputs."""
    first, second, _ = _readings(subject.build())
    moved = any(not np.allclose(first[name], second[name], rtol=1e-9, atol=0.0) for name in first)
    require(moved, "two runs with different inputs have the same readings: the histories are not used")


def repeats_itself(subject: Subject) -> None:
    """the same runs give the same numbers, whatever was simulated before, and the histories are not changed."""
    model: SystemModel = subject.build()
    drives = sample_drives(model)
    before = [{name: v.copy() for name, v in drive.history.actuation.items()} for drive in drives]
    first = model.simulate(sample_parts(model), drives)
    for drive, inputs in zip(drives, before, strict=True):
        same = all(np.array_equal(drive.history.actuation[name], v) for name, v in inputs.items())
        require(same, "simulate changed the inputs of a run in place")
    again = model.simulate(sample_parts(model), sample_drives(model))
    _require_same(
        again, first, "a second simulation of the same runs differs: it keeps a state, or draws at random"
    )


def runs_do_not_affect_each_other(subject: Subject) -> None:
    """a run alone, or in another order, gives the same numbers."""
    model: SystemModel = subject.build()
    parts, drives = sample_parts(model), sample_drives(model)
    together = model.simulate(parts, drives)
    backwards = model.simulate(parts, drives[::-1])[::-1]
    _require_same(backwards, together, "in another order the runs differ: one starts where another ends")
    alone = [model.simulate(parts, [drive])[0] for drive in drives]
    _require_same(alone, together, "a run alone differs from the same run among others")


def survives_pickling(subject: Subject) -> None:
    """a model can be sent to a worker, where it gives the same numbers."""
    model: SystemModel = subject.build()
    sent: SystemModel = pickle.loads(pickle.dumps(model))
    _require_same(_readings(sent), _readings(model), "the copy in a worker gives other numbers")


def fingerprint_identifies_the_files(subject: Subject) -> None:
    """`fingerprint` is JSON, the same for the same files, and changes with the content of a file of the config."""
    config, model = subject.config, subject.build()
    found = json.dumps(dict(model.fingerprint()), sort_keys=True, allow_nan=False)
    again = json.dumps(dict(subject.build().fingerprint()), sort_keys=True)
    require(found == again, "two models of one config have different fingerprints")
    files = {name: value for name, value in config if isinstance(value, Path) and value.is_file()}
    for name, file in files.items():
        with tempfile.TemporaryDirectory() as folder:
            other = Path(folder) / file.name
            other.write_bytes(file.read_bytes() + b"\n")
            changed = subject.build(config.model_copy(update={name: other})).fingerprint()
        same = json.dumps(dict(changed), sort_keys=True) == found
        require(
            not same,
            f"the fingerprint is the same after a change of the file in '{name}': stored answers would stay",
        )


def proposes_effects_that_it_can_have(subject: Subject) -> None:
    """each kind of `default_kinds` is a known effect, whose parameters `adapted` leaves valid; `words` are one line."""
    model: SystemModel = subject.build()
    registry = sample_registry(subject, model)
    for kind in model.default_kinds(registry.kinds("effect")):
        try:
            parameters = registry.fit_parameters(kind)
        except UserError as error:
            require(False, f"default_kinds has '{kind}', which is no effect of this model ({error})")
        for one in parameters:
            problem = one.problem()
            require(problem is None, f"adapted gives '{kind}' an invalid '{one.name}': {problem}")
        words = model.words(kind)
        require(
            isinstance(words, str) and "\n" not in words, f"the words on '{kind}' are {words!r}, not one line"
        )


def derivatives_are_slopes(subject: Subject) -> None:
    """`vary`, if it gives derivatives, agrees with differences of `simulate`."""
    model: SystemModel = subject.build()
    moves = _moves(subject, model)
    drives, parts = sample_drives(model), sample_parts(model)
    towards = [up for up, _ in moves.values()]
    found = model.vary(parts, towards, drives) if moves else None
    if found is None:
        raise CheckSkipped("the model has no derivatives: differences stand for them")
    _require_same(found[0], model.simulate(parts, drives), "vary and simulate give different readings")
    for (kind, (up, down)), change in zip(moves.items(), found[1], strict=True):
        pairs = zip(change, model.simulate(up, drives), model.simulate(down, drives), strict=True)
        for got, above, below in pairs:
            for name, slope in got.items():
                central = (above[name] - below[name]) / 2
                largest = float(np.abs(central).max())
                agree(
                    slope,
                    central,
                    f"the derivative of '{name}' in {kind} is not the slope of the readings",
                    atol=SLOPE_TOLERANCE * largest + 1e-12,
                )


def _moves(subject: Subject, model: SystemModel) -> dict[str, tuple[SystemParts, SystemParts]]:
    """Return the parts a small step to either side, by kind of effect inside the model."""
    registry, found = sample_registry(subject, model), {}
    inside = [kind for kind in model.default_kinds(registry.kinds("effect")) if AT in kind]
    for kind in inside:
        component = registry.get("effect", kind)
        for one in registry.fit_parameters(kind):
            step = STEP * (one.plausible[1] - one.plausible[0])
            ends = []
            for at in (one.neutral + step, one.neutral - step):
                config = component.config_model()(kind=kind).model_copy(update={one.name: at})
                ends.append(component.build(config).apply(sample_parts(model)))
            found[f"{kind}.{one.name}"] = (ends[0], ends[1])
    return found


def remarks_are_sentences(subject: Subject) -> None:
    """`remarks` are sentences."""
    model: SystemModel = subject.build()
    for remark in model.remarks(sample_drives(model)):
        require(isinstance(remark, str) and remark.endswith("."), f"a remark is {remark!r}, not a sentence")
