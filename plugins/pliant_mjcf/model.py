"""The model `mjcf`: a MuJoCo model, driven by recorded inputs and read by its sensors."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from pliant.config.mjcf_files import referenced_files
from pliant.errors import UserError
from pliant.execution.executors import own_threads
from pliant.formatting import number
from pliant.interfaces.effect import AT, EffectParameter
from pliant.interfaces.model import (
    Channel,
    Drive,
    Exported,
    Improved,
    SystemModel,
    SystemParts,
    SystemPicture,
    SystemReadings,
)
from pliant.pipeline.workbench import digest
from pliant.records.design import Array
from pliant.registry.files import shown
from pliant_mjcf.changes import DriveChange, ModelChange, SpecChange, StateForce
from pliant_mjcf.channels import check_unique, check_units, driven_inputs, read_outputs
from pliant_mjcf.config import MjcfModelConfig
from pliant_mjcf.loaded import Loaded
from pliant_mjcf.mjcf import add_sensors, attachments, changed_model, compile_spec, read_spec, world_has
from pliant_mjcf.number_errors import number_changes
from pliant_mjcf.places import has_place
from pliant_mjcf.remarks import run_remarks
from pliant_mjcf.sampling import Samples
from pliant_mjcf.scales import Scales, adapted_parameter
from pliant_mjcf.starts import check_initial, start_state
from pliant_mjcf.stepping import NEVER, Course, March
from pliant_plugins.physics.mujoco.warned import silent


class MjcfModel(SystemModel):
    """A MuJoCo model as an MJCF file; it is read and compiled once per instance."""

    config: MjcfModelConfig
    threads = True

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.config,)

    @cached_property
    def loaded(self) -> Loaded:
        """The compiled file; raises `UserError` for one that cannot be simulated or does not have what is named."""
        config, where = self.config, shown(self.config.file)
        spec = read_spec(config.file)
        model = compile_spec(config.file, spec)
        check_units(where, [*config.inputs, *config.outputs])
        inputs = driven_inputs(where, config, model)
        outputs, added = read_outputs(where, config, model)
        check_unique(where, [*(one.channel for one in inputs), *(one.channel for one in outputs)])
        check_initial(where, config.initial, model)
        if added:
            add_sensors(spec, added)
            model = compile_spec(config.file, spec)
        resting = np.zeros(model.nu)
        for name, value in config.fixed.items():
            resting[model.actuator(name).id] = value
        return Loaded(spec, model, inputs, outputs, resting)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Return the columns that drive actuators."""
        return tuple(one.channel for one in self.loaded.inputs)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Return the columns of sensors, joints and sites."""
        return tuple(one.channel for one in self.loaded.outputs)

    @cached_property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        """Names of hinges and slides, tendons, bodies with mass, and the world."""
        return attachments(self.loaded.model)

    def default_kinds(self, kinds: Sequence[str]) -> list[str]:
        """Return the kinds whose place the model has."""
        places, world = self.attachments, world_has(self.loaded.model)
        return [kind for kind in kinds if AT not in kind and has_place(kind, places, world)]

    @cached_property
    def scales(self) -> Scales:
        """The sizes of forces, speeds, ranges and masses of the model, which follow from the MJCF alone."""
        return Scales.of(self.loaded.model)

    def adapted(self, kind: str, declared: EffectParameter) -> EffectParameter:
        """Return the parameter in the size of the places where it acts; see `pliant_mjcf.scales`."""
        return adapted_parameter(self.scales, kind, declared)

    @property
    def number_error(self) -> float:
        """Return the share that the study states."""
        return self.config.number_error

    def number_changes(self, share: float) -> tuple[object, ...]:
        """Return a change of each number of the file that may be off."""
        return number_changes(self.loaded.model, share)

    def simulate(self, parts: SystemParts, drives: Sequence[Drive]) -> tuple[SystemReadings, ...]:
        """Return the readings of each run; raise `UserError` if all runs of the unchanged MJCF diverge at once."""
        if not drives:
            return ()
        loaded = self.loaded
        with silent():
            model = changed_model(self.config.file, loaded.spec, loaded.model, _known(parts.changes))
            readings, march = self._readings(model, drives, parts.changes)
        if not parts.changes and not parts.inputs:
            self._check_stable(march, drives)
        return readings

    def _readings(
        self, model: Any, drives: Sequence[Drive], changes: Sequence[object]
    ) -> tuple[tuple[SystemReadings, ...], March]:
        """Return the readings of each run by a compiled model, and the runs after their last step."""
        samples = [_samples(drive, model) for drive in drives]
        march = self._march(model, drives, samples, changes)
        tables = _sampled(march, samples, model.nsensordata)
        outputs = self.loaded.outputs
        addresses = {one.sensor: int(model.sensor(one.sensor).adr[0]) for one in outputs}
        return tuple(
            {one.channel.name: table[:, addresses[one.sensor] + one.component] for one in outputs}
            for table in tables
        ), march

    def _march(
        self, model: Any, drives: Sequence[Drive], samples: Sequence[Samples], changes: Sequence[object]
    ) -> March:
        """Return the runs before their first step."""
        courses = []
        known: dict[tuple[Any, ...], Array] = {}
        for drive, one in zip(drives, samples, strict=True):
            control = self.control(drive)
            key = (control[0].tobytes(), tuple(sorted(drive.first.items())))
            if key not in known:  # runs that begin alike settle alike
                known[key] = self.start(model, drive)
            courses.append(Course(known[key], one.steps, _clock(drive), control))
        # a diagnosis already works in several threads
        alone = threading.current_thread() is threading.main_thread()
        return March(
            model,
            courses,
            forces=[one for one in changes if isinstance(one, StateForce)],
            controls=[one for one in changes if isinstance(one, DriveChange)],
            threads=own_threads() if alone else 1,
        )

    def start(self, model: Any, drive: Drive) -> Array:
        """Return the state in which a run begins, of the compiled model."""
        return start_state(
            model, self.config.initial, drive.first, self.loaded.outputs, self.control(drive)[0]
        )

    def control(self, drive: Drive) -> Array:
        """Return (t, nu) ctrl at the samples."""
        control = np.tile(self.loaded.resting, (len(drive.history), 1))
        for one in self.loaded.inputs:
            control[:, one.actuator] = one.control(drive.history.actuation[one.channel.name])
        return control

    def _check_stable(self, march: March, drives: Sequence[Drive]) -> None:
        """Raise `UserError` if every run diverges before its second sample."""
        samples = [_samples(drive, march.model) for drive in drives]
        if all(one.after(int(k))[1:].all() for one, k in zip(samples, march.failed_at, strict=True)):
            step_s = float(march.model.opt.timestep)
            raise UserError(
                f"{shown(self.config.file)}: the simulation diverges at once, in run '{drives[0].history.run}' after "
                f"{number(step_s * float(march.failed_at[0]))} s; a smaller timestep (now {number(step_s)} s) or the "
                "integrator implicitfast may help."
            )

    def remarks(self, drives: Sequence[Drive]) -> tuple[str, ...]:
        """Return sentences on inputs beyond ctrlrange, runs that diverge, and contacts that chatter."""
        if not drives:
            return ()
        model = self.loaded.model
        with silent():
            march = self._march(model, drives, [_samples(drive, model) for drive in drives], ())
            return run_remarks(march, drives, self.loaded.inputs)

    def step_error(self, drives: Sequence[Drive]) -> Mapping[str, float]:
        """Return the RMS change of each output, SI, with half the file's time step."""
        whole, half = self.loaded.model, self.loaded.model.__copy__()
        half.opt.timestep *= 0.5
        with silent():
            read = [self._readings(model, drives, ())[0] for model in (whole, half)]
        found = {}
        for name in read[0][0]:
            change = np.concatenate([b[name] - a[name] for a, b in zip(*read, strict=True)])
            if np.isfinite(change).all():
                found[name] = float(np.sqrt(np.mean(change**2)))
        return found

    def export(self, improved: Improved, target: Path) -> Exported:
        """Write an MJCF with the effects that it can say, and a module for the others; see `pliant_mjcf.export`."""
        from pliant_mjcf.export.files import export_files

        return export_files(self, improved, target)

    def picture(self, places: Sequence[tuple[str, str]]) -> SystemPicture | None:
        """Return the geoms as MuJoCo shows them, and where joints, tendons, bodies, inputs and outputs are."""
        from pliant_mjcf.picture import draw

        loaded = self.loaded
        names = {
            ("input", one.channel.name): ("actuator", loaded.model.actuator(one.actuator).name)
            for one in loaded.inputs
        }
        names |= {("output", one.channel.name): ("sensor", one.sensor) for one in loaded.outputs}
        return draw(loaded.model, [names.get(place, place) for place in places])

    def fingerprint(self) -> Mapping[str, Any]:
        """Return the digests of the MJCF and of every file that it reads, and MuJoCo's version."""
        folder = self.config.file.parent
        files = referenced_files(self.config.file) if self.config.file.is_file() else ()
        names = {
            str(file.relative_to(folder) if file.is_relative_to(folder) else file): file for file in files
        }
        return {"files": {name: digest(file) for name, file in names.items()}, "mujoco": mujoco.__version__}


def _known(changes: Sequence[object]) -> Sequence[object]:
    """Return the changes; raise `TypeError` for one that is not of a MuJoCo model."""
    for one in changes:
        if not isinstance(one, ModelChange | SpecChange | StateForce | DriveChange):
            raise TypeError(f"{type(one).__name__} is no change of a MuJoCo model")
    return changes


def _clock(drive: Drive) -> Array:
    """Return (t,) the time from the first sample on."""
    time_s = drive.history.time_s
    assert time_s is not None
    return np.asarray(time_s - time_s[0])


def _samples(drive: Drive, model: Any) -> Samples:
    return Samples.at(_clock(drive), float(model.opt.timestep))


def _sampled(march: March, samples: Sequence[Samples], size: int) -> list[Array]:
    """Return (t, size) the numbers of all sensors at the samples of each run; NaN from where it diverges."""
    readings = [np.zeros((len(one.before), size)) for one in samples]
    for piece in march.pieces(("sensordata",)):
        for k, records in zip(piece.runs, piece.records["sensordata"], strict=True):
            samples[k].add(readings[k], piece.begin, records)
    for one, table, failed in zip(samples, readings, march.failed_at, strict=True):
        wrong = np.asarray(~np.isfinite(table).all(axis=1))
        if failed != NEVER:
            wrong = wrong | one.after(int(failed))
        table[np.maximum.accumulate(wrong)] = np.nan
    return readings
